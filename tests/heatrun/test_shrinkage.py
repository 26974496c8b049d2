"""The change of a prior, held against the integrals that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.stats import norm

from heatrun.effects.shrinkage import SCALES, rescaled, shrunk

# readings y = x + 2 a + noise of 0.5, once each; x and a scores of a parameter and an amplitude
J, Y, SD = np.array([[1.0, 2.0], [1.0, -0.5]]), np.array([0.9, 0.4]), 0.5


def gaussian():
    precision = J.T @ J / SD**2 + np.eye(2)
    return J.T @ Y / SD**2, precision


def integral(size, power, one_sign):
    """The integral of x^power over likelihood and priors, by Simpson's rule."""
    low = 0.0 if one_sign else -6.0
    axes = np.linspace(-6.0, 6.0, 1201), np.linspace(low, 6.0, 4801)
    x, a = np.meshgrid(*axes, indexing="ij")
    prior = norm.pdf(x) * norm.pdf(a, scale=size) * (2.0 if one_sign else 1.0)
    likelihood = [norm.pdf(y, row[0] * x + row[1] * a, SD) for y, row in zip(Y, J, strict=True)]
    values = x**power * prior * np.prod(likelihood, axis=0)
    return float(simpson(simpson(values, x=axes[1], axis=1), x=axes[0]))


@pytest.mark.parametrize("size", [0.1, pytest.param(0.5, marks=pytest.mark.slow), 1.0])
@pytest.mark.parametrize("one_sign", [False, True])
def test_the_gain_is_the_ratio_of_the_integrals(size, one_sign):
    mean, _, gain = rescaled(*gaussian(), [1], np.array([size]), has_one_sign=one_sign)
    ratio = integral(size, 0, one_sign) / integral(1.0, 0, False)
    assert gain == pytest.approx(np.log(ratio), abs=1e-6)
    if not one_sign:
        assert mean[0] == pytest.approx(integral(size, 1, False) / integral(size, 0, False))


def test_the_mixture_weighs_its_parts_by_their_integrals():
    parts, gain = shrunk(*gaussian(), [1], np.array([0.8]), has_one_sign=False)
    each = np.array([integral(0.8 * scale, 0, False) for scale in SCALES])
    assert [part.share for part in parts] == pytest.approx(each / each.sum())
    assert gain == pytest.approx(np.log(each.mean() / integral(1.0, 0, False)), abs=1e-6)
