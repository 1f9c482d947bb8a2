# SPDX-License-Identifier: GPL-3.0-or-later
"""What the solver is held against: closed forms, stiff ODE solvers, a ray library, conservation laws.

Each function measures one thing and returns how far the solver is from it. The tests assert bars.
"""
