# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies on an elastic foundation: force and contact area against closed forms, and how fast finer texels get there."""

import pytest
from oracles.foundation import ORDERS, PRESSINGS, convergence


@pytest.mark.slow("an order of convergence takes several sizes of texels")
@pytest.mark.parametrize("name", PRESSINGS)
def test_finer_texels_converge_to_the_closed_form_at_the_order_of_the_contacts_edge(name):
    """Orders are fitted over 8, 16, 32 and 64 texels a side; 0.15 is what 64 random places leave of scatter.

    The finest error is bounded as well, so that it is the right number that is approached: at 64 texels a side the
    straight or curved edge leaves 5e-5 (sphere) to 3e-3 (flat cylinder, whose edge jumps) of the force.
    """
    errors, (force, area) = convergence(name), ORDERS[name]
    assert errors.order(errors.normal) == pytest.approx(force, abs=0.15)
    assert errors.order(errors.upward) == pytest.approx(force, abs=0.15)
    assert errors.order(errors.area) == pytest.approx(area, abs=0.15)
    assert errors.normal[-1] < (5e-3 if name == "flat cylinder" else 2e-4)
    assert errors.upward[-1] < (5e-3 if name == "flat cylinder" else 2e-4)
    assert errors.area[-1] < 0.015
