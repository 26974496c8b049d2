"""A resistance stands for its mean over the tests, whatever an effect adds to it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from heatrun.discovery.alternatives import nearest_resistance

POWER_W = np.array([200.0, 400.0])


class Surface:
    """Rise over a surface: a resistance of 0.1 K/W and, as an effect, one beside it."""

    slots = (SimpleNamespace(parameter=SimpleNamespace(sd=1.5)), None)

    def linearise(self, z, free):
        resistance, beside = 0.1 * np.exp(1.5 * z[0]), z[1]
        return -POWER_W / (1.0 / resistance + beside), None


@pytest.mark.parametrize("beside", [0.5, 150.0, 9000.0])
def test_the_resistance_takes_over_what_the_effect_did(beside):
    """Five steps of Newton's method do not arrive at the second, and leave the numbers in a fit."""
    with_effect = np.array([0.0, beside])
    found = nearest_resistance(Surface(), with_effect, np.array([0.0, 0.0]), 0)
    assert 0.1 * np.exp(1.5 * found) == pytest.approx(1.0 / (10.0 + beside), rel=1e-3)
