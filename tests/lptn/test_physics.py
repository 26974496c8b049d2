"""The networks against closed forms, matrix exponentials and the laws of heat conduction."""

import doctest

import jax.numpy as jnp
import numpy as np
import pytest
from compiled import linearise, reading, reference, simulate
from written_balances import corrected

import lptn
from lptn import ALUMINIUM_COEFFICIENT, COPPER_COEFFICIENT, CopperLosses, Drive, Inputs, copper_loss

B = lptn.COPPER_COEFFICIENT


def test_conductances_are_symmetric_and_leave_to_the_sink_alone(four_nodes):
    drive = Drive.constant(current_squared=0.0, losses=0.0, ambient=20.0)
    losses = CopperLosses(Rs0=jnp.asarray(0.0))
    A = np.asarray(linearise(four_nodes, losses, drive, dict.fromkeys(four_nodes.nodes, 20.0)).A)
    C = np.stack([four_nodes.capacitance[node] for node in four_nodes.nodes])
    G = -C[:, None] * A
    np.testing.assert_allclose(G, G.T, rtol=1e-13, atol=1e-15)
    to_sink = [1.0 / 0.018 if node == "yoke" else 0.0 for node in four_nodes.nodes]
    np.testing.assert_allclose(G.sum(axis=1), to_sink, atol=1e-12)


def test_an_added_node_takes_its_share_of_the_losses(network, losses, short, start):
    rotor = network.with_node(
        "rotor",
        capacitance=jnp.asarray(4000.0),
        links={"stator": jnp.asarray(0.3), "ambient": jnp.asarray(2.0)},
        share=jnp.asarray(0.25),
    )
    trace = simulate(rotor, losses, short, start | {"rotor": 20.0})
    heat = {node: np.asarray(watts) for node, watts in trace.heat.items()}
    other = np.asarray(trace.other_loss)
    np.testing.assert_allclose(heat["rotor"], 0.25 * other, rtol=1e-12)
    np.testing.assert_allclose(heat["stator"], 0.75 * other, rtol=1e-12)
    np.testing.assert_allclose(sum(heat.values()), short.losses, rtol=1e-12)
    assert set(trace.flow) == set(network.links) | {("rotor", "ambient"), ("stator", "rotor")}


def test_corrections_of_the_instruments_are_corrections_of_the_inputs(network, short, start):
    assert short.speed is not None
    by_hand = Inputs(
        step=short.step,
        current_squared=short.current_squared,
        losses=jnp.asarray(1.03 * np.asarray(short.losses) - 0.2 * np.asarray(short.speed)),
        ambient=jnp.asarray(np.asarray(short.ambient) - 0.7),
    )
    one = reading(network, corrected(), short, start)
    two = reading(network, CopperLosses(Rs0=jnp.asarray(0.0062)), by_hand, start)
    np.testing.assert_allclose(one, two, rtol=1e-12)


def test_steps_of_any_length_agree_with_the_reference(network, losses, start):
    rng = np.random.default_rng(3)
    num = 2292  # as `same` below: one compiled solver for both
    inputs = Inputs(
        step=jnp.asarray(rng.uniform(0.05, 2.0, num)),
        current_squared=jnp.asarray(rng.uniform(50.0, 150.0, num) ** 2),
        losses=jnp.asarray(rng.uniform(300.0, 900.0, num)),
        ambient=jnp.asarray(20.0 + np.cumsum(rng.normal(size=num)) / 50.0),
        rated_speed=jnp.asarray(350.0),
        rated_current=jnp.asarray(150.0),
    )
    fast = simulate(network, losses, inputs, start)
    exact = reference(network, losses, inputs, start)
    for node in network.nodes:
        gap = np.abs(np.subtract(fast.temperature[node], exact.temperature[node]))
        # (h/tau)^3/24 of a change of 80 K, with h = 2 s and tau = 92 s: 3e-5 K
        assert np.max(gap) < 3e-5


@pytest.fixture(scope="module")
def exact(network, losses, regroup_duty):
    return reference(network, losses, regroup_duty(), {"winding": 22.0, "stator": 20.0})


def test_hard_steps_of_load_at_10_hz(network, losses, regroup_duty, start, exact):
    fast = simulate(network, losses, regroup_duty(), start)
    assert 150.0 < np.max(exact.reading) < 160.0
    for node in network.nodes:
        gap = np.abs(np.subtract(fast.temperature[node], exact.temperature[node]))
        # (h/tau)^3/24 of a change of 200 K is 1e-8 K, and rounding 45,846 times 1e-16 of 400 K
        # may reach 2e-9 K; the project's target is 1e-6 K
        assert np.max(gap) < 1.2e-8


def test_blocks_of_two_seconds_cost_what_jumps_inside_them_must(
    network, losses, regroup_duty, start, exact
):
    coarse_inputs = regroup_duty(group=20)
    coarse = simulate(network, losses, coarse_inputs, start)
    at_edges = np.asarray(exact.reading)[::20][: coarse.reading.size]
    gap = np.abs(np.asarray(coarse.reading) - at_edges)
    # a jump by dq [W] in the middle of a block shifts the heat by h/4 on average: what is left
    # at its end is dq h^2/(8 tau C), whatever the method
    jump = float(losses.slope(jnp.asarray(220.0**2 - 50.0**2))) * (B + 160.0)
    assert 1e-3 < np.max(gap) < jump * 2.0**2 / (8.0 * 96.6 * 666.75)
    # the same means without the jumps: the method alone
    same = reference(network, losses, regroup_duty(group=20, unequal=True), start)
    assert np.max(np.abs(np.subtract(coarse.reading, same.reading))) < 5e-5


def test_docstring_examples_hold():
    results = doctest.testmod(lptn.network)
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
