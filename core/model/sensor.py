# SPDX-License-Identifier: GPL-3.0-or-later
"""A tactile sensor on a body."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from ..geometry.texels import Texels
from .deformation import Deformation
from .digest import IF_GIVEN, digest_of
from .effect import Effect
from .recording import ChannelReadout
from .sensor_parameters import Painted, SensorParameters


@dataclass(frozen=True)
class Sensor:
    """Texels on a body. All have the same parameters, apart from the painted factors.

    Attributes
    ----------
    name : str
    body : int
        Index in :attr:`.Scenario.bodies`.
    texels : Texels
        In the frame of the body. :func:`.sensor_effects.mounted_texels` returns where the effects put them.
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
