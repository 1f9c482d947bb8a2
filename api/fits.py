# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits of stiffness, friction and read-outs to measurements."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from . import arguments
from .arguments import ArgumentError

if TYPE_CHECKING:
    from ..core.gap.calibration.friction import FrictionFit
    from ..core.gap.calibration.readout import ReadoutFit
    from ..core.gap.calibration.stiffness import StiffnessFit
    from ..core.gap.dataset.rig import Rig
    from ..core.model.sensor_parameters import SensorParameters

Columns = tuple[ArrayLike, ...]


def fit_stiffness(
    foam: str | os.PathLike[str] | Columns, area: float, texels: int, weight_area: float | None = None
) -> StiffnessFit:
    """Fit the stiffness of a texel to foam that was compressed.

    Parameters
    ----------
    foam : path, or pair of (m,) float
        A CSV file with the columns compression (m) and pressure (Pa), force (N) or mass (kg); or compression (m) and pressure
        (Pa).
    area : float, m²
        Of the whole sensor.
    texels : int
        On it.
    weight_area : float, m², optional
        Area on which forces or masses of the file rested.

    Returns
    -------
    StiffnessFit
        `k` and `k_offset` (N/m, of a line through zero and of one with an offset) with 95 % intervals, `dead_zone` (m).

    Raises
    ------
    PalpateError
        A value is out of range, or the measurements do not determine a stiffness.
    """
    from ..core.gap.calibration.stiffness import FoamData, read_foam
    from ..core.gap.calibration.stiffness import fit_stiffness as fit

    if isinstance(foam, str | os.PathLike):
        data = read_foam(foam, weight_area)
    else:
        data = FoamData(*_columns(foam, "foam", (2,)))
    return fit(data, area, texels)


def fit_friction(
    curve: str | os.PathLike[str] | Columns,
    normal_force: float,
    texels: int = 1,
    parameters: SensorParameters | None = None,
) -> FrictionFit:
    """Fit the friction of a texel to a force–velocity curve, or to a recording over time that begins at rest.

    Parameters
    ----------
    curve : path, or two or three (m,) float
        A CSV file with the columns velocity (m/s), force (N) and, where the velocity changes, time (s); or these arrays.
    normal_force : float, N
        On one texel.
    texels : int
        That shared the measured force.
    parameters : SensorParameters, optional
        Values that are not fitted, as of a sensor's `parameters`.

    Returns
    -------
    FrictionFit
        `estimates` by name, each with a 95 % interval, `parameters`, `residual` (N) and `unidentifiable`.

    Raises
    ------
    PalpateError
        A value is out of range, or the measurements do not determine friction.
    """
    from ..core.gap.calibration.friction import fit_friction as fit
    from ..core.gap.calibration.friction import friction_data, read_friction

    if isinstance(curve, str | os.PathLike):
        data = read_friction(curve, texels)
    else:
        data = friction_data(dict(zip(("velocity", "force", "time"), _columns(curve, "curve", (2, 3)))), texels, "curve")
    return fit(data, normal_force, parameters)


def fit_readout(rig: Rig | str | os.PathLike[str]) -> ReadoutFit:
    """Fit the read-out of a skin: force and place from its readings, with intervals.

    Parameters
    ----------
    rig : Rig or path of a rig.toml
        Recordings with ``use = "check"`` are not fitted, and tell how good the read-outs are.

    Returns
    -------
    ReadoutFit
        `results` of each method (`check`: root mean square error; `coverage` of the 95 % intervals), `best`, `reasons` where
        and why it fails, and ``estimate(time, readings)`` with `value`, `low` and `high`.

    Raises
    ------
    PalpateError
        The rig has no readings, nothing that drove the sensor, or too few samples.
    """
    from ..core.gap.calibration.readout import fit_readout as fit
    from ..core.gap.dataset.rig import read_rig

    return fit(read_rig(Path(rig)) if isinstance(rig, str | os.PathLike) else rig)


def _columns(value: Columns, argument: str, number: tuple[int, ...]) -> list[np.ndarray]:
    """Return arrays of one length."""
    if not isinstance(value, tuple | list) or len(value) not in number:
        raise ArgumentError(f"{argument} is {arguments.brief(value)}: give a file, or {' or '.join(map(str, number))} arrays.")
    found = [arguments.numbers(column, (-1,), argument) for column in value]
    if len({len(column) for column in found}) > 1:
        raise ArgumentError(
            f"{argument} has arrays of {', '.join(str(len(column)) for column in found)} numbers: give them one length."
        )
    return found
