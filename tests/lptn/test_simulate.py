"""The simulation, and what is folded from it without being stored."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import constant, reading, simulate
from written_balances import corrected

import lptn
from lptn import CopperLosses, first_order, longest_step, second_order
from lptn.effects.heat_paths import SpeedCooling
from lptn.effects.sensors import SensorLag


def test_one_node_follows_the_exponential_at_third_order():
    C, R, P = 12_500.0, 0.132, 800.0
    errors = []
    for step in (100.0, 50.0):
        inputs = constant(step, losses=P)
        trace = simulate(
            first_order(C, R), CopperLosses(Rs0=jnp.asarray(0.0)), inputs, {"winding": 20.0}
        )
        within = slice(int(3000 / step) + 1)
        exact = 20.0 + P * R * (1.0 - np.exp(-np.asarray(trace.time[within]) / (R * C)))
        errors.append(np.max(np.abs(np.asarray(trace.temperature["winding"][within]) - exact)))
    # halving the step of a third-order method divides the error by eight
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.05)


def test_affine_and_general_steps_are_the_same(network, regroup, start):
    for kind in ("balance", "map"):
        losses = corrected(kind)
        affine = simulate(network, losses, regroup(group=20), start)
        general = simulate(network, losses, regroup(group=20, unequal=True), start)
        for node in ("winding", "stator"):
            gap = np.abs(np.subtract(affine.temperature[node], general.temperature[node]))
            assert np.max(gap) < 1e-9  # rounding over 2,292 steps


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_energy_is_conserved_in_every_interval(network, kind, short, start):
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=kind)
    trace = simulate(network, losses, short, start)
    stored = sum(
        float(network.capacitance[node]) * np.diff(trace.temperature[node])
        for node in network.nodes
    )
    put_in = float(short.step) * sum(map(np.asarray, trace.heat.values()))
    out = float(short.step) * np.asarray(trace.flow["stator", "ambient"])
    np.testing.assert_allclose(stored, put_in - out, rtol=1e-9, atol=1e-7)  # J, of 1e3 J
    total = np.add(trace.copper_loss, trace.other_loss)
    expected = short.losses if kind == "balance" else np.add(short.losses, trace.copper_loss)
    np.testing.assert_allclose(total, expected, rtol=1e-12)
    np.testing.assert_allclose(trace.heat["winding"], trace.copper_loss)
    np.testing.assert_allclose(trace.heat["stator"], trace.other_loss)


def test_gradients_agree_with_finite_differences(short, start):
    @jax.jit
    def end(theta):
        network = second_order(theta[0], theta[1], theta[2], theta[3])
        losses = CopperLosses(Rs0=theta[4])
        return reading(network, losses, short, start)[-1]

    theta = np.asarray([666.75, 15060.1, 0.14485, 0.11625, 0.0062])
    gradient, forward = jax.jit(lambda theta: (jax.grad(end)(theta), jax.jacfwd(end)(theta)))(theta)
    for i in range(theta.size):
        width = 1e-5 * theta[i]
        step = width * np.eye(theta.size)[i]
        slope = (float(end(theta + step)) - float(end(theta - step))) / (2 * width)
        # truncation ~ 1e-10 relative, rounding ~ 1e-9
        assert float(gradient[i]) == pytest.approx(slope, rel=1e-6)
        assert float(forward[i]) == pytest.approx(float(gradient[i]), rel=1e-10)


def test_eager_jit_and_vmap_agree(losses, short, start):
    def of(Ceq_w):
        network = second_order(Ceq_w, 15060.1, 0.14485, 0.11625)
        return lptn.reading(network, losses, short, start)

    values = jnp.asarray([600.0, 666.75, 800.0])
    eager = np.stack([of(value) for value in values])
    np.testing.assert_allclose(jax.jit(jax.vmap(of))(values), eager, rtol=1e-13)
    np.testing.assert_allclose(jax.jit(of)(values[0]), eager[0], rtol=1e-13)
    # all of a trace, as the other tests have it
    network = second_order(values[0], 15060.1, 0.14485, 0.11625)
    alone, whole = (f(network, losses, short, start) for f in (lptn.simulate, simulate))
    jax.tree.map(partial(np.testing.assert_allclose, rtol=1e-12), whole, alone)


def test_sensor_gain_and_offset_show_in_the_reading_alone(network, losses, short, start):
    plain = simulate(network, losses, short, start)
    sensor = lptn.Sensor(gain=jnp.asarray(0.01), offset=jnp.asarray(0.4))
    read = simulate(network, losses, short, start, sensor=sensor)
    np.testing.assert_array_equal(plain.temperature["winding"], read.temperature["winding"])
    winding, ambient = np.asarray(plain.temperature["winding"]), np.asarray(short.ambient)
    rise = winding[1:-1] - 0.5 * (ambient[1:] + ambient[:-1])
    expected = winding[1:-1] + 0.01 * rise + 0.4
    np.testing.assert_allclose(read.reading[1:-1], expected, rtol=1e-12)


def test_longest_step_is_inside_the_stable_range(network):
    # for two nodes the eigenvalue itself: 1/92 s, so twice that is the limit of stability
    assert 20.0 < float(longest_step(network)) < 2 * 92.0


LAG = SensorLag(jnp.asarray(10.0))
COOLING = SpeedCooling(g=jnp.asarray(0.5), m=jnp.asarray(0.8))

SENSOR = lptn.Sensor(gain=jnp.asarray(0.02), offset=jnp.asarray(0.4))
"""With a gain the sink enters the reading, and it moves: both must take the same one."""


@pytest.fixture(scope="module")
def blocks(short):
    rng = np.random.default_rng(0)
    shape = (short.num_time // 10, 10)
    return jnp.asarray(rng.uniform(size=shape)), jnp.asarray(rng.uniform(size=shape))


@pytest.mark.parametrize("effects", [(), (COOLING,)], ids=["affine", "general"])
def test_accumulate_folds_the_reading(effects, network, losses, short, start):
    edges = reading(network, losses, short, start, effects=effects, sensor=SENSOR)
    edges = np.asarray(edges)
    weight = np.linspace(0.0, 1.0, short.num_time)
    total = eqx.filter_jit(lptn.accumulate)(
        network, losses, short, start, effects=effects, sensor=SENSOR,
        update=lambda carry, before, after, item: carry + item * (before + 2.0 * after),
        carry=jnp.zeros(()), data=jnp.asarray(weight),
    )  # fmt: skip
    expected = np.sum(weight * (edges[:-1] + 2.0 * edges[1:]))
    assert float(total) == pytest.approx(float(expected), rel=1e-12)


STATOR = lptn.Sensor("stator", jnp.asarray(0.01), jnp.asarray(-0.3), jnp.asarray(25.0))


@pytest.mark.parametrize("also", [(), (STATOR,)], ids=["one", "two"])
@pytest.mark.parametrize(
    "effects", [(), (COOLING,), (COOLING, LAG)], ids=["affine", "general", "sensor"]
)
def test_block_means_are_those_of_each_sensors_reading(
    effects, also, network, losses, short, start, blocks
):
    weight, position = blocks
    kept = [effect for effect in effects if effect is not LAG]
    asked = [(SENSOR, effects, weight, position), (STATOR, kept, position, weight)][: 1 + len(also)]
    found = eqx.filter_jit(lptn.block_means)(
        network, losses, short, start, effects=effects, sensor=SENSOR, also=also,
        weight=jnp.concatenate([each[2] for each in asked]),
        position=jnp.concatenate([each[3] for each in asked]),
    )  # fmt: skip
    rows = []
    for sensor, acting, share, place in asked:
        edges = np.asarray(reading(network, losses, short, start, effects=acting, sensor=sensor))
        before, after = edges[:-1].reshape(share.shape), edges[1:].reshape(share.shape)
        means = np.asarray(share) * (before + np.asarray(place) * (after - before))
        rows.append(np.sum(means, axis=1))
    np.testing.assert_allclose(found, np.concatenate(rows), rtol=1e-12)


def test_a_sensor_lags_as_the_effect_does(network, losses, short, start):
    lagging = lptn.Sensor(SENSOR.node, SENSOR.gain, SENSOR.offset, LAG.tau)
    found = reading(network, losses, short, start, sensor=lagging)
    expected = reading(network, losses, short, start, effects=[LAG], sensor=SENSOR)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_reading_is_that_of_the_trace(network, losses, short, start):
    trace = simulate(network, losses, short, start, effects=[LAG], sensor=SENSOR)
    alone = reading(network, losses, short, start, effects=[LAG], sensor=SENSOR)
    np.testing.assert_allclose(alone, trace.reading, rtol=1e-13)


def test_accumulate_refuses_effects_on_the_sensor(network, losses, short, start):
    with pytest.raises(ValueError, match=r"use reading\(\)"):
        lptn.accumulate(
            network, losses, short, start, effects=[LAG],
            update=lambda carry, before, after, item: carry, carry=0.0, data=short.losses,
        )  # fmt: skip


def test_blocks_that_do_not_hold_the_steps_are_refused(network, losses, short, start, blocks):
    weight, position = blocks
    for some in (weight[:-1], weight[:, :-1]):
        with pytest.raises(ValueError, match="120 steps in all"):
            lptn.block_means(network, losses, short, start, weight=some, position=some)
    with pytest.raises(ValueError, match="position"):
        lptn.block_means(network, losses, short, start, weight=weight, position=position[:-1])
