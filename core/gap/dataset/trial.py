# SPDX-License-Identifier: GPL-3.0-or-later
"""One recording of a rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Trial:
    """One recording.

    Attributes
    ----------
    name : str
        Of its file, without the suffix.
    use : "fit" or "check"
    time : (T,) float, seconds, increasing
        Since the first sample of its session, or of the rig's first recording.
    stimulus : "pose", "depth" or "force"
    position, quaternion : (T, 3), (T, 4) float, or None
        Of the indenter in the sensor's frame. With a known force they say where it acts; z has no meaning then.
    level : (T,) float or None
        Depth of all texels (m), or force that all texels share (N).
    slide : (T, 2) float, metres
        Travel of the surface along the sensor's x and y; zero if none was recorded.
    reading : (T, n) float or None, the sensor's unit
        NaN if a value is missing.
    force : (T, 3) float or None, newtons
        Net force on the sensor; NaN if a component is missing.
    session : str
        Name of the session in which the sensor's state goes on from recording to recording; empty if it belongs to none.
    tared : bool
        True if the responses of its first sample were subtracted from all its responses.
    factor, zero : str or float
        Numbers of this recording by which its readings differ from those of the sensor: they are multiplied (about the sensor's
        zero) and shifted. Of recordings without readings it is the net force that is multiplied. Free numbers have a name.
    force_zero : str or (3,) float, newtons
        What the force sensor shows without load; a name if it is free.
    contact_height : str or float, metres
        How much higher the sensor's surface is than poses or depths say: contact begins earlier by as much. A name if it is
        free. Without meaning in a recording with a known force.
    probe : str
        Name of the probe that pressed; empty for the rig's indenter.
    repeats : str
        Name of a group of recordings of the same stimulus; empty if it belongs to none.
    temperature : pair of (m,) float, or None
        Times (s, on the clock of `time`) and temperatures of the sensor (°C); None if none were recorded.
    height_start : float, metres
        Where the fit of a free contact height starts; contacts are described with this height.
    """

    name: str
    use: str
    time: np.ndarray
    stimulus: str
    position: np.ndarray | None
    quaternion: np.ndarray | None
    level: np.ndarray | None
    slide: np.ndarray
    reading: np.ndarray | None
    force: np.ndarray | None
    session: str = ""
    tared: bool = False
    factor: str | float = 1.0
    zero: str | float = 0.0
    force_zero: str | tuple[float, ...] = (0.0, 0.0, 0.0)
    contact_height: str | float = 0.0
    height_start: float = 0.0
    probe: str = ""
    repeats: str = ""
    temperature: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def step(self) -> float:
        """Median time between samples, seconds."""
        return float(np.median(np.diff(self.time)))

    @property
    def responses(self) -> list[np.ndarray]:
        """Readings and net forces, those of both that were recorded."""
        return [part for part in (self.reading, self.force) if part is not None]

    @property
    def changes(self) -> bool:
        """True if any channel of the responses has two different values."""
        return any((np.fmax.reduce(part, axis=0) > np.fmin.reduce(part, axis=0)).any() for part in self.responses)


def runs(flag: np.ndarray) -> list[tuple[int, int]]:
    """Return the first sample of each run in which a flag (T,) is set, and the sample after its end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(int))).reshape(-1, 2)
    return [(int(a), int(b)) for a, b in edges]
