"""One contract for every effect of the catalogue: adding a class to `EFFECTS` is enough."""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import lptn
from lptn import EFFECTS, CopperLosses
from lptn.effects import (
    AbstractEffect,
    HeatEffect,
    NodeEffect,
    SensorEffect,
    applies,
    build_all,
)
from lptn.effects import build as build_effect
from lptn.effects.neighbour_body import NeighbourBody
from lptn.effects.sensor_lag import SensorLag
from lptn.effects.speed_cooling import SpeedCooling

every_effect = pytest.mark.parametrize("kind", EFFECTS, ids=lambda kind: kind.card.id)
# one in three by `make test`, the others by `make test-slow`
some_effects = pytest.mark.parametrize(
    "kind",
    [
        pytest.param(kind, marks=() if place % 3 == 0 else pytest.mark.slow)
        for place, kind in enumerate(EFFECTS)
    ],
    ids=lambda kind: kind.card.id,
)


REFERENCE = lptn.second_order(666.75, 15060.1, 0.14485, 0.11625)
ONE_NODE = lptn.first_order(12_500.0, 0.132)


def home(kind):
    """The two-node network, or the one node for an effect that splits it."""
    return REFERENCE if applies(kind, REFERENCE) else ONE_NODE


def start_of(network):
    return {node: jnp.asarray(22.0 if node == "winding" else 20.0) for node in network.nodes}


def build(kind, network=None, **values):
    """An effect at its typical values, some of them replaced, tied to what the network has."""
    typical = {name: q.typical for name, q in kind.card.parameters.items()}
    typical |= {"t_star": 100.0} if "t_star" in typical else {}  # inside of the short record
    return build_effect(kind, typical | values, home(kind) if network is None else network)


def null(kind, network=None):
    values = {n: q.null for n, q in kind.card.parameters.items() if q.null is not None}
    return build(kind, network, **values)


def all_of(network, at_null=False):
    """All effects that a network has a place for, at their typical or at their null values."""
    wanted = []
    for kind in (kind for kind in EFFECTS if applies(kind, network)):
        made = null(kind, network) if at_null else build(kind, network)
        wanted.append((kind, {name: getattr(made, name) for name in kind.card.parameters}))
    return build_all(wanted, network)


def gap_of_energy(network, inputs, effects, trace):
    """Heat stored, less heat put in, plus heat let out [W], against the heat put in [W]."""
    for effect in effects:
        if isinstance(effect, NodeEffect):
            network = effect.extend(network)
    stored = sum(network.capacitance[n] * jnp.diff(trace.temperature[n]) for n in network.nodes)
    out = sum(flow for link, flow in trace.flow.items() if network.boundary in link)
    put_in = sum(trace.heat.values())
    return stored / inputs.step - put_in + out, put_in


@pytest.fixture(scope="module", params=["first order", "second order", "four nodes"])
def any_network(request, network, four_nodes):
    return {
        "first order": lptn.first_order(12_500.0, 0.132),
        "second order": network,
        "four nodes": four_nodes,
    }[request.param]


@pytest.fixture(scope="module")
def read(losses, short):
    """The reading of a base network under effects, compiled once for each set of kinds."""

    @eqx.filter_jit
    def reading(network, *effects: AbstractEffect):
        return lptn.reading(network, losses, short, start_of(network), effects=effects)

    return reading


@every_effect
def test_null_value_is_the_base_model(kind, read):
    base = read(home(kind))
    # K; what keeps gradients finite at the null value is 1e-12 W/K or 1e-9 of a step
    np.testing.assert_allclose(read(home(kind), null(kind)), base, rtol=0.0, atol=1e-8)
    assert float(jnp.max(jnp.abs(read(home(kind), build(kind)) - base))) > 1e-3


@every_effect
def test_gradients_are_finite_and_true(kind, losses, short):
    network, start = home(kind), start_of(home(kind))
    weights = jnp.cos(jnp.arange(short.num_time + 1))

    @jax.jit
    def score(values):
        chosen = build(kind, **values)
        return jnp.sum(weights * lptn.reading(network, losses, short, start, effects=[chosen]))

    gradient_of = jax.jit(jax.grad(score))
    for effect, at_null in ((build(kind), False), (null(kind), True)):
        values = {name: getattr(effect, name) for name in kind.card.parameters}
        gradient = gradient_of(values)
        for name, quantity in kind.card.parameters.items():
            width = 1e-2 if name == "t_star" else 1e-4 * (quantity.high - quantity.low)
            if quantity.null is None:  # beside its own size: a range may span three decades
                width = min(width, 1e-3 * float(values[name])) if values[name] else width
            if at_null and quantity.null is not None and quantity.null <= quantity.low:
                points, factors = (0.0, 1.0, 2.0), (-1.5, 2.0, -0.5)  # one-sided, second order
            else:
                points, factors = (-1.0, 1.0), (-0.5, 0.5)
            slope = sum(
                factor * score(values | {name: values[name] + point * width})
                for point, factor in zip(points, factors, strict=True)
            )
            # truncation of the differences ~ (1e-4)^2 of the curvature over the range; rounding
            # of a sum of 121 readings ~ 1e-11
            expected = pytest.approx(float(slope) / width, rel=1e-5, abs=1e-10 / width)
            assert float(gradient[name]) == expected


@some_effects
def test_eager_jit_and_vmap_agree(kind, read, losses, short):
    network, start = home(kind), start_of(home(kind))
    effects = [build(kind), null(kind)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *effects)
    compiled = jnp.stack([read(network, effect) for effect in effects])
    eager = lptn.reading(network, losses, short, start, effects=effects[:1])
    np.testing.assert_allclose(compiled[0], eager, rtol=1e-12)
    np.testing.assert_allclose(
        eqx.filter_vmap(lambda e: read(network, e))(stacked), compiled, rtol=1e-12
    )


@every_effect
def test_energy_balance_closes(kind, losses, short):
    network, start = home(kind), start_of(home(kind))
    effects = [build(kind)]
    trace = lptn.simulate(network, losses, short, start, effects=effects)
    gap, put_in = gap_of_energy(network, short, effects, trace)
    assert float(jnp.max(jnp.abs(gap) / put_in)) < 1e-9
    if not issubclass(kind, HeatEffect | NodeEffect):
        base = lptn.simulate(network, losses, short, start)
        for node, T in base.temperature.items():
            np.testing.assert_array_equal(trace.temperature[node], T)


@every_effect
def test_card_and_docstring_are_complete(kind):
    card = kind.card
    file = inspect.getfile(kind)
    assert file.endswith(f"/{card.id}.py")
    assert issubclass(kind, HeatEffect | NodeEffect | SensorEffect)
    for sentence in (card.family, card.law, card.signature, card.separating_test):
        assert len(sentence) > 3
        opening = " ".join(sentence.split()[:3])
        assert sentence.count(opening) == 1, "a sentence that begins again within itself"
    assert card.separating_test.count(" ") > 2
    assert set(card.parameters) <= {field.name for field in dataclasses.fields(kind)}
    nulls = [q for q in card.parameters.values() if q.null is not None]
    assert nulls, "some parameter must make the effect vanish"
    for quantity in card.parameters.values():
        assert quantity.unit
        assert quantity.meaning
        assert quantity.low <= quantity.typical <= quantity.high
    for need in card.needs:
        assert need in {field.name for field in lptn.Drive.__dataclass_fields__.values()}
    text = inspect.getdoc(kind) or ""
    assert re.search(r"\$\$.*\$\$", text, re.S)
    assert "Attributes:" in text
    assert "Valid for:" in text
    for name in card.parameters:
        assert re.search(rf"^ +{name}: .*\[.+\]", text, re.M), f"{name} needs a line with a unit"
    assert (sys.modules[kind.__module__].__doc__ or "").count(" ") > 4


def test_effects_of_all_kinds_compose_in_any_network(any_network, short):
    start = {node: 30.0 for node in any_network.nodes}
    losses = CopperLosses(Rs0=jnp.asarray(0.0062))
    effects = all_of(any_network)
    trace = lptn.simulate(any_network, losses, short, start, effects=effects)
    gap, put_in = gap_of_energy(any_network, short, effects, trace)
    assert float(jnp.max(jnp.abs(gap) / put_in)) < 1e-9
    exact = lptn.reference(any_network, losses, short, start, effects=effects)
    # fastest node 11 s, step 2 s: (h/tau)^3/24 of 20 K
    assert float(jnp.max(jnp.abs(trace.reading - exact.reading))) < 5e-3


def test_effects_that_are_all_gone_leave_any_network_as_it_was(any_network, losses, short):
    start = {node: 30.0 for node in any_network.nodes}
    base = lptn.reading(any_network, losses, short, start)
    effects = all_of(any_network, at_null=True)
    gone = lptn.reading(any_network, losses, short, start, effects=effects)
    np.testing.assert_allclose(gone, base, rtol=0.0, atol=1e-8 * len(EFFECTS))


OF_TWO_NODES = tuple(kind for kind in EFFECTS if home(kind) is REFERENCE)


@pytest.mark.parametrize(
    ("one", "other"), list(zip(OF_TWO_NODES, OF_TWO_NODES[1:] + OF_TWO_NODES[:1], strict=True)),
    ids=lambda kind: kind.card.id,
)  # fmt: skip
def test_effects_compose_in_pairs(one, other, read):
    """What one effect does is still there beside the other."""
    both = read(REFERENCE, build(one), build(other))
    for alone, absent in ((one, other), (other, one)):
        single = read(
            REFERENCE, *(build(kind) if kind is alone else null(kind) for kind in (one, other))
        )
        assert np.all(np.isfinite(single))
        assert float(jnp.max(jnp.abs(both - single))) > 1e-4, f"{absent.card.id} has no effect"


CHANNEL = {"speed": "speed_rpm", "speed_rad": "speed_rpm", "coolant": "coolant_degC", "fan": "fan"}
"""Channel of the record that each input of an effect comes from."""


@pytest.mark.parametrize(
    "kind", [kind for kind in EFFECTS if kind.card.needs], ids=lambda kind: kind.card.id
)
def test_an_effect_without_its_channel_says_what_to_map(kind, network, losses, short, start):
    for need in kind.card.needs:
        lost = need.removesuffix("_rad")
        deaf = dataclasses.replace(short, **{lost: None})
        with pytest.raises(ValueError, match=f"{kind.card.id} needs .* {CHANNEL[need]}: map it"):
            lptn.reading(network, losses, deaf, start, effects=[build(kind)])


@every_effect
def test_an_effect_needs_no_channel_but_those_of_its_card(kind, losses, short):
    network, start = home(kind), start_of(home(kind))
    kept = {need.removesuffix("_rad") for need in kind.card.needs}
    dropped = {name: None for name in ("speed", "coolant", "fan") if name not in kept}
    bare = dataclasses.replace(short, **dropped)
    jax.eval_shape(
        lambda effect: lptn.reading(network, losses, bare, start, effects=[effect]), build(kind)
    )


@pytest.mark.parametrize("ratio", [0.0, 0.5, -0.5, 1.0])
def test_speed_cooling_raises_the_conductance_to_the_law(ratio, network, losses, short, start):
    """Either direction of rotation cools alike."""
    speed = jnp.full(short.num_time, ratio * 350.0)
    inputs = eqx.tree_at(lambda inputs: inputs.speed, short, speed)
    raised = lptn.second_order(666.75, 15060.1, 0.14485, 0.11625 / (1.0 + 3.0 * abs(ratio) ** 0.7))
    cooled = lptn.reading(
        network, losses, inputs, start, effects=[build(SpeedCooling, g=3.0, m=0.7)]
    )
    np.testing.assert_allclose(cooled, lptn.reading(raised, losses, inputs, start), rtol=1e-12)


def test_sensor_lag_of_a_ramp_is_the_closed_form():
    tau, slope = 12.0, 0.5
    nothing = jnp.zeros(199)
    inputs = lptn.Inputs(jnp.asarray(2.0), nothing, nothing, nothing)
    edges = inputs.edges()
    ramp = 20.0 + slope * edges
    lagged = SensorLag(jnp.asarray(tau)).observe(ramp, {}, inputs)
    exact = 20.0 + slope * (edges - tau * (1.0 - jnp.exp(-edges / tau)))
    np.testing.assert_allclose(lagged, exact, atol=1e-10)


def test_neighbour_body_keeps_its_heat_in_the_system(network, losses, short, start):
    body = NeighbourBody(C=jnp.asarray(8000.0), tau=jnp.asarray(8000.0 / 3.0))
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
