# SPDX-License-Identifier: GPL-3.0-or-later
# Low density conductive foam RS-55-066, 6 mm thick, on a 14 × 6 pad of 1250 mm²: the paper's Table 2, per texel.
# k: Eq. 18 from the compression of Fig. 6; friction: fitted to a force–velocity curve, Fig. 7.
import bpy

settings = bpy.context.object.palpate
settings.normal_law = "linear"
settings.k = 58.5
settings.cn = 0.0583
settings.max_penetration = 0.012
settings.sigma0 = 1.0
settings.sigma1 = 0.1
settings.ct = 0.01
settings.mus = 0.435
settings.mud = 0.23
settings.x0 = 0.3
