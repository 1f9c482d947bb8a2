# SPDX-License-Identifier: GPL-3.0-or-later
# A 6 mm layer of silicone Ecoflex 00-30, texels 2 mm apart. Modulus at 100 % strain 10 psi = 69 kPa (Smooth-On, technical
# bulletin of the Ecoflex series, ASTM D-412: tension of a bar, so a layer that cannot expand sideways is stiffer);
# as an elastic foundation k = E · A / h = 69 kPa · 4 mm² / 6 mm = 46 N/m per texel, cn numerically 1 % of k.
# Bristles as stiff as the layer. No friction is given there: measure yours, it stays as it is.
import bpy

settings = bpy.context.object.palpate
settings.normal_law = "linear"
settings.k = 46.0
settings.cn = 0.46
settings.max_penetration = 0.006
settings.sigma0 = 46.0
settings.sigma1 = 0.46
