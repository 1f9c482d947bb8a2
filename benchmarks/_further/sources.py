# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the further recordings come from: repository, commit, licence, and what was read of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """A public repository of recordings.

    Attributes
    ----------
    repository : str
        On GitHub, as owner/name. The recordings are looked for in a folder called name.
    commit : str
    licence : str
        As the repository states it. Without one the recordings may be read, and are not passed on.
    measured : str
    """

    repository: str
    commit: str
    licence: str
    measured: str

    @property
    def folder(self) -> str:
        """Name of the folder into which the repository is cloned."""
        return self.repository.split("/")[1]


SOURCES = {
    "polymer": Source(
        "Chongran-Zhao/VHB4910_data",
        "a23efd8c4f8abaa907c4d613db6e74ca6b0321c5",
        "none stated",
        "force of a stretched acrylic strip (VHB 4910) at three rates, and its relaxation",
    ),
    "velostat": Source(
        "Lupasic/tactile-sensor-velostat",
        "c319860a13fcde964917329370ae31314024a96f",
        "none stated",
        "resistance of piezoresistive films under 22 known weights, two of them fitted and a third held out",
    ),
    "barometers": Source(
        "JiannnH/MTL-BaroTactileSensor",
        "065af0e5ab338a5014ca3908f9911f490e84043e",
        "none stated",
        "four barometers under a soft cover, pressed at twenty places, with and without holds",
    ),
    "joint": Source(
        "longshike/NNFM-A-Novel-Neural-Network-Modeling-Approach-for-Robot-Flexible-Joints-Friction",
        "a343d3a3537addd116d6283dae55f687fbf7748f",
        "none stated",
        "friction torque of the last joint of a robot arm at three speeds",
    ),
    "microfluidic": Source(
        "seunghyunhan/deep-characterization-soft-sensor",
        "782e3954e309e054c6823577c2dd77cc3c3983cb",
        "none stated",
        "voltage of a channel of liquid metal in silicone under presses at three places",
    ),
    "hydrogel": Source(
        "Yichen-Cai-yc539/Design-and-Development-of-a-Hydrogel-based-Soft-Sensor-for-Multi-Axis-Force-Control",
        "b1eb5fba51b36003a3b2ea8e58f890e6e46b9318",
        "none stated",
        "sixteen electrodes in a hydrogel on four load cells, under sines and steps of force",
    ),
}
SOURCES |= {"polymer-strip": SOURCES["polymer"], "barometer": SOURCES["barometers"]}
"""By the name of the set."""
