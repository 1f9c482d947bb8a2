# SPDX-License-Identifier: GPL-3.0-or-later
# Resistive 14 × 6 array of the Weiss type on a finger of the Schunk PG70 gripper; paper, section 5.1.1 (Table 3, Fig. 9):
# k = 1000 N/m and cn = 10 N·s/m per texel carry 0.1 to 10 kg. Friction: Table 2.
import bpy

settings = bpy.context.object.palpate
settings.normal_law = "linear"
settings.k = 1000.0
settings.cn = 10.0
settings.max_penetration = 0.012
settings.sigma0 = 1.0
settings.sigma1 = 0.1
settings.ct = 0.01
settings.mus = 0.435
settings.mud = 0.23
settings.x0 = 0.3
