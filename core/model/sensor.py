# SPDX-License-Identifier: GPL-3.0-or-later
"""A tactile sensor on a body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..errors import SceneError
from ..geometry.texels import Texels
from .recording import IF_GIVEN, ChannelReadout, digest_of, row_blocks
from .sensor_parameters import Painted, SensorParameters

Value = float | tuple[float, ...]
"""The value of a parameter: one number, or one number per texel."""
Values = Mapping[str, Value]
"""Values by parameter name."""


@dataclass(frozen=True)
class Effect:
    """An effect of a sensor: plain data that a file can hold.

    Attributes
    ----------
    name, form : str
        Names of an effect of the library and of one of its formulas.
    values : dict of str to float or tuple of float
        By parameter name. A tuple has one number per texel. A parameter without a value has the default of the form.
    seed : int
        Seed of the random numbers of an effect; equal seeds give equal numbers.
    """

    name: str
    form: str
    values: dict[str, Value] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True)
class Deformation:
    """The shape of a surface over time, in the frame of its body.

    The shape is interpolated linearly between samples, and constant before the first and after the last.

    Attributes
    ----------
    times : (m,) float, seconds, increasing
    values : (m, n, c) float
        For a target the position of each vertex of its mesh, metres; for a sensor the position (m), normal and tangent of each
        texel.
    """

    times: np.ndarray
    values: np.ndarray

    def extended(self, time: float, values: np.ndarray) -> Deformation:
        """Return the deformation from the last sample to a new one.

        Earlier samples are left out, because the timeline only goes forward.
        """
        return Deformation(np.append(self.times[-1:], time), np.concatenate([self.values[-1:], values[None]]))

    def check(self, name: str, shape: tuple[int, ...]) -> None:
        """Raise :class:`SceneError` when the samples do not fit a surface of `shape` or are not finite."""
        if self.values.shape != (len(self.times), *shape):
            raise SceneError(
                f"'{name}' deforms with {self.values.shape[1]} vertices and has {shape[0]}: "
                "use modifiers that keep the number of vertices."
            )
        if not all(np.isfinite(self.values[rows]).all() for rows in row_blocks(self.values)):
            time = self.times[np.flatnonzero(~np.isfinite(self.values).all(axis=(1, 2)))[0]]
            raise SceneError(
                f"A vertex of '{name}' is NaN or infinite {time:g} s after the first frame: check what deforms it."
            )


@dataclass(frozen=True)
class Sensor:
    """Texels on a body. All have the same parameters, apart from the painted factors.

    Attributes
    ----------
    name : str
    body : int
        Index in :attr:`.Scenario.bodies`.
    texels : Texels
        In the frame of the body. :func:`.registry.mounted_texels` returns where the effects put them.
    parameters : SensorParameters
    readout : bool
        False for a pad, which exerts contact forces and reports nothing.
    painted : Painted
    deformation : Deformation or None
        How the texels move in the frame of the body.
    effects : tuple of Effect
        What real sensors do and the base model leaves out. Each kind has its place in the chain, so the order matters only
        between two effects of the same kind.
    channels : ChannelReadout or None
        What computes further, signed channels from forces and displacements of the texels.
    """

    name: str
    body: int
    texels: Texels
    parameters: SensorParameters = field(default_factory=SensorParameters)
    readout: bool = True
    painted: Painted = field(default_factory=Painted)
    deformation: Deformation | None = None
    effects: tuple[Effect, ...] = ()
    channels: ChannelReadout | None = field(default=None, metadata={IF_GIVEN: True})

    @cached_property
    def settings_digest(self) -> str:
        """Hash of the parameters, the painted factors and the effects."""
        return digest_of((self.parameters, self.painted, self.effects))
