# SPDX-License-Identifier: GPL-3.0-or-later
"""The notebook for beginners runs as it stands."""

from __future__ import annotations

import pytest


@pytest.mark.long("executes the notebook")
def test_it_says_what_a_weight_and_a_gap_are_and_shows_every_drawing(repository, tmp_path):
    """In a copy of its place in the repository."""
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    folder = tmp_path / "examples" / "notebooks"
    folder.mkdir(parents=True)
    (tmp_path / "docs").symlink_to(repository / "docs", target_is_directory=True)
    notebook = nbformat.read(repository / "examples" / "notebooks" / "first_touch.ipynb", as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=900, resources={"metadata": {"path": str(folder)}})
    outputs = [output for cell in client.execute().cells if cell.cell_type == "code" for output in cell.outputs]
    texts = "".join(output.get("text", "") for output in outputs)
    assert "9.8100 N" in texts and "sure" in texts
    found = [output.data for output in outputs if "data" in output]
    assert sum("image/png" in one for one in found) == 4
    assert sum("<svg" in str(one.get("text/html", "")) for one in found) == 1
    assert sum("data:image/png;base64" in str(one.get("text/html", "")) for one in found) == 1
