# SPDX-License-Identifier: GPL-3.0-or-later
"""The machinery of effects: specification, registry, and the application to contact forces and readings.

`specification` says what an effect is, `registry` finds effects and checks those of a sensor and of a
scenario. `contact_forces` computes forces along a known motion and `readout_chain` computes readings from forces;
`compiled_program` does in kernels what the solver needs in each step. The library also uses `coupling_matrix`
and `random_streams`.
"""

__all__ = [
    "compiled_program",
    "contact_forces",
    "coupling_matrix",
    "random_streams",
    "readout_chain",
    "registry",
    "specification",
]
