# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/sample-rig is what its script writes, small, and read without complaint."""

import numpy as np
import pytest
import sample_rig

from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.report.comparison import gap_errors
from palpate.core.gap.selection.diagnosis import diagnose
from palpate.core.jobs import run_job


def test_the_sample_rig_is_what_its_script_writes(tmp_path):
    sample_rig.main(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {path.name for path in sample_rig.FOLDER.iterdir()}
    assert (tmp_path / "rig.toml").read_text() == (sample_rig.FOLDER / "rig.toml").read_text()
    made, kept = read_rig(tmp_path / "rig.toml"), read_rig(sample_rig.FOLDER / "rig.toml")
    assert not kept.warnings and len(kept.texels) == 84
    for one, other in zip(made.trials, kept.trials, strict=True):
        np.testing.assert_array_equal(one.position, other.position)
        assert np.abs(one.reading - other.reading).max() <= 1  # a count may be rounded otherwise on another machine
    assert sum(path.stat().st_size for path in sample_rig.FOLDER.iterdir()) < 500_000


@pytest.mark.long("a whole diagnosis of the sample rig")
def test_what_is_hidden_in_the_sample_rig_is_named_and_nothing_else():
    """What the library's creep and gain lack beside the generator's is no noise that grows with the reading."""
    found = run_job(diagnose(read_rig(sample_rig.FOLDER / "rig.toml")))
    assert sorted(named.name for named in found.findings) == ["creep", "gain-mismatch"]
    errors = gap_errors(found)
    assert errors.amended["check"] < 0.01 < 0.02 < errors.base["check"]
    # What all texels have in common is the sensor's gain, not theirs: both at once could be anything
    gain = next(one for one in found.intervals if one.name == "gain")
    assert 0.0 < gain.high - gain.low < 0.05 * gain.value
