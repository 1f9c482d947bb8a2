# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters of the base model from two simple measurements (paper, sections 3.3 and 3.4).

`stiffness` fits the stiffness of a texel to the compression of its foam, `friction` fits LuGre friction to a force–velocity
curve, and `plots` draws both fits. They are small cases of :mod:`..fitting`, whose estimates and intervals they use. `readout`
goes the other way, from readings to what drove the sensor.
"""

__all__ = ["friction", "plots", "readout", "stiffness"]
