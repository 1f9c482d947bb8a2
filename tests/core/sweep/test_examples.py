# SPDX-License-Identifier: GPL-3.0-or-later
"""The example scripts read a dataset as the docs say."""

from __future__ import annotations

import json
import os
import re
import runpy
import subprocess
import sys

import numpy as np
import pytest
from sweep_runs import new_study, published, solved_press

parquet = pytest.importorskip("pyarrow.parquet")


@pytest.mark.long("learns from a data set")
def test_contact_is_learnt_from_presses(tmp_path, repository):
    """Seventy-five runs place a contact of an unseen run better than always answering the mean."""
    pytest.importorskip("sklearn", exc_type=ImportError)
    study = published(new_study(tmp_path / "study"), [solved_press(index)[0] for index in range(100)])
    script = repository / "examples" / "train_contact.py"
    found = subprocess.run([sys.executable, script, study], capture_output=True, text=True, check=True, env=dict(os.environ))
    errors = [float(x) for x in re.findall(r"position +([\d.]+) mm", found.stdout)]
    assert len(errors) == 2 and errors[0] < 0.8 * errors[1]
    assert (study / "train_contact.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.long("runs an example, which opens the data set in libraries that are loaded for it")
def test_a_batch_is_drawn(tmp_path, repository):
    """Of a pad whose texels form a picture; the forces in the titles are those of the frames."""
    study = published(new_study(tmp_path / "study"), [solved_press(index)[0] for index in range(4)])
    script = repository / "examples" / "plot_batch.py"
    found = subprocess.run([sys.executable, script, study], capture_output=True, text=True, check=True, env=dict(os.environ))
    assert re.match(r"12 of \d+ frames with contact: ", found.stdout)
    assert (study / "batch.png").read_bytes().startswith(b"\x89PNG")


def test_texels_of_a_picture_are_where_they_are(tmp_path, repository):
    """Row by row, as the picture is: each texel's force stands at its own place."""
    study = published(new_study(tmp_path / "study"), [solved_press(0)[0]])
    example = runpy.run_path(str(repository / "examples" / "plot_batch.py"))
    features = json.loads((study / "dataset" / "meta" / "info.json").read_text(encoding="utf-8"))["features"]
    shape = features["observation.tactile.pad"]["shape"]
    found = example["texels_of"](study / "dataset", "pad", shape)
    table = parquet.read_table(study / "dataset" / "data")
    images = example["column"](table, "observation.tactile.pad", int(np.prod(shape))).reshape(len(table), -1, 3)
    centres = example["column"](table, "contact.centre_of_pressure.pad", 3)
    frame = int(np.argmax(images[..., 0].sum(axis=1)))
    weights = images[frame, :, 0]
    middle = weights @ found["position"] / weights.sum()
    np.testing.assert_allclose(middle[:2], centres[frame, :2], atol=2e-4)  # contact points lie off the texels by the depth
    np.testing.assert_allclose(np.cross(found["normal"], found["tangent"]), found["second"])
