# SPDX-License-Identifier: GPL-3.0-or-later
"""Vector images: what the library reads back, and layouts that do not fit."""

import numpy as np
import pytest
from sample_bake import read_image

from palpate.core.errors import ParameterError
from palpate.core.io.tactile_exr import write_vector_exrs

VALUES = np.random.default_rng(0).normal(size=(3, 6, 3))


def test_each_frame_is_an_image_with_one_layer(tmp_path):
    paths = write_vector_exrs(tmp_path / "new", VALUES, (2, 3), "T")
    assert [path.name for path in paths] == ["field_0000.exr", "field_0001.exr", "field_0002.exr"]
    for frame, path in enumerate(paths):
        channels, attributes = read_image(path)
        assert set(channels) == {"field.X", "field.Y", "field.Z"}
        assert attributes["palpate.unit"] == "T" and attributes["palpate.frame"] == str(frame)
        for axis, name in enumerate(("field.X", "field.Y", "field.Z")):
            np.testing.assert_array_equal(channels[name][::-1].ravel(), VALUES[frame, :, axis].astype(np.float32))


def test_a_shorter_recording_leaves_no_image_of_the_longer_one(tmp_path):
    write_vector_exrs(tmp_path, VALUES, (2, 3), "T")
    (tmp_path / "field_0009.exr").write_bytes(b"of the user")
    write_vector_exrs(tmp_path, VALUES[:1], (2, 3), "T")
    assert sorted(path.name for path in tmp_path.glob("*.exr")) == ["field_0000.exr", "field_0009.exr"]


def test_a_layout_of_4_x_4_for_15_channels_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="4 × 4 places has 48 channels and these readings have 15: give the rows"):
        write_vector_exrs(tmp_path, VALUES[:, :5], (4, 4), "T")
    assert not list(tmp_path.iterdir())
