# SPDX-License-Identifier: GPL-3.0-or-later
"""Compile every kernel that the tests run: the solver, the laws of all effects, and the step of a sensor in another loop.

python tools/compile_kernels.py

One process does it before pytest starts several, each of which would compile them otherwise. Numba keeps the machine code, so
that a second call does nothing.
"""

import palpate as pp
from palpate.core.solver import precompile


def main() -> None:
    """Compile what is not compiled."""
    if not precompile.is_needed():
        return
    precompile.compile_solver_with_notice()
    precompile.compile_effect_laws()
    pad = pp.Sensor.grid(2, 2, pitch=1e-3)
    pressed = pp.PressedSensor(pad, pp.Body.box(0.01), dt=0.01)
    pressed.step(([0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]), ([0.0, 0.0, 0.0049], [1.0, 0.0, 0.0, 0.0]))


if __name__ == "__main__":
    main()
