# SPDX-License-Identifier: GPL-3.0-or-later
"""A damaged file of any format is refused in one sentence or read as a whole, whatever reads it."""

import os

import pytest
from bad_files import (
    LOG_WRITERS,
    fault_in,
    log_files,
    readers,
    rig_from_log,
    write_files,
)
from hypothesis import HealthCheck, given, seed, settings

EXAMPLES = int(os.environ.get("PALPATE_EXAMPLES", "120"))
"""Tries per kind of file."""

tries = settings(
    max_examples=EXAMPLES,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.large_base_example],
)


@pytest.mark.long(f"{EXAMPLES} damaged files of each kind")
@pytest.mark.parametrize("kind", readers())
def test_a_damaged_file_is_one_sentence(kind):
    reader = readers()[kind]

    @seed(1)
    @tries
    @given(reader.inputs)
    def try_out(files):
        assert not (fault := fault_in(reader, files)), fault

    try_out()


@pytest.mark.parametrize("kind", LOG_WRITERS)
def test_an_undamaged_log_becomes_a_rig(kind, tmp_path):
    write_files(tmp_path, log_files(kind))
    rig_from_log(f"log.{kind}", tmp_path)
    assert (tmp_path / "rig" / "rig.toml").is_file()
