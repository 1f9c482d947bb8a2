# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact of a sensor, as it was made or fitted, in the terms of other engines."""

from __future__ import annotations

from ..core.simulators import contact_translation
from ..core.simulators.contact_translation import CONTACTS, REFERENCE_MASS, MujocoContact, NewtonContact
from ..core.simulators.sensor_on_mesh import SensorOnMesh
from . import arguments


def mujoco_contact(
    sensor: SensorOnMesh, depth: float | None = None, mass: float = REFERENCE_MASS, contacts: int = CONTACTS
) -> MujocoContact:
    """Return ``solref``, ``solimp`` and ``friction`` of a MuJoCo geom that stands for a sensor, and their error.

    Parameters
    ----------
    sensor : Sensor
        With its stiffness, damping and static friction, and the stiffening that ``palpate gap`` found.
    depth : float, metres, optional
        Up to which forces are compared. Default: half the maximum penetration, which is the thickness of the foam.
    mass : float, kg
        Of the load: MuJoCo's contact is proportional to it.
    contacts : int
        Which share the load: four under a box, one under a ball.

    Returns
    -------
    MujocoContact
        Also `error` and `damping_error` with `rms` and `largest`, as shares of the largest value, and `notes`.

    Raises
    ------
    PalpateError
        An argument has a wrong type or value.
    """
    number = arguments.number(mass, "mass", above_zero=True)
    return contact_translation.mujoco_contact(
        arguments.sensor_on_mesh(sensor), _depth(depth), number, arguments.count(contacts, "contacts")
    )


def newton_contact(sensor: SensorOnMesh, depth: float | None = None) -> NewtonContact:
    """Return the pressure law of a Newton shape that stands for a sensor, and its error.

    ``palpate.plugins.newton.pressure_law`` makes Newton's ``pressure_func`` and ``pressure_data`` of it.

    Parameters
    ----------
    sensor, depth
        As of :func:`mujoco_contact`.

    Returns
    -------
    NewtonContact
        `pressure` (Pa) at multiples of the depth `step` (m), `friction`, `error` and `notes`.

    Raises
    ------
    PalpateError
        An argument has a wrong type or value.
    """
    return contact_translation.newton_contact(arguments.sensor_on_mesh(sensor), _depth(depth))


def _depth(depth: float | None) -> float | None:
    return None if depth is None else arguments.number(depth, "depth", above_zero=True)
