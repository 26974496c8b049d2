"""What is folded without being stored must be what `reading` gives."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import reading, simulate

import lptn
from lptn.effects.cooling import SpeedCooling
from lptn.effects.sensors import SensorLag

LAG = SensorLag(jnp.asarray(10.0))
COOLING = SpeedCooling(g=jnp.asarray(0.5), m=jnp.asarray(0.8))

SENSOR = lptn.Sensor(gain=jnp.asarray(0.02), offset=jnp.asarray(0.4))
"""With a gain the sink enters the reading, and it moves: both must take the same one."""


@pytest.fixture(scope="module")
def blocks(short):
    rng = np.random.default_rng(0)
    shape = (short.num_time // 10, 10)
    return jnp.asarray(rng.uniform(size=shape)), jnp.asarray(rng.uniform(size=shape))


def mean_of(weight, position, before, after):
    return np.sum(np.asarray(weight) * (before + np.asarray(position) * (after - before)), axis=1)


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


@pytest.mark.parametrize(
    "effects", [(), (COOLING,), (COOLING, LAG)], ids=["affine", "general", "sensor"]
)
def test_block_means_are_means_of_the_reading(effects, network, losses, short, start, blocks):
    weight, position = blocks
    edges = np.asarray(reading(network, losses, short, start, effects=effects, sensor=SENSOR))
    before, after = edges[:-1].reshape(weight.shape), edges[1:].reshape(weight.shape)
    means = eqx.filter_jit(lptn.block_means)(
        network, losses, short, start,
        weight=weight, position=position, effects=effects, sensor=SENSOR,
    )  # fmt: skip
    expected = mean_of(weight, position, before, after)
    np.testing.assert_allclose(means, expected, rtol=1e-12)


@pytest.mark.parametrize(
    "effects", [(), (COOLING,), (COOLING, LAG)], ids=["affine", "general", "sensor"]
)
def test_block_means_of_several_sensors_are_those_of_each(
    effects, network, losses, short, start, blocks
):
    weight, position = blocks
    stator = lptn.Sensor("stator", jnp.asarray(0.01), jnp.asarray(-0.3), jnp.asarray(25.0))
    found = eqx.filter_jit(lptn.block_means)(
        network, losses, short, start, effects=effects, sensor=SENSOR, also=(stator,),
        weight=jnp.asarray(np.concatenate([weight, position])),
        position=jnp.asarray(np.concatenate([position, weight])),
    )  # fmt: skip
    kept = [effect for effect in effects if effect is not LAG]
    rows = []
    for sensor, acting, share, place in (
        (SENSOR, effects, weight, position),
        (stator, kept, position, weight),
    ):
        edges = np.asarray(reading(network, losses, short, start, effects=acting, sensor=sensor))
        before, after = edges[:-1].reshape(share.shape), edges[1:].reshape(share.shape)
        rows.append(mean_of(share, place, before, after))
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
