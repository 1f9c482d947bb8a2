# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's section 5.1.2: the cube of :mod:`.weighing` on a pad that is tilted by 10 degrees, held by friction (Fig. 9)."""

from __future__ import annotations

from . import scene_builder, weighing

TILT = 10.0  # degrees
MASS = 1.0  # kg

TEXT = """\
Held on a slope (paper, section 5.1.2, Fig. 8b and 9)

1 kg of steel on a pad that is tilted by 10 degrees. Friction has to hold 1.7035 N along the slope. The cube moves by a
fraction of a millimetre while the bristles bend, and from then on does not move: 'palpate paper' runs 20 minutes of this.

The bristles are as stiff as the foam (1000 N/m); with the 1 N/m of the paper's Table 2 the cube travels 20 mm first.
"""


def build(scene) -> None:
    """Fill `scene`, which is emptied first; the add-on's classes must be registered."""
    weighing.weigh(scene, MASS, TILT)
    scene.palpate.dt = 1e-3
    scene_builder.add_readme(TEXT)
