# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear read-outs, and what they compute."""

import numpy as np
import pytest
from scipy import sparse

from palpate.core.errors import ParameterError
from palpate.core.skins.channel_readouts import ReadoutMatrix


def test_one_channel_for_each_texel_stays_as_it_is():
    loads = np.random.default_rng(0).normal(size=(50, 7))
    assert ReadoutMatrix().channels(loads).tobytes() == loads.tobytes()


def test_dense_and_sparse_agree():
    random = np.random.default_rng(1)
    loads, matrix = random.normal(size=(40, 6, 3)), random.normal(size=(4, 18)) * (random.random((4, 18)) < 0.3)
    dense = ReadoutMatrix(matrix, 1.0).channels(loads)
    np.testing.assert_allclose(ReadoutMatrix(sparse.csr_matrix(matrix), 1.0).channels(loads), dense, atol=1e-14)
    np.testing.assert_allclose(dense, np.einsum("cnq,tnq->tc", matrix.reshape(4, 6, 3), loads) + 1.0, atol=1e-13)


def test_another_number_of_loads_is_refused():
    with pytest.raises(ParameterError, match="has 4 columns and the texels have 3 loads"):
        ReadoutMatrix(np.ones((2, 4))).channels(np.ones((50, 3)))
