"""The state matrix, against slopes of balances written independently."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from compiled import linearise
from written_balances import (
    CS,
    CW,
    LAWS,
    POWER,
    RS,
    RS0,
    RW,
    SINK,
    B,
    K,
    built,
    drive,
    jacobian,
    rate,
)

import lptn
from lptn import CopperLosses


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_state_matrix_of_one_node_is_that_by_hand(kind):
    C, R = 12_500.0, 0.132
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    at = linearise(lptn.first_order(C, R), losses, drive(), {"winding": 80.0})
    feedback = K if kind == "map" else 0.0
    heat = POWER + (K * B if kind == "map" else 0.0)
    np.testing.assert_allclose(at.A, [[(feedback - 1.0 / R) / C]], rtol=1e-12)
    np.testing.assert_allclose(at.offset, [(heat + SINK / R) / C], rtol=1e-12)
    np.testing.assert_allclose(
        lptn.time_constants(at.A), [R * C / (1.0 - feedback * R)], rtol=1e-12
    )


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_state_matrix_of_two_nodes_is_that_by_hand(kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    at = linearise(network, losses, drive(), {"winding": 80.0, "stator": 60.0})
    moved = K if kind == "balance" else 0.0
    A = np.array([[-(1 / RW + 1 / RS) / CS, (1 / RW - moved) / CS],
                  [1 / (RW * CW), (K - 1 / RW) / CW]])  # fmt: skip
    other = POWER - (K * B if kind == "balance" else 0.0)
    assert at.nodes == ("stator", "winding")
    np.testing.assert_allclose(at.A, A, rtol=1e-12)
    np.testing.assert_allclose(at.offset, [(other + SINK / RS) / CS, K * B / CW], rtol=1e-12)
    mean, det = 0.5 * np.trace(A), np.linalg.det(A)
    root = np.sqrt(mean**2 - det)
    np.testing.assert_allclose(
        lptn.time_constants(at.A), [1 / (root - mean), -1 / (root + mean)], rtol=1e-9
    )


@pytest.mark.parametrize("law", [law for law in LAWS if law not in ("none", "housing_node")])
def test_the_state_matrix_with_an_effect_is_the_slope_of_the_law(law, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    temperature = {"winding": 120.0, "stator": 85.0}
    at = linearise(network, losses, drive(), temperature, effects=built(law, network))
    slope = rate(law, "map")
    np.testing.assert_allclose(at.A, jacobian(slope, [85.0, 120.0]), rtol=1e-7)
    value = np.asarray(at.A) @ [85.0, 120.0] + np.asarray(at.offset)
    np.testing.assert_allclose(value, slope(0, [85.0, 120.0]), rtol=1e-10)


def test_the_time_constants_of_a_housing_are_those_of_the_ladder(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = built("housing_node", network)
    at = linearise(network, losses, drive(), {"winding": 20.0, "stator": 20.0}, effects=effects)
    assert at.nodes == ("housing", "stator", "winding")
    ladder = np.linalg.eigvals(jacobian(rate("housing_node", "map"), [20.0, 20.0, 20.0]))
    np.testing.assert_allclose(lptn.time_constants(at.A), np.sort(-1.0 / ladder.real), rtol=1e-7)
