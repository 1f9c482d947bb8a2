# SPDX-License-Identifier: GPL-3.0-or-later
"""The example script learns from a dataset as the docs say."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
from sweep_runs import new_study, write_press

from palpate.sweep.dataset import publish


def test_contact_is_learnt_from_presses(tmp_path, repository):
    """Even thirty runs place a contact of an unseen run better than always answering the mean."""
    pytest.importorskip("sklearn", exc_type=ImportError)
    study = new_study(tmp_path / "study")
    for index in range(40):
        write_press(study, index)
    publish(study)
    script = repository / "examples" / "train_contact.py"
    found = subprocess.run([sys.executable, script, study], capture_output=True, text=True, check=True, env=dict(os.environ))
    errors = [float(x) for x in re.findall(r"position +([\d.]+) mm", found.stdout)]
    assert len(errors) == 2 and errors[0] < 0.8 * errors[1]
    assert (study / "train_contact.png").read_bytes().startswith(b"\x89PNG")
