# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/sample-rig is what its script writes, small, and read without complaint."""

import numpy as np
import sample_rig

from palpate.core.gap.rig import read_rig


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
