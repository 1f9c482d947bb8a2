# SPDX-License-Identifier: GPL-3.0-or-later
"""What a sensor is made from, in a real window; see test_roads.py."""


def test_shaping(play_road):
    """Regions by selection, material and face set; copying; a painted soft spot that is felt; files in and out.

    Rows and columns of vertices are 2 mm apart, and each region begins between two.
    """
    values = play_road("shaping", timeout=1800)["values"]
    assert values["selected"] == 21 * 11
    assert values["material"] == values["face set"] == 21 * 9
    assert 0.5 * values["before"] < values["after"] < 0.9 * values["before"]  # half as stiff in some of the texels
