# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor is made from, in a real window; see test_roads.py."""


def test_shaping(play_road):
    """Edit Mode, material, face set, copying; rows and columns of vertices are 2 mm apart, the regions begin between two."""
    values = play_road("shaping", timeout=900)["values"]
    assert values == {"selected": 21 * 11, "material": 21 * 9, "face set": 9 * 21}
