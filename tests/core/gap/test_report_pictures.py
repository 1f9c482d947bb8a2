# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pictures of a report show."""

from types import SimpleNamespace

import numpy as np
import pytest

from palpate.core.gap.report.plots import _worst_channel


@pytest.mark.parametrize(("stimulus", "name"), [
    (None, "texel 0"),
    (np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 2.0]]), "texel 2"),  # the first one is never loaded: no loop is seen
    (np.zeros((2, 3)), "texel 0"),
])  # fmt: skip
def test_a_loop_is_that_of_a_texel_whose_stimulus_changes(stimulus, name):
    reading = np.array([[9.0, 1.0, 2.0], [9.0, 1.0, 2.0]])
    predictor = SimpleNamespace(
        trial=SimpleNamespace(reading=reading), predict=lambda _: SimpleNamespace(reading=np.zeros_like(reading))
    )
    result = SimpleNamespace(base=SimpleNamespace(model=None))
    said, measured, _ = _worst_channel(result, predictor, stimulus)
    assert said == name and (measured == reading[:, int(name[-1])]).all()
