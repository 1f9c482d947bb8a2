# SPDX-License-Identifier: GPL-3.0-or-later
"""The contact of a sensor in the terms of MuJoCo and of Newton, with the error that the translation leaves.

What is translated is the force of all texels together at one depth, at rest: the normal law with the effects that act on the
contact and have no memory. MuJoCo's contact (its documentation, "Computation", section "Contact") at the depth r has the
impedance d(r), a sigmoid, and at rest the force ``contacts · mass · stiffness · r · d(r)² / (d₁² (1 - d(r)))``, where d₁ is the
impedance at the largest depth. Newton's hydroelastic contact takes the pressure as a function of the depth, here a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..effects.engine.contact_forces import normal_forces
from ..effects.engine.registry import form_of, kind_of
from ..errors import ParameterError
from ..model.sensor import Effect
from ..model.sensor_parameters import DEPTH_PER_THICKNESS
from .sensor_on_mesh import SensorOnMesh

REFERENCE_MASS = 1.0
"""kg. MuJoCo's contact stiffness is an acceleration per depth: a body sinks in by g times a constant, whatever its mass. The
constant is ours for a body of this mass."""
CONTACTS = 4
"""Contacts of a box that stands on the sensor; they share MuJoCo's stiffness, so the depth is (1 - d) g / (4 stiffness). A
test compares both depths. This holds with elliptic cones; pyramids make contacts stiffer."""
LEAST_DAMPING = 1e-9
"""N·s/m. MuJoCo knows the format of `solref` by both numbers being below zero."""


SAMPLES = 400
"""Depths at which forces are compared."""
INTERVALS = 64
"""Of Newton's table: the error of an interpolated quadratic is below 0.01 % of its largest value."""
LARGEST_IMPEDANCE = 0.01
"""Impedance d₁ at the largest depth. A contact is a spring only as far as d is small: at 0.9, MuJoCo's own, a box on four
contacts oscillates with a sixth of its frequency; at 0.01 a test finds 98 % of it."""
IMPEDANCES = (1e-4, 0.9)
"""Bounds of the impedance at depth zero; MuJoCo's own are 0.0001 and 0.9999."""
POWERS = (1.0, 10.0)
MIDPOINTS = (0.02, 0.98)
STARTS = ((1.0, 0.5, 1.0), (0.5, 0.5, 1.0), (0.5, 0.5, 2.0), (0.1, 0.7, 1.5), (2.0, 0.5, 1.0))
"""From which the fit begins: impedance at depth zero in d₁, midpoint, power."""


@dataclass(frozen=True)
class TranslationError:
    """Difference between the forces of an engine and of Palpate over the range of depth.

    Attributes
    ----------
    rms, largest : float, 1
        Root mean square and largest magnitude, as shares of the largest force.
    """

    rms: float
    largest: float

    @classmethod
    def of(cls, found: np.ndarray, expected: np.ndarray) -> TranslationError:
        """Return the error of forces that are compared with Palpate's."""
        difference, scale = found - expected, max(float(np.abs(expected).max()), np.finfo(float).tiny)
        return cls(float(np.sqrt(np.mean(difference**2)) / scale), float(np.abs(difference).max() / scale))

    def __str__(self) -> str:
        return f"RMS {100.0 * self.rms:.2g} %, largest {100.0 * self.largest:.2g} % of the largest force"


@dataclass(frozen=True)
class ForceCurve:
    """Force of all texels of a sensor together, all at the same depth.

    Attributes
    ----------
    depth : (m,) float, metres
        From zero to the largest.
    force : (m,) float, N
        At rest.
    damping : (m,) float, N·s/m
    area : float, m²
    left_out : tuple of str
        Effects that are not part of it, because they have a memory or act on readings, friction or places.
    """

    depth: np.ndarray
    force: np.ndarray
    damping: np.ndarray
    area: float
    left_out: tuple[str, ...]


@dataclass(frozen=True)
class MujocoContact:
    """A geom's contact in MuJoCo, and its error.

    Attributes
    ----------
    solref : (float, float)
        Stiffness (1/s²) and damping (1/s), both negative as MuJoCo wants it for such.
    solimp : (float, float, float, float, float)
    friction : (float, float, float)
        Sliding, torsional and rolling; only the first is the sensor's.
    mass : float, kg
        Of the load, by which MuJoCo multiplies them.
    contacts : int
        Which share the load.
    error : TranslationError
        Of the force at rest.
    damping_error : TranslationError
        Of the damping coefficient, as share of the largest one.
    notes : tuple of str
        What MuJoCo cannot express, one sentence each.
    """

    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    friction: tuple[float, ...]
    mass: float
    contacts: int
    error: TranslationError
    damping_error: TranslationError
    notes: tuple[str, ...]

    def force(self, depth: np.ndarray) -> np.ndarray:
        """Return MuJoCo's force of all contacts at depths (m,), metres, at rest, N."""
        return -self.solref[0] * self.contacts * self.mass * _spring(depth, self.solimp)

    def damping(self, depth: np.ndarray) -> np.ndarray:
        """Return MuJoCo's damping coefficient of all contacts at depths (m,), metres, N·s/m."""
        return -self.solref[1] * self.contacts * self.mass * _damper(depth, self.solimp)


@dataclass(frozen=True)
class NewtonContact:
    """The pressure law of a shape in Newton, and its error.

    Attributes
    ----------
    step : float, metres
        Depth from one pressure to the next.
    pressure : (m,) float, Pa
        At depths from zero; linear in between, and beyond the last.
    friction : float
        Coefficient of the shape.
    error : TranslationError
    notes : tuple of str
        What Newton cannot express, one sentence each.
    """

    step: float
    pressure: np.ndarray
    friction: float
    error: TranslationError
    notes: tuple[str, ...]


def force_curve(item: SensorOnMesh, depth: float | None = None) -> ForceCurve:
    """Return the force of a sensor that is pressed everywhere to the same depth.

    Parameters
    ----------
    item : SensorOnMesh
    depth : float, metres, optional
        The largest. Default: the thickness of the foam, which is half the maximum penetration.

    Raises
    ------
    ParameterError
        The depth is not above zero, or larger than the maximum penetration.
    """
    sensor = item.sensor
    limit = sensor.parameters.max_penetration
    largest = limit / DEPTH_PER_THICKNESS if depth is None else float(depth)
    if not 0.0 < largest <= limit:
        raise ParameterError(
            f"The depth of sensor '{item.name}' is {largest:g} m: give one above zero, "
            f"up to its maximum penetration, {limit:g} m."
        )
    depths = np.linspace(0.0, largest, SAMPLES)

    def is_function_of_depth(effect: Effect) -> bool:
        form = form_of(effect.name, effect.form)
        return kind_of(effect.name).site_of(form) == "contact" and form.law is not None and not form.state_size

    kept = tuple(effect for effect in sensor.effects if is_function_of_depth(effect))
    left_out = tuple(effect.name for effect in sensor.effects if not is_function_of_depth(effect))
    time, at_depth = np.arange(SAMPLES, dtype=float), depths[:, None]
    still = normal_forces(kept, sensor.parameters, time, at_depth, rate=np.zeros_like(at_depth))[:, 0]
    moved = normal_forces(kept, sensor.parameters, time, at_depth, rate=np.ones_like(at_depth))[:, 0]  # affine in the rate
    texels = float(np.sum(sensor.painted.k)) if sensor.painted.k is not None else float(len(sensor.texels))
    damping = moved - still
    damping[0] = damping[1]  # at depth zero nothing is in contact
    return ForceCurve(depths, texels * still, texels * damping, float(np.sum(sensor.texels.area)), left_out)


def mujoco_contact(
    item: SensorOnMesh,
    depth: float | None = None,
    mass: float = REFERENCE_MASS,
    contacts: int = CONTACTS,
    impedance: float | None = None,
) -> MujocoContact:
    """Return ``solref``, ``solimp`` and ``friction`` of a geom whose contact is nearest to that of a sensor.

    Parameters
    ----------
    item : SensorOnMesh
    depth : float, metres, optional
        Up to which forces are compared. Default: half the maximum penetration.
    mass : float, kg
        Of the load. MuJoCo's contact is proportional to it.
    contacts : int
        Which the load has with the geom: four for a box on its face, one for a ball.
    impedance : float, optional
        The same at all depths, so that the contact is a linear spring. Default: the sigmoid that is nearest, up to
        LARGEST_IMPEDANCE.

    Raises
    ------
    ParameterError
        A value is out of range.
    """
    if not (0.0 < mass < np.inf and contacts >= 1):
        raise ParameterError(f"The load has {mass:g} kg and {contacts} contacts: give more than 0 kg and one contact at least.")
    curve = force_curve(item, depth)
    constant = None if impedance is None else (impedance, impedance, float(curve.depth[-1]), 0.5, 2.0)
    solimp, load = constant or _fitted_impedance(curve), mass * contacts
    spring, damper = load * _spring(curve.depth, solimp), load * _damper(curve.depth, solimp)
    stiffness, damping = _best_factor(spring, curve.force), _best_factor(damper, curve.damping)
    mus = float(item.sensor.parameters.mus)
    return MujocoContact(
        (-stiffness, -max(damping, LEAST_DAMPING)),
        solimp,
        (mus, 0.005, 0.0001),
        mass,
        contacts,
        TranslationError.of(stiffness * spring, curve.force),
        TranslationError.of(damping * damper, curve.damping),
        (
            f"MuJoCo multiplies solref by the mass: these are for a load of {mass:g} kg on {contacts} contacts.",
            f"MuJoCo has one friction coefficient, mus = {mus:g}; under a shear it creeps, less with a larger impratio.",
            *_left_out(curve),
        ),
    )


def newton_contact(item: SensorOnMesh, depth: float | None = None) -> NewtonContact:
    """Return the pressure law of a shape whose hydroelastic contact is that of a sensor.

    Parameters
    ----------
    item : SensorOnMesh
    depth : float, metres, optional
        Up to which forces are compared. Default: half the maximum penetration.

    Raises
    ------
    ParameterError
        The depth is out of range.
    """
    curve = force_curve(item, depth)
    places = np.linspace(0.0, curve.depth[-1], INTERVALS + 1)
    pressure = (np.interp(places, curve.depth, curve.force) / curve.area).astype(np.float32)
    table = np.interp(curve.depth, places, pressure.astype(float)) * curve.area
    notes = (
        "Newton's table has no damping: set kd of the shape.",
        f"Newton has one friction coefficient, mus = {item.sensor.parameters.mus:g}.",
    )
    error = TranslationError.of(table, curve.force)
    return NewtonContact(float(places[1]), pressure, float(item.sensor.parameters.mus), error, (*notes, *_left_out(curve)))


def _left_out(curve: ForceCurve) -> tuple[str, ...]:
    if not curve.left_out:
        return ()
    return (f"Effects with a memory, on readings, friction or places are left out: {', '.join(curve.left_out)}.",)


def _best_factor(shape: np.ndarray, wanted: np.ndarray) -> float:
    """Return by what a shape has to be multiplied to come nearest to some values."""
    return float(shape @ wanted / (shape @ shape))


def _impedance(depth: np.ndarray, solimp: Sequence[float]) -> np.ndarray:
    """Return MuJoCo's impedance at depths: a sigmoid of two powers that meet at the midpoint."""
    first, last, width, middle, power = solimp
    x = np.minimum(depth / width, 1.0)
    rising = x**power / middle ** (power - 1.0)
    falling = 1.0 - (1.0 - x) ** power / (1.0 - middle) ** (power - 1.0)
    return first + (last - first) * np.where(x <= middle, rising, falling)


def _spring(depth: np.ndarray, solimp: Sequence[float]) -> np.ndarray:
    """Return MuJoCo's force at rest for a stiffness of one and a mass of one."""
    impedance = _impedance(depth, solimp)
    return depth * impedance**2 / (solimp[1] ** 2 * (1.0 - impedance))


def _damper(depth: np.ndarray, solimp: Sequence[float]) -> np.ndarray:
    """Return MuJoCo's damping coefficient for a damping of one and a mass of one."""
    impedance = _impedance(depth, solimp)
    return impedance / (solimp[1] * (1.0 - impedance))


def _fitted_impedance(curve: ForceCurve) -> tuple[float, ...]:
    """Return the ``solimp`` whose force has the shape of a curve, whatever its size."""
    from scipy.optimize import least_squares

    last, width, scale = LARGEST_IMPEDANCE, float(curve.depth[-1]), curve.force.max()

    def solimp(values: np.ndarray) -> tuple[float, ...]:
        return (float(np.exp(values[0])), last, width, float(values[1]), float(np.exp(values[2])))

    def error(values: np.ndarray) -> np.ndarray:
        shape = _spring(curve.depth, solimp(values))
        return (_best_factor(shape, curve.force) * shape - curve.force) / scale

    low, high = (np.array([np.log(IMPEDANCES[i]), MIDPOINTS[i], np.log(POWERS[i])]) for i in (0, 1))
    starts = [np.clip([np.log(first * last), middle, np.log(power)], low, high) for first, middle, power in STARTS]
    found = [least_squares(error, start, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12) for start in starts]
    return tuple(float(f"{value:.9g}") for value in solimp(min(found, key=lambda one: one.cost).x))
