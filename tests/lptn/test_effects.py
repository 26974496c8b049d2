"""One contract for every effect of the catalogue: adding a class to `EFFECTS` is enough."""

import dataclasses
import inspect
import re
import sys
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import constant, reading, reference

import lptn
from lptn import EFFECTS
from lptn.effects import HeatEffect, NodeEffect, SensorEffect, applies, build_all
from lptn.effects import build as build_effect
from lptn.effects.bodies import NeighbourBody
from lptn.effects.heat_paths import SpeedCooling
from lptn.effects.sensors import SensorLag

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
    typical = {name: q.typical for name, q in kind.card.parameters.items()}
    typical |= {"t_star": 100.0} if "t_star" in typical else {}  # inside of the short record
    return build_effect(kind, typical | values, home(kind) if network is None else network)


def null(kind, network=None):
    values = {n: q.null for n, q in kind.card.parameters.items() if q.null is not None}
    return build(kind, network, **values)


def all_of(network):
    """All effects that a network has a place for, at their typical values."""
    wanted = []
    for kind in (kind for kind in EFFECTS if applies(kind, network)):
        made = build(kind, network)
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


NETWORKS = ("first order", "second order", "four nodes")


@pytest.fixture(scope="module", params=NETWORKS)
def any_network(request, network, four_nodes):
    return {
        "first order": lptn.first_order(12_500.0, 0.132),
        "second order": network,
        "four nodes": four_nodes,
    }[request.param]


class Seen(NamedTuple):
    reading: Any  # At the edges [degC].
    temperature: Any  # By node, at the edges [degC].
    gap: Any  # Largest gap of the balance of energy against the heat put in [1].


def seen_under(network, losses, short, start, effects):
    trace = lptn.simulate(network, losses, short, start, effects=effects)
    gap, put_in = gap_of_energy(network, short, effects, trace)
    return Seen(trace.reading, trace.temperature, jnp.max(jnp.abs(gap) / put_in))


def values_of(effect):
    return {name: float(getattr(effect, name)) for name in effect.card.parameters}


def kinds_of(network):
    return [kind for kind in EFFECTS if applies(kind, network)]


def row_of(network, present):
    """Values of all effects of a network by id, null but for those that are present."""
    return {
        kind.card.id: values_of((build if kind in present else null)(kind, network))
        for kind in kinds_of(network)
    }


@pytest.fixture(scope="module")
def of_row(losses, short):
    """Return what is seen of a network with all its effects, by one program for each network."""

    @jax.jit
    def compiled(network, short, start, row):
        wanted = [(kind, row[kind.card.id]) for kind in EFFECTS if kind.card.id in row]
        return seen_under(network, losses, short, start, build_all(wanted, network))

    def at(network, row, start=None):
        start = start_of(network) if start is None else start
        return jax.tree.map(np.asarray, compiled(network, short, start, row))

    return at


@pytest.fixture(scope="module")
def gradient_of_row(losses, short):
    """Return the slopes of a sum of readings by all values of a row."""
    weights = weights_of(short)

    @jax.jit
    def compiled(network, short, row):
        def score(row):
            wanted = [(kind, row[kind.card.id]) for kind in EFFECTS if kind.card.id in row]
            effects = build_all(wanted, network)
            start = start_of(network)
            return jnp.sum(weights * lptn.reading(network, losses, short, start, effects=effects))

        return jax.grad(score)(row)

    return lambda network, row: compiled(network, short, row)


def weights_of(short):
    return np.cos(np.arange(short.num_time + 1))


@every_effect
def test_null_value_is_the_base_model_and_energy_balance_closes(kind, of_row, losses, short):
    """Beside the other effects at their null: one program for all, and none of them may show."""
    network = home(kind)
    base = reading(network, losses, short, start_of(network))
    gone, acting = (of_row(network, row_of(network, present)) for present in ((), (kind,)))
    # K; what keeps gradients finite at the null value is 1e-12 W/K or 1e-9 of a step
    np.testing.assert_allclose(gone.reading, base, rtol=0.0, atol=1e-8)
    assert np.max(np.abs(acting.reading - base)) > 1e-3
    assert acting.gap < 1e-9
    if not issubclass(kind, HeatEffect | NodeEffect):
        for node, T in gone.temperature.items():
            np.testing.assert_array_equal(acting.temperature[node], T)


@every_effect
def test_gradients_are_finite_and_true(kind, of_row, gradient_of_row, short):
    network, weights = home(kind), weights_of(short)
    others = row_of(network, ()) if network is REFERENCE else {}

    def score(values):
        found = of_row(network, others | {kind.card.id: values})
        return float(np.sum(weights * found.reading))

    for effect, at_null in ((build(kind), False), (null(kind), True)):
        values = values_of(effect)
        gradient = gradient_of_row(network, others | {kind.card.id: values})[kind.card.id]
        for name, quantity in kind.card.parameters.items():
            width = 1e-2 if name == "t_star" else 1e-4 * (quantity.high - quantity.low)
            if quantity.null is None:  # beside its own size: a range may span three decades
                width = min(width, 1e-3 * values[name]) if values[name] else width
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
            expected = pytest.approx(slope / width, rel=1e-5, abs=1e-10 / width)
            assert float(gradient[name]) == expected


@some_effects
def test_alone_eager_jit_and_vmap_agree(kind, of_row, losses, short):
    """And alone it is what it is beside the others at their null, where the other tests see it."""
    network, start = home(kind), start_of(home(kind))
    both = [values_of(made(kind)) for made in (build, null)]
    eager = lptn.reading(network, losses, short, start, effects=[build(kind)])

    @jax.jit
    @jax.vmap
    def mapped(values):
        return lptn.reading(network, losses, short, start, effects=[build(kind, **values)])

    stacked = {name: np.array([values[name] for values in both]) for name in both[0]}
    alone = np.asarray(mapped(stacked))
    np.testing.assert_allclose(alone[0], eager, rtol=1e-12)
    beside = [of_row(network, row_of(network, present)).reading for present in ((kind,), ())]
    np.testing.assert_allclose(alone, beside, rtol=0.0, atol=1e-8)


@every_effect
def test_card_and_docstring_are_complete(kind):
    card = kind.card
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
    assert "Valid for:" in text
    assert (sys.modules[kind.__module__].__doc__ or "").count(" ") > 4


def test_effects_of_all_kinds_compose_in_any_network(any_network, of_row):
    start = {node: jnp.asarray(30.0) for node in any_network.nodes}
    found = of_row(any_network, row_of(any_network, kinds_of(any_network)), start)
    assert found.gap < 1e-9


@pytest.mark.parametrize(
    "any_network",
    [
        pytest.param(name, marks=() if name == "second order" else pytest.mark.slow)
        for name in NETWORKS
    ],
    indirect=True,
)
def test_effects_of_all_kinds_are_what_the_exact_solver_finds(any_network, short, losses, of_row):
    """Of two networks by `make test-slow`; by some effects four nodes are in the crosschecks."""
    start = {node: jnp.asarray(30.0) for node in any_network.nodes}
    found = of_row(any_network, row_of(any_network, kinds_of(any_network)), start)
    exact = reference(any_network, losses, short, start, effects=all_of(any_network))
    # fastest node 11 s, step 2 s: (h/tau)^3/24 of 20 K
    assert np.max(np.abs(found.reading - exact.reading)) < 5e-3


def test_effects_that_are_all_gone_leave_any_network_as_it_was(any_network, short, losses, of_row):
    start = {node: jnp.asarray(30.0) for node in any_network.nodes}
    base = reading(any_network, losses, short, start)
    gone = of_row(any_network, row_of(any_network, ()), start).reading
    np.testing.assert_allclose(gone, base, rtol=0.0, atol=1e-8 * len(EFFECTS))


OF_TWO_NODES = tuple(kind for kind in EFFECTS if home(kind) is REFERENCE)


def test_effects_compose_in_pairs(of_row):
    """What one effect does is still there beside the other."""

    def read(*present):
        return of_row(REFERENCE, row_of(REFERENCE, present)).reading

    single = {kind: read(kind) for kind in OF_TWO_NODES}
    for pair in zip(OF_TWO_NODES, OF_TWO_NODES[1:] + OF_TWO_NODES[:1], strict=True):
        both = read(*pair)
        for alone, absent in (pair, pair[::-1]):
            assert np.all(np.isfinite(single[alone]))
            assert np.max(np.abs(both - single[alone])) > 1e-4, f"{absent.card.id} has no effect"


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


def test_sensor_lag_of_a_ramp_is_the_closed_form():
    tau, slope = 12.0, 0.5
    inputs = constant(2.0, num=199)
    edges = 2.0 * np.arange(200)
    ramp = jnp.asarray(20.0 + slope * edges)
    lagged = eqx.filter_jit(SensorLag(jnp.asarray(tau)).observe)(ramp, {}, inputs)
    exact = 20.0 + slope * (edges - tau * (1.0 - np.exp(-edges / tau)))
    np.testing.assert_allclose(lagged, exact, atol=1e-10)


def test_an_effect_on_a_link_that_is_not_there_is_refused(losses, short):
    one = lptn.first_order(1e4, 0.1)
    with pytest.raises(ValueError, match="link"):
        lptn.simulate(one, losses, short, {"winding": 20.0}, effects=[build(SpeedCooling)])
    with pytest.raises(ValueError, match="node"):
        lptn.simulate(one, losses, short, {"winding": 20.0}, effects=[build(NeighbourBody)])
