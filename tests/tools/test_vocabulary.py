# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences for a reader use the field's terms: expressions that were replaced by a term do not come back."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
READ_BY_USERS = (
    *(
        "addon",
        "api",
        "commands",
        "core/effects",
        "core/export",
        "core/gap",
        "core/model",
        "core/simulators",
        "core/solver",
        "core/study",
    ),
    *("operators", "panels", "docs", "sweep"),
)
"""Folders whose strings and pages a user reads."""

INSTEAD = {
    r"\bAdvised (step|are)\b": "Recommended",
    r"\bTexels that touch\b": "Texels in contact",
    r"\bbrightest texel errs\b": "Largest texel error",
    r"\bsomething has changed since\b": "The scene has changed since this bake",
    r"\bwhich can do without\b": "optional",
    r"\broot mean square of what is left\b": "root mean square residual",
    r"\ball that varies is known\b": "all varied parameters are handled",
    r"\bnothing that forces move\b": "free body",
    r"\bk in number\b": "Numerically ... of k",
    r"\btakes? no part\b": "is not part of the simulation",
    r"\b(was|were) not taken over\b": "not imported",
    r"\bunfelt\b": "without contact",
    r"\bnothing from outside is felt\b": "contact from outside is not measured",
    r"\bFeels and is read out\b": "Measures contact forces",
    r"\bbut (is )?not read out\b": "Compliant, without read-out",
    r"\bwears? (the|no) (active )?material\b": "has the material",
    r"\bwhat was (there|found|computed) before\b": "the earlier bake, earlier results",
    r"\bthat is lacking\b": "error",
    r"\bsinks in as far\b": "has the same penetration",
    r"\bmeans nothing beside\b": "has no meaning for",
    r"\bbefore it carries\b": "dead zone",
    r"\bthat is advised\b": "recommended",
    r"\bgoes on where it was\b": "continues",
    r"\bWhat an impact loses\b": "Energy loss of an impact",
    r"\bshare 1 - α v\b": "Restitution",
    r"\btold from (all )?others\b": "distinguishable from all others",
    r"\b(is|are) to be told (apart|from)\b": "to distinguish",
    r"\b[Nn]ot told apart\b": "indistinguishable",
    r"\btrembl(e|es|ing)\b": "noisy, noise",
    r"\bnone came near\b": "no close alternative",
    r"\bmemory of the noise\b": "noise correlation",
    r"\bsomething without load\b": "non-zero reading without load",
    r"\ba first look (promised|found)\b": "screening estimate",
    r"\b(borne|bears? (the|a|an) [\w ]{1,40}) out\b": "confirmed, passes, fails",
    r"\bwhat is left (varies|of it|\()": "the residual",
    r"\blooked at predicts\b": "does not correlate with any measured quantity",
    r"\bnot held against\b": "does not count",
    r"\b(may|only) makes? up for\b": "compensates for",
}
"""Each expression, and the words to use in its place."""
EVERYWHERE = {
    r"\b[Aa]new\b": "again",
    r"\b(gives?|gave|giving|given) way\b": "is displaced, is indented, yields",
    r"\b[Ww]hat (presses|is pressed)\b": "the indenter, the object in contact",
    r"\b[Ww]hat a camera\b": "camera image",
}
"""The same for comments and docstrings of the whole repository, tests and tools included."""
WRITTEN = {".py", ".md", ".toml"}
NOT_OURS = {"build", "dist", "demo-output"}
"""Folders of products, which git ignores."""


def findings(text: str, instead: dict[str, str] = INSTEAD) -> list[str]:
    """Return one line for each expression in a text that has a plainer one."""
    return [f"{found.group()!r}: write {term!r}" for old, term in instead.items() for found in re.finditer(old, text)]


def files() -> list[Path]:
    return sorted(path for folder in READ_BY_USERS for path in (ROOT / folder).rglob("*") if path.suffix in {".py", ".md"})


def all_files() -> list[Path]:
    """Return what the repository holds of text: its folders but for environments, build products and hidden ones."""
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name[0] not in "._" and path.name not in NOT_OURS]
    found = [path for folder in folders for path in folder.rglob("*")] + list(ROOT.iterdir())
    return sorted(path for path in found if path.suffix in WRITTEN and path.is_file() and path != Path(__file__))


def found_in(paths: list[Path], instead: dict[str, str]) -> dict[str, list[str]]:
    """Return the findings of each file that has any."""
    return {str(path.relative_to(ROOT)): found for path in paths if (found := findings(path.read_text("utf-8"), instead))}


def test_no_replaced_expression_is_left():
    assert len(files()) > 100
    assert found_in(files(), INSTEAD) == {}


def test_no_expression_is_left_that_is_replaced_everywhere():
    assert len(all_files()) > len(files())
    assert found_in(all_files(), EVERYWHERE) == {}


@pytest.mark.parametrize(
    ("text", "count"),
    [("Advised step: 1 ms. 'Grid' takes no part.", 2), ("The reading trembles.", 1), ("Recommended step: 1 ms.", 0)],
)
def test_an_expression_is_found(text, count):
    assert len(findings(text)) == count
