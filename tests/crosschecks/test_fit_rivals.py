"""The same fit by scipy on a simulator written independently in numba."""

import numpy as np
import pytest


def test_scipy_finds_the_same_optimum(found):
    pytest.importorskip("numba")
    import fits

    seen = fits.agreement(found)
    # a search that stops at a relative change of 1e-8 in the cost of 42 is within
    # sqrt(2 * 42e-8) = 9e-4 of a sd of its optimum
    assert max(map(abs, seen["gap_in_sd"].values())) < 1e-3, seen
    # the same function at the two optima, so only its curvature between them can tell them apart
    assert abs(seen["sum_of_squares_heatrun"] - seen["sum_of_squares_scipy"]) < 1e-6, seen


def test_the_dense_covariance_is_that_of_the_filter(found):
    pytest.importorskip("numba")
    import fits
    from scipy.stats import multivariate_normal

    from heatrun.model.noise import log_density

    blocks, noise = found.problem.tests[0], found.noise
    dense = fits.covariance(blocks, float(noise.sd), float(noise.time), float(noise.white))
    heat = fits.heat_of(found)
    dense += heat @ heat.T
    ours = float(
        log_density(blocks.lengthened(found.residual[0]), noise, found.problem.data.tests[0])
    )
    theirs = multivariate_normal(cov=dense).logpdf(found.residual[0])
    assert ours == pytest.approx(float(np.asarray(theirs)), rel=1e-10)  # two exact formulas
