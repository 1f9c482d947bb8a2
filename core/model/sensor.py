# SPDX-License-Identifier: GPL-3.0-or-later
"""A tactile sensor on a body."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from ..geometry.texels import Texels
from .deformation import Deformation
from .digest import digest_of
from .effect import Effect
from .sensor_parameters import Painted, SensorParameters


@dataclass(frozen=True)
class Sensor:
    """Texels on a body, which differ by what is painted. With `readout` False it is a pad: it acts, and reports nothing.

    Its `effects` are what the base model leaves out (:mod:`.effects`); each has its place, so their order matters only between
    two of a kind.
    """

    name: str
    body: int
    texels: Texels
    parameters: SensorParameters = field(default_factory=SensorParameters)
    readout: bool = True
    painted: Painted = field(default_factory=Painted)
    deformation: Deformation | None = None
    effects: tuple[Effect, ...] = ()

    @cached_property
    def settings_digest(self) -> str:
        """Hash of the parameters, of what is painted and of the effects."""
        return digest_of((self.parameters, self.painted, self.effects))
