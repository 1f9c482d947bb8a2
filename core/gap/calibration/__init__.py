# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of a sensor from measurements: stiffness of its foam, friction of its surface (paper, sections 3.3 and 3.4)."""
