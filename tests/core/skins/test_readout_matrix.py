# SPDX-License-Identifier: GPL-3.0-or-later
"""Linear read-outs: what they compute, and what recordings determine of them."""

import numpy as np
import pytest
from scipy import sparse

from palpate.core.errors import ParameterError
from palpate.core.skins.readout_matrix import ReadoutMatrix, fit_readout_matrix, net_force_readout


def test_one_channel_for_each_texel_stays_as_it_is():
    loads = np.random.default_rng(0).normal(size=(50, 7))
    assert ReadoutMatrix().channels(loads).tobytes() == loads.tobytes()


def test_dense_and_sparse_agree_and_the_net_force_is_the_sum():
    random = np.random.default_rng(1)
    loads, matrix = random.normal(size=(40, 6, 3)), random.normal(size=(4, 18)) * (random.random((4, 18)) < 0.3)
    dense = ReadoutMatrix(matrix, 1.0).channels(loads)
    np.testing.assert_allclose(ReadoutMatrix(sparse.csr_matrix(matrix), 1.0).channels(loads), dense, atol=1e-14)
    np.testing.assert_allclose(dense, np.einsum("cnq,tnq->tc", matrix.reshape(4, 6, 3), loads) + 1.0, atol=1e-13)
    normal = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(net_force_readout(normal).channels(np.array([[2.0, 3.0]])), [[-3.0, 0.0, -2.0]])


def test_a_readout_is_found_with_its_errors():
    """Of 300 noisy fits the scatter of each coefficient is its standard error, to 15 %: 300 fits give it to 4 %."""
    random = np.random.default_rng(2)
    loads, matrix = random.normal(size=(60, 6)), random.normal(size=(4, 6))
    fits = [fit_readout_matrix(loads, loads @ matrix.T + 2.0 + 0.1 * random.normal(size=(60, 4))) for _ in range(300)]
    found = np.stack([fit.readout.matrix for fit in fits])
    assert fits[0].determined.all()
    np.testing.assert_allclose(found.mean(axis=0), matrix, atol=0.005)
    error = np.sqrt(np.mean([fit.standard_error**2 for fit in fits], axis=0))
    np.testing.assert_allclose(found.std(axis=0), error, rtol=0.15)
    np.testing.assert_allclose(np.mean([fit.readout.offset for fit in fits], axis=0), 2.0, atol=0.01)


def test_what_recordings_do_not_determine_is_said():
    random = np.random.default_rng(3)
    loads = random.normal(size=(80, 4))
    loads[:, 3] = loads[:, 2]  # two texels that were always pressed together
    fit = fit_readout_matrix(loads, loads @ np.array([[1.0, 2.0, 3.0, 5.0]]).T)
    assert list(fit.determined) == [True, True, False, False]
    np.testing.assert_allclose(fit.readout.matrix, [[1.0, 2.0, 4.0, 4.0]], atol=1e-12)  # only their sum is known
    assert np.isinf(fit.standard_error[0, 2:]).all()
    np.testing.assert_allclose(fit.readout.channels(loads)[:, 0], loads @ [1.0, 2.0, 3.0, 5.0], atol=1e-12)


def test_samples_with_a_missing_channel_are_left_out_and_bad_shapes_are_refused():
    random = np.random.default_rng(4)
    loads = random.normal(size=(50, 3))
    readings = loads @ np.ones((3, 2))
    readings[::5, 1] = np.nan
    np.testing.assert_allclose(fit_readout_matrix(loads, readings).readout.matrix, np.ones((2, 3)), atol=1e-12)
    with pytest.raises(ParameterError, match=r"50 samples of loads and readings of the shape \(49, 2\)"):
        fit_readout_matrix(loads, readings[1:])
    with pytest.raises(ParameterError, match="needs at least 3"):
        fit_readout_matrix(loads, np.full((50, 2), np.nan))
    with pytest.raises(ParameterError, match="do not determine 3 coefficients"):
        fit_readout_matrix(loads[:4], np.ones((4, 1)))
    with pytest.raises(ParameterError, match="has 4 columns and the texels have 3 loads"):
        ReadoutMatrix(np.ones((2, 4))).channels(loads)
