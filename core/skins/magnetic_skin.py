# SPDX-License-Identifier: GPL-3.0-or-later
"""Magnetic skins: magnets in a compliant layer move with its texels, and magnetometers below see the sum of their fields."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import ParameterError, SensorError
from ..geometry.texels import Texels
from ..model.recording import VectorReadings

NEGLIGIBLE = 1e-6
"""Share of the largest weight up to which a texel does not move a point of the layer."""


def pressure_below_point_load(depth: np.ndarray | float, squares: np.ndarray) -> np.ndarray:
    """Return the normal stress in a half-space below a point load of one newton (Boussinesq; Johnson 1985, Eq. 3.19), 1/m².

    Parameters
    ----------
    depth : (...) float, m
        Below the surface.
    squares : (...) float, m²
        Squared distance from the axis of the load.
    """
    found: np.ndarray = 1.5 / np.pi * depth**3 * (depth**2 + squares) ** -2.5
    return found


def texel_displacements(
    texels: Texels, depth: np.ndarray, shear: np.ndarray | None = None, shear_stiffness: float = np.inf
) -> np.ndarray:
    """Return how the surface moves at the texels, in the frame of the sensor's body.

    Parameters
    ----------
    texels : Texels
        n of them.
    depth : (T, n) float, m
        How deep each is pressed in.
    shear : (T, n, 2) float, N, or None
        Force along the texels' x and y axes.
    shear_stiffness : float, N/m
        Of one texel.

    Returns
    -------
    (T, n, 3) float, m
    """
    moved = -np.asarray(depth, float)[..., None] * texels.normal
    if shear is not None:
        moved = moved + (shear[..., :1] * texels.tangent + shear[..., 1:] * texels.bitangent) / shear_stiffness
    return moved


def layer_weights(texels: Texels, place: np.ndarray, thickness: float) -> np.ndarray:
    """Return the share of each texel's displacement with which points of a layer move.

    The layer is bonded to a rigid base. A displacement spreads as the stress below a point load does, and falls in a line to
    zero at the base, so that a layer that is pressed in evenly moves evenly.

    Parameters
    ----------
    texels : Texels
        n of them, on the layer's surface.
    place : (m, 3) float, m
        Points inside the layer, in the frame of the sensor's body.
    thickness : float, m

    Returns
    -------
    (m, n) float
    """
    offset = texels.position[None] - np.asarray(place, float)[:, None]
    below = np.einsum("mnk,nk->mn", offset, texels.normal)
    depth = np.maximum(below, 1e-3 * thickness)
    squares = np.maximum(np.sum(offset**2, axis=2) - below**2, 0.0)
    shares = pressure_below_point_load(depth, squares) * texels.area
    shares = np.where(shares > NEGLIGIBLE * shares.max(axis=1, keepdims=True), shares, 0.0)
    shares /= shares.sum(axis=1, keepdims=True)
    own_depth = np.sum(shares * below, axis=1)
    kept: np.ndarray = np.clip(1.0 - own_depth / thickness, 0.0, 1.0)[:, None] * shares
    return kept


# The magnetic field of point dipoles (Jackson, Classical Electrodynamics, 3rd ed., Eq. 5.56).
#
# A magnet is a dipole where it is seen from farther away than its own size: on the axis of a cylinder as long as its radius,
# the dipole at its centre is off by 12 % at three radii and by 1.6 % at eight.

MU0_4PI = 1e-7
"""T·m/A: the magnetic constant divided by 4 π."""
TOUCHING = 1e-9
"""m: a dipole that is nearer is at the place itself."""


class DipoleSum:
    """The sum of the fields of dipoles that move, by products of matrices, at places that do not.

    The square of a distance has an error of some 1e-15 of the square of the skin's size: of 1 mm in a skin of 100 mm, 1e-11.

    Parameters
    ----------
    at : (k, 3) float, m
        Where the field is wanted.
    moment : (m, 3) float, A·m²
    """

    def __init__(self, at: np.ndarray, moment: np.ndarray):
        self._middle = at.mean(axis=0)
        self._at, self._moment = at - self._middle, MU0_4PI * moment
        self._square = np.sum(self._at**2, axis=1)[:, None]
        self._along = 3.0 * self._at @ self._moment.T

    def field(self, place: np.ndarray, least: float = TOUCHING) -> tuple[np.ndarray, np.ndarray]:
        """Return the field of dipoles at some places.

        Parameters
        ----------
        place : (T, m, 3) float, m
        least : float, m
            A nearer dipole counts as one at this distance.

        Returns
        -------
        field : (T, k, 3) float, T
        square : (T, k, m) float, m²
            Squared distances, not below the square of the least.
        """
        place = place - self._middle
        square = np.matmul(-2.0 * self._at, np.swapaxes(place, 1, 2))  # |a − p|² = |a|² − 2 a · p + |p|²
        square += self._square
        square += np.einsum("tmi,tmi->tm", place, place)[:, None]
        np.maximum(square, least**2, out=square)
        inverse = 1.0 / square
        cube = np.sqrt(inverse)
        cube *= inverse
        weight = self._along - 3.0 * np.einsum("tmi,mi->tm", place, self._moment)[:, None]  # 3 m · (a − p)
        weight *= cube
        weight *= inverse
        field = self._at * weight.sum(axis=2, keepdims=True)
        field -= np.matmul(weight, place)
        field -= np.matmul(cube, self._moment)
        return field, square


BLOCK_NUMBERS = 1 << 14
"""Offsets between magnets and magnetometers that are worked on at once: their arrays stay in a processor's cache."""
FULL_SCALE = 50e-3
"""T: range of usual three-axis Hall chips."""


@dataclass(frozen=True)
class Magnets:
    """Permanent magnets in the layer of a skin, in the frame of the sensor's body.

    Attributes
    ----------
    place : (m, 3) float, m
        At rest.
    moment : (m, 3) float, A·m²
        It keeps its direction: a magnet is carried along and does not turn.
    """

    place: np.ndarray
    moment: np.ndarray


@dataclass(frozen=True)
class Magnetometers:
    """Chips that measure the field along three axes, in the frame of the sensor's body.

    Attributes
    ----------
    place : (k, 3) float, m
    axes : (k, 3, 3) float
        Unit vectors of each chip's x, y and z axis in its rows; they need not be perpendicular.
    full_scale : float or (k,) float, T
        Largest field that an axis shows; what is larger is clipped.
    offset : (k, 3) float, T
        What each axis shows more: the field of the surroundings, and its own zero.
    size : float, m
        Half the height of a chip: magnets cannot be nearer.
    """

    place: np.ndarray
    axes: np.ndarray
    full_scale: float | np.ndarray
    offset: np.ndarray
    size: float = 5e-4

    @property
    def flat(self) -> np.ndarray:
        """(k, 2) float, m: places along the mean x and y axes of all chips, for images of vectors along these."""
        mean = self.axes[:, :2].mean(axis=0)
        found: np.ndarray = self.place @ (mean / np.linalg.norm(mean, axis=1, keepdims=True)).T
        return found


@dataclass(frozen=True)
class MagneticSkin:
    """A compliant layer with magnets, over magnetometers.

    Attributes
    ----------
    magnets : Magnets
    magnetometers : Magnetometers
    weights : (m, n) float
        Share of each texel's displacement with which each magnet moves (:func:`layer_weights`).
    """

    magnets: Magnets
    magnetometers: Magnetometers
    weights: np.ndarray

    @cached_property
    def _fields(self) -> DipoleSum:
        return DipoleSum(self.magnetometers.place, self.magnets.moment)

    def field_at_rest(self) -> np.ndarray:
        """Return the field at the magnetometers while nothing moves, without their offsets, (k, 3) float, T."""
        return self._seen(self.magnets.place[None])[0][0]

    def readings(
        self, displacement: np.ndarray, ambient: np.ndarray | None = None, refuses_near: bool = True
    ) -> VectorReadings:
        """Return the field that the magnetometers measure while the texels move.

        Parameters
        ----------
        displacement : (T, n, 3) float, m
            Of the texels (:func:`texel_displacements`).
        ambient : (T, 3) float, T, or None
            Field of the surroundings, which all magnetometers share.
        refuses_near : bool
            False takes a magnet that moves into a magnetometer's chip as one on its surface, and calls its channels clipped.

        Returns
        -------
        VectorReadings
            (T, k, 3), in tesla.

        Raises
        ------
        ParameterError
            The displacements have another number of texels, or a value that is no number, or a magnet meets a magnetometer.
        """
        displacement = np.asarray(displacement, float)
        texels = self.weights.shape[1]
        if displacement.ndim != 3 or displacement.shape[1:] != (texels, 3):
            raise ParameterError(
                f"The displacements have the shape {displacement.shape} and the skin has {texels} texels: "
                f"give (T, {texels}, 3)."
            )
        if not np.isfinite(displacement).all():
            raise ParameterError("The displacements have values that are not numbers: give metres for each texel and frame.")
        numbers = len(self.magnets.place) * len(self.magnetometers.place)
        step = max(1, BLOCK_NUMBERS // max(numbers, 1))
        starts = range(0, max(len(displacement), 1), step)
        parts = [self._seen(self.places(displacement[i : i + step]), refuses_near) for i in starts]
        values, inside = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
        if ambient is not None:
            values = values + np.einsum("kij,tj->tki", self.magnetometers.axes, ambient)
        values = values + self.magnetometers.offset
        limit = np.reshape(self.magnetometers.full_scale, (-1, 1))
        clipped = (np.abs(values) > limit) | inside[:, :, None]
        values = np.minimum(np.maximum(values, -limit), limit)
        return VectorReadings(values, clipped, place=self.magnetometers.place)

    def places(self, displacement: np.ndarray) -> np.ndarray:
        """Return where the magnets are, (T, m, 3) float, m, from the texels' displacements (T, n, 3)."""
        found: np.ndarray = self.magnets.place + np.matmul(self.weights, displacement)  # each frame by itself: the same bits
        return found

    def _seen(self, place: np.ndarray, refuses_near: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Return fields of magnets at some places (T, m, 3) along the magnetometers' axes, (T, k, 3).

        Also return where one is inside of a chip, (T, k) bool.
        """
        size = self.magnetometers.size
        field, square = self._fields.field(place, TOUCHING if refuses_near else size)
        inside = square.min(axis=2) <= size**2
        if refuses_near and inside.any():
            _, chip, magnet = np.unravel_index(int(np.argmin(square)), square.shape)
            raise ParameterError(
                f"Magnet {magnet} comes within {1e3 * np.sqrt(square.min()):.3g} mm of magnetometer {chip}, inside its chip: "
                "place it higher, or press less deep."
            )
        found: np.ndarray = np.einsum("kij,tkj->tki", self.magnetometers.axes, field)
        return found, inside


def magnetic_skin(texels: Texels, magnets: Magnets, magnetometers: Magnetometers, thickness: float) -> MagneticSkin:
    """Return a skin whose magnets move with the texels on its surface.

    Parameters
    ----------
    texels : Texels
    magnets : Magnets
    magnetometers : Magnetometers
    thickness : float, m
        Of the compliant layer, whose base is rigid.

    Raises
    ------
    SensorError
        Shapes do not agree, a number cannot be, or a magnet is in no layer or in a chip.
    """
    for name, values, shape in (
        ("places of magnets", magnets.place, (len(magnets.place), 3)),
        ("moments of magnets", magnets.moment, (len(magnets.place), 3)),
        ("places of magnetometers", magnetometers.place, (len(magnetometers.place), 3)),
        ("axes of magnetometers", magnetometers.axes, (len(magnetometers.place), 3, 3)),
        ("offsets of magnetometers", magnetometers.offset, (len(magnetometers.place), 3)),
    ):
        if np.shape(values) != shape or not len(values) or not np.isfinite(values).all():
            raise SensorError(f"The {name} have the shape {np.shape(values)}: give finite numbers of the shape {shape}.")
    least = float(np.min(magnetometers.full_scale))
    if not 0.0 < thickness < 1.0 or not least > 0.0:
        raise SensorError(
            f"A layer of {thickness:g} m with magnetometers up to {least:g} T cannot be: give metres and tesla above zero."
        )
    below = np.einsum("mnk,nk->mn", texels.position[None] - magnets.place[:, None], texels.normal)
    nearest = np.argmin(np.sum((texels.position[None] - magnets.place[:, None]) ** 2, axis=2), axis=1)
    depth = below[np.arange(len(below)), nearest]
    (outside,) = np.nonzero((depth < 0.0) | (depth > thickness))
    if len(outside):
        raise SensorError(
            f"Magnet {outside[0]} is {1e3 * depth[outside[0]]:.3g} mm below the texels and the layer is {1e3 * thickness:g} mm "
            "thick: place it inside."
        )
    skin = MagneticSkin(magnets, magnetometers, layer_weights(texels, magnets.place, thickness))
    try:
        skin.field_at_rest()
    except ParameterError as error:
        raise SensorError(str(error)) from error
    return skin
