"""One contract for every effect of the catalogue: adding a class to `EFFECTS` is enough."""

from __future__ import annotations

import inspect
import re

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lptn
from lptn import EFFECTS, NeighbourBody, SensorLag, SpeedCooling
from lptn.effects import HeatEffect, NodeEffect, SensorEffect

every_effect = pytest.mark.parametrize("kind", EFFECTS, ids=lambda kind: kind.card.id)


def build(kind, **values):
    """An effect at its typical values, with some of them replaced."""
    typical = {name: q.typical for name, q in kind.card.parameters.items()}
    return kind(**{name: jnp.asarray(v) for name, v in (typical | values).items()})


def null(kind):
    values = {n: q.null for n, q in kind.card.parameters.items() if q.null is not None}
    return build(kind, **values)


@every_effect
def test_null_value_is_the_base_model(kind, network, losses, short, start):
    base = lptn.reading(network, losses, short, start)
    gone = lptn.reading(network, losses, short, start, effects=[null(kind)])
    np.testing.assert_allclose(gone, base, atol=1e-8)  # K; a null conductance is 1e-12 W/K
    there = lptn.reading(network, losses, short, start, effects=[build(kind)])
    assert float(jnp.max(jnp.abs(there - base))) > 1e-3


@every_effect
@pytest.mark.parametrize("at_null", [False, True])
def test_gradients_are_finite_and_true(kind, at_null, network, losses, short, start):
    effect = null(kind) if at_null else build(kind)
    weights = jnp.cos(jnp.arange(short.num_time + 1))

    def score(values):
        chosen = build(kind, **values)
        return jnp.sum(weights * lptn.reading(network, losses, short, start, effects=[chosen]))

    values = {name: getattr(effect, name) for name in kind.card.parameters}
    gradient = jax.grad(score)(values)
    for name, quantity in kind.card.parameters.items():
        assert np.isfinite(float(gradient[name]))
        width = 1e-4 * (quantity.high - quantity.low)
        if at_null and quantity.null is not None and quantity.null <= quantity.low:
            points, factors = (0.0, 1.0, 2.0), (-1.5, 2.0, -0.5)  # one-sided, second order
        else:
            points, factors = (-1.0, 1.0), (-0.5, 0.5)
        slope = sum(
            factor * score(values | {name: values[name] + point * width})
            for point, factor in zip(points, factors, strict=True)
        )
        # truncation of the differences ~ width^2, rounding of a sum of 121 readings ~ 1e-8
        expected = float(slope) / width
        assert float(gradient[name]) == pytest.approx(expected, rel=5e-3, abs=1e-6 / width)


@every_effect
def test_eager_jit_and_vmap_agree(kind, network, losses, short, start):
    def reading(effect):
        return lptn.reading(network, losses, short, start, effects=[effect])

    effects = [build(kind), null(kind)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *effects)
    eager = jnp.stack([reading(effect) for effect in effects])
    np.testing.assert_allclose(eqx.filter_vmap(reading)(stacked), eager, rtol=1e-12)
    np.testing.assert_allclose(jax.jit(reading)(effects[0]), eager[0], rtol=1e-12)


@every_effect
def test_energy_balance_closes(kind, network, losses, short, start):
    trace = lptn.simulate(network, losses, short, start, effects=[build(kind)])
    whole = network
    if issubclass(kind, NodeEffect):
        whole = build(kind).extend(network)
    stored = sum(whole.capacitance[n] * jnp.diff(trace.temperature[n]) for n in whole.nodes)
    out = sum(flow for link, flow in trace.flow.items() if link[1] == "ambient")
    expected = short.step * (sum(trace.heat.values()) - out)
    np.testing.assert_allclose(stored, expected, rtol=1e-9, atol=1e-7)
    if issubclass(kind, SensorEffect):
        base = lptn.simulate(network, losses, short, start)
        np.testing.assert_allclose(
            trace.temperature["winding"], base.temperature["winding"], rtol=1e-14
        )


@every_effect
def test_card_and_docstring_are_complete(kind):
    card = kind.card
    file = inspect.getfile(kind)
    assert file.endswith(f"/{card.id}.py")
    assert issubclass(kind, HeatEffect | NodeEffect | SensorEffect)
    for sentence in (card.family, card.law, card.signature, card.separating_test):
        assert len(sentence) > 5
    nulls = [q for q in card.parameters.values() if q.null is not None]
    assert nulls, "some parameter must make the effect vanish"
    for quantity in card.parameters.values():
        assert quantity.unit
        assert quantity.low <= quantity.typical <= quantity.high
    for need in card.needs:
        assert need in {field.name for field in lptn.Drive.__dataclass_fields__.values()}
    text = inspect.getdoc(kind)
    assert re.search(r"\$\$.*\$\$", text, re.S)
    assert "Attributes:" in text
    assert "Valid for:" in text
    assert inspect.getmodule(kind).__doc__


def test_effects_of_all_kinds_compose(network, losses, short, start):
    effects = [build(kind) for kind in EFFECTS]
    trace = lptn.simulate(network, losses, short, start, effects=effects)
    exact = lptn.reference(network, losses, short, start, effects=effects)
    assert float(jnp.max(jnp.abs(trace.reading - exact.reading))) < 1e-3
    assert "neighbour" in trace.temperature


def test_speed_cooling_without_speed_says_what_to_do(network, losses, short, start):
    deaf = eqx.tree_at(lambda i: i.speed, short, None)
    with pytest.raises(ValueError, match="speed_rpm"):
        lptn.simulate(network, losses, deaf, start, effects=[build(SpeedCooling)])


def test_speed_cooling_scales_the_conductance(network, losses, regroup, start):
    inputs = regroup(num=2400, group=20)
    still = eqx.tree_at(lambda i: i.speed, inputs, jnp.zeros_like(inputs.speed))
    base = lptn.reading(network, losses, still, start)
    same = lptn.reading(network, losses, still, start, effects=[build(SpeedCooling, g=3.0)])
    np.testing.assert_allclose(same, base, rtol=1e-12)


def test_sensor_lag_of_a_ramp_is_the_closed_form():
    tau, slope = 12.0, 0.5
    edges = jnp.arange(0.0, 400.0, 2.0)
    ramp = 20.0 + slope * edges
    lagged = SensorLag(jnp.asarray(tau)).observe(ramp, {}, edges)
    exact = 20.0 + slope * (edges - tau * (1.0 - jnp.exp(-edges / tau)))
    np.testing.assert_allclose(lagged, exact, atol=1e-10)


def test_neighbour_body_keeps_its_heat_in_the_system(network, losses, short, start):
    body = NeighbourBody(G=jnp.asarray(3.0), C=jnp.asarray(8000.0))
    trace = lptn.simulate(network, losses, short, start, effects=[body])
    given = jnp.sum(trace.flow["stator", "neighbour"]) * short.step
    stored = 8000.0 * (trace.temperature["neighbour"][-1] - trace.temperature["neighbour"][0])
    assert float(given) == pytest.approx(float(stored), rel=1e-9)


def test_an_effect_on_a_link_that_is_not_there_is_refused(losses, short):
    one = lptn.first_order(1e4, 0.1)
    with pytest.raises(ValueError, match="link"):
        lptn.simulate(one, losses, short, {"winding": 20.0}, effects=[build(SpeedCooling)])
    with pytest.raises(ValueError, match="node"):
        lptn.simulate(one, losses, short, {"winding": 20.0}, effects=[build(NeighbourBody)])
