# SPDX-License-Identifier: GPL-3.0-or-later
# A 2 mm skin of PDMS Sylgard 184 cured at 25 °C, texels 2 mm apart. E = 1.32 MPa (Johnston, McCluskey, Tan and Tracey 2014,
# J. Micromech. Microeng. 24 035017: 1.32 to 2.97 MPa for curing at 25 to 200 °C);
# k = E · A / h = 1.32 MPa · 4 mm² / 2 mm = 2640 N/m per texel, cn numerically 1 % of k.
# Bristles as stiff as the layer. No friction is given there: measure yours, it stays as it is.
# max_penetration is the thickness: the skin cannot be pressed deeper than down to what carries it.
# E is that of a bar that can expand sideways. A thin skin that is bonded to its carrier cannot, and is stiffer.
import bpy

settings = bpy.context.object.palpate
settings.normal_law = "linear"
settings.k = 2640.0
settings.cn = 26.4
settings.max_penetration = 0.002
settings.sigma0 = 2640.0
settings.sigma1 = 26.4
