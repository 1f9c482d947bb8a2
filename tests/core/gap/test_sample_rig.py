# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/sample-rig is small, is read without complaint, and what is hidden in it is named."""

import pytest
from gap_cases import diagnosed

from palpate.core.gap.dataset.rig import read_rig
from palpate.core.gap.report.comparison import gap_errors


def test_the_sample_rig_is_read_and_small(repository):
    folder = repository / "docs" / "sample-rig"
    rig = read_rig(folder / "rig.toml")
    assert not rig.warnings and len(rig.texels) == 84
    assert sum(path.stat().st_size for path in folder.iterdir()) < 500_000


@pytest.mark.long("a whole diagnosis of the sample rig")
def test_what_is_hidden_in_the_sample_rig_is_named_and_nothing_else(repository):
    """What the library's creep and gain lack beside the generator's is no noise that grows with the reading."""
    found = diagnosed(read_rig(repository / "docs" / "sample-rig" / "rig.toml"))
    assert sorted(named.name for named in found.findings) == ["creep", "gain-mismatch"]
    errors = gap_errors(found)
    assert errors.amended["check"] < 0.01 < 0.02 < errors.base["check"]
    # What all texels have in common is the sensor's gain, not theirs: both at once could be anything
    gain = next(one for one in found.intervals if one.name == "gain")
    assert 0.0 < gain.high - gain.low < 0.05 * gain.value
