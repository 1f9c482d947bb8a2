# SPDX-License-Identifier: GPL-3.0-or-later
"""Every reader of files, fuzzed with the structure of its format in mind: only a PalpateError ever comes out."""

import os

import pytest
from hypothesis import HealthCheck, given, seed, settings

from palpate.attack.area import CLEAR
from palpate.attack.damaged_files import bake_files, judge, readers

EXAMPLES = int(os.environ.get("PALPATE_EXAMPLES", "120"))
"""Tries per reader."""

fuzzed = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)


LONG = dict.fromkeys(("rig of any words", "unfinished bake"), pytest.mark.long(f"{EXAMPLES} tries at what reads many files"))


@pytest.mark.parametrize("name", [pytest.param(name, marks=LONG.get(name, ())) for name in readers()])
def test_a_damaged_file_is_one_sentence(name):
    reader = readers()[name]

    @seed(1)
    @fuzzed
    @given(reader.inputs)
    def try_out(files):
        outcome, words = judge(reader, files)
        assert outcome == CLEAR, words

    try_out()


@pytest.mark.parametrize("kind", ["grid", "uv"])
def test_the_undamaged_bake_is_read(kind):
    good = {f"bake/pad/{name}": content for name, content in bake_files(kind).items()}
    assert judge(readers()["recording"], good) == (CLEAR, "")
