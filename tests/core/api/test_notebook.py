# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebook for beginners runs as it stands, and its pictures are those that its cells draw."""

from __future__ import annotations

import json

import pytest

MOST_LINES = 60


@pytest.fixture(scope="module")
def executed(repository, tmp_path_factory):
    """The notebook, run in a copy of its place in the repository."""
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    root = tmp_path_factory.mktemp("notebook")
    (root / "examples" / "notebooks").mkdir(parents=True)
    (root / "docs").symlink_to(repository / "docs", target_is_directory=True)
    notebook = nbformat.read(repository / "examples" / "notebooks" / "first_touch.ipynb", as_version=4)
    client = nbclient.NotebookClient(
        notebook, timeout=900, resources={"metadata": {"path": str(root / "examples" / "notebooks")}}
    )
    return client.execute()


def outputs_of(cells):
    return [output for cell in cells if cell.cell_type == "code" for output in cell.outputs]


@pytest.mark.long("executes the notebook")
def test_it_says_what_a_weight_and_a_gap_are(executed):
    texts = "".join(output.get("text", "") for output in outputs_of(executed.cells))
    assert "9.8100 N" in texts
    assert "sure" in texts


@pytest.mark.long("executes the notebook")
def test_every_drawing_is_shown(executed):
    found = [output.data for output in outputs_of(executed.cells) if "data" in output]
    assert sum("image/png" in one for one in found) == 4
    assert sum("<svg" in str(one.get("text/html", "")) for one in found) == 1
    assert sum("data:image/png;base64" in str(one.get("text/html", "")) for one in found) == 1


def test_it_is_short_and_has_its_pictures(repository):
    notebook = json.loads((repository / "examples" / "notebooks" / "first_touch.ipynb").read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    lines = [line for cell in code for line in "".join(cell["source"]).splitlines() if line.strip()]
    assert len(lines) < MOST_LINES
    images = [output for cell in code for output in cell["outputs"] if "image/png" in output.get("data", {})]
    assert len(images) == 4
