# SPDX-License-Identifier: GPL-3.0-or-later
"""The plain data of a run: what is simulated, and what comes out of it.

A :class:`.scenario.Scenario` describes a run completely: bodies with motions and drives, sensors with parameters and effects,
targets. It can be checked and hashed, and it knows nothing of Blender, of the solver or of the formulas of effects. Every
parameter is specified once, with :mod:`.parameter`; panels, files, checks, reports and presets are made from these
specifications. A :class:`.recording.Recording` holds the results.
"""

__all__ = [
    "body",
    "parameter",
    "recording",
    "scenario",
    "sensor",
    "sensor_parameters",
    "shared_results",
]
