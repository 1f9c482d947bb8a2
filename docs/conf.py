# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the documentation site, which `make docs` builds from README.md, docs/ and the docstrings of core."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tools")]
os.environ["PALPATE_NUMBA"] = "0"  # kernels stay plain functions, whose signature and docstring Sphinx can read

import api_pages  # noqa: E402
from docutils import nodes  # noqa: E402
from sphinx import addnodes  # noqa: E402

project = "Palpate"
copyright = "the contributors of Palpate"  # noqa: A001
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]

# The source folder is the repository, so that links between README.md and docs/ are the same here and in a clone.
root_doc = "docs/index"
include_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/**.md", "benchmarks/RESULTS.md", "tests/ui/README.md"]
exclude_patterns = [".*", "build", "dist", "demo-output", "core", "addon", "**/node_modules", "*.egg-info"]

myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
suppress_warnings = ["myst.header"]  # a page may begin at a deeper heading

napoleon_google_docstring = False
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types with shapes and units
autodoc_default_options = {"members": True, "show-inheritance": True}
python_use_unqualified_type_names = True
add_module_names = False

html_theme = "furo"
html_title = "Palpate"
html_static_path: list[str] = []
html_copy_source = False


def setup(app) -> None:
    """Write the pages of the API before Sphinx looks for its sources, and a page at the top that leads to the first one."""
    api_pages.write(ROOT / "docs" / "api")
    app.connect("doctree-read", read_shapes_as_words)
    app.connect("build-finished", lead_to_first_page)


def read_shapes_as_words(app, doctree) -> None:
    """Take back the links that Sphinx makes of each word of a type, as of `rows` in "(rows, columns) float".

    No class of Palpate is written in small letters, and several have an attribute of such a name.
    """
    for link in list(doctree.findall(addnodes.pending_xref)):
        if (
            link.get("reftype") == "class"
            and not link.get("refexplicit")
            and link["reftarget"].islower()
            and "." not in link["reftarget"]
        ):
            link.replace_self(nodes.emphasis(text=link["reftarget"]))


def lead_to_first_page(app, exception) -> None:
    """Write index.html, which goes on to the first page."""
    if exception is None:
        text = (
            '<!doctype html><meta http-equiv="refresh" content="0; url=docs/index.html"><a href="docs/index.html">Palpate</a>'
        )
        Path(app.outdir, "index.html").write_text(text + "\n", encoding="utf-8")
