from __future__ import annotations

import doctest

import jax.numpy as jnp
import pytest

from lptn import ALUMINIUM_COEFFICIENT, COPPER_COEFFICIENT, CopperLosses, copper_loss, losses


def test_docstring_examples_hold():
    results = doctest.testmod(losses)
    assert results.attempted > 0
    assert results.failed == 0


def test_resistance_follows_the_material():
    cold, hot = jnp.asarray(25.0), jnp.asarray(125.0)
    for B in (COPPER_COEFFICIENT, ALUMINIUM_COEFFICIENT):
        model = CopperLosses(Rs0=jnp.asarray(0.0062), coefficient=B)
        one = copper_loss(jnp.asarray(1e4), cold, model)
        two = copper_loss(jnp.asarray(1e4), hot, model)
        assert float(one) == pytest.approx(3 * 1e4 * 0.0062)
        assert float(two / one) == pytest.approx((B + 125.0) / (B + 25.0))


def test_shapes_must_agree():
    with pytest.raises(ValueError, match="expected the same"):
        copper_loss(jnp.zeros(3), jnp.zeros(4), CopperLosses(Rs0=jnp.asarray(1.0)))
