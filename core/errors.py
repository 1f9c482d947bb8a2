# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors a user can cause, and the warnings that do not stop the work.

Every message is one sentence that says what is wrong, where, and what to do about it. Drivers (operators, command line) show
``str(error)`` and nothing else; anything that is not a :class:`PalpateError` is our fault and shows its traceback.
"""


class PalpateError(Exception):
    """Base of all errors that the user can put right."""


class MeshError(PalpateError):
    """A mesh that no forces can be computed on (NaN vertices, no faces, no area)."""


class SensorError(PalpateError):
    """A sensor that cannot be built from its region or its parameters."""


class RegionError(SensorError):
    """A region that is gone, is empty or spans no face."""


class ImageError(SensorError):
    """A UV map that cannot lay out a tactile image."""


class PaintedError(SensorError):
    """A painted multiplier that is gone or holds what cannot be a factor."""


class ParameterError(PalpateError):
    """A number outside the range in which the model means anything."""


class EffectError(ParameterError):
    """An effect that the library does not have, or a parameter of one that means nothing."""


class SceneError(PalpateError):
    """A scene that does not add up to a simulation (nothing to touch, reversed frame range, zero scale)."""


class FileError(PalpateError):
    """A file or folder that cannot be read, written or understood."""


class Cancelled(PalpateError):
    """The user stopped the work; what was finished is kept."""
