# SPDX-License-Identifier: GPL-3.0-or-later
# A 4 mm layer of silicone Dragon Skin 30, texels 2 mm apart. Modulus at 100 % strain 86 psi = 593 kPa (Smooth-On, technical
# bulletin of the Dragon Skin series, ASTM D-412: tension of a bar, so a layer that cannot expand sideways is stiffer);
# k = E · A / h = 593 kPa · 4 mm² / 4 mm = 593 N/m per texel, cn numerically 1 % of k.
# Bristles as stiff as the layer. No friction is given there: measure yours, it stays as it is.
import bpy

settings = bpy.context.object.palpate
settings.normal_law = "linear"
settings.k = 593.0
settings.cn = 5.93
settings.max_penetration = 0.004
settings.sigma0 = 593.0
settings.sigma1 = 5.93
