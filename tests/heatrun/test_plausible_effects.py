"""Draws with effects behind them predict what the network with these predicts."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from machine_of_two_sensors import machine

from heatrun.model.draws import Draws, PlausibleEffect, PlausibleEffects
from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.posterior.predict import predict
from heatrun.posterior.virtual import virtual_record
from lptn.effects import EFFECTS

RECIRCULATION = next(each for each in EFFECTS if each.card.id == "ambient_recirculation")
NUM_DRAWS = 40


@pytest.fixture(scope="module")
def bench(hidden_bench):
    _, motor, tests, _ = machine(hidden_bench, (), 940211)
    return motor, tests


def draws_of(model, motor, tests, plausible=None):
    """Draws that are all at the most probable values."""
    rows = [model.with_bodies(test) for test in tests]
    found = parameters(model, motor, rows)
    vectors = np.zeros((NUM_DRAWS, found.num_free + 4))
    return Draws(model, motor, found, vectors, plausible)


def test_winding_nodes_flows_and_bodies_are_those_of_the_network_with_the_effect(bench):
    motor, tests = bench
    alone = Model.of("second", motor).scaled(motor, tests)
    named = "ambient_recirculation.r"
    extended = replace(alone, effects=(RECIRCULATION,))
    of_effect = draws_of(extended, motor, tests)
    with_effect = {n: float(np.median(v)) for n, v in of_effect.of_test(tests[0].name).items()}
    with_effect[named] = 0.02
    effect = PlausibleEffect(RECIRCULATION, None, 0.5, with_effect, {**with_effect, named: 0.0})
    plausible = PlausibleEffects((effect,), np.ones((NUM_DRAWS, 1)))
    found = predict(draws_of(alone, motor, tests, plausible), tests[0], fitted_as=tests[0].name)
    slot = [s.parameter.name for s in of_effect.parameters.slots].index(named)
    parameter = of_effect.parameters.slots[slot].parameter
    vectors = of_effect.vectors.copy()
    vectors[:, slot] = parameter.score(0.02)
    held = replace(of_effect, vectors=vectors)
    expected = predict(held, tests[0], fitted_as=tests[0].name)
    bare = predict(draws_of(alone, motor, tests), tests[0], fitted_as=tests[0].name)
    assert np.max(expected.median - bare.median) > 1.0  # the effect matters
    np.testing.assert_allclose(found.median, expected.median, atol=1e-6)
    for node, course in expected.nodes.items():
        np.testing.assert_allclose(found.nodes[node], course, atol=1e-6, err_msg=node)
    for link, course in expected.flows.items():
        np.testing.assert_allclose(found.flows[link], course, atol=1e-4, err_msg=str(link))
    (body,), (of_body,) = found.bodies, expected.bodies
    assert body.is_fitted
    np.testing.assert_allclose(body.median, of_body.median, atol=1e-6)
    record = SimpleNamespace(duration_s=float(tests[0].time[-1]))
    rows, of_effect, of_bare = (
        virtual_record(each, record, motor)  # pyright: ignore[reportArgumentType]
        for each in (found, expected, bare)
    )
    for name in rows.columns:
        change = np.sqrt(np.mean((of_effect[name] - of_bare[name]) ** 2))
        apart = np.sqrt(np.mean((rows[name] - of_effect[name]) ** 2))
        # between the middles of blocks along lines, where the flow steps with the load
        assert apart <= (0.15 if name.startswith("flow") else 0.01) * change + 1e-9, name


def test_a_body_in_a_link_leaves_the_flow_out_of_its_first_node(bench):
    """The case between stator and sink, and the end winding between winding and stator."""
    motor, tests = bench
    alone = Model.of("second", motor).scaled(motor, tests)
    rows = [alone.with_bodies(test) for test in tests[:1]]
    kinds = [kind for kind in EFFECTS if kind.card.id in ("housing_node", "end_winding_node")]
    extended = replace(alone, effects=tuple(kinds))
    known = parameters(extended, motor, rows, searched=kinds).by_test[0]
    centre = {name: p.centre for name, p in known.items() if not p.per_test}
    effects = []
    for kind in kinds:
        own = {
            f"{kind.card.id}.{name}": quantity.typical
            for name, quantity in kind.card.parameters.items()
            if quantity.null is not None
        }
        effects.append(PlausibleEffect(kind, None, 0.5, {**centre, **own}, centre))
    for index, effect in enumerate(effects):
        size = np.zeros((NUM_DRAWS, len(effects)))
        size[:, index] = 1.0
        plausible = PlausibleEffects(tuple(effects), size)
        found = predict(draws_of(alone, motor, tests, plausible), tests[0], fitted_as=tests[0].name)
        bare = predict(draws_of(alone, motor, tests), tests[0], fitted_as=tests[0].name)
        assert set(found.flows) == set(bare.flows)
        stored = found.flows["stator", "ambient"] - bare.flows["stator", "ambient"]
        assert np.all(np.isfinite(stored)), effect.id
        assert np.max(np.abs(stored)) > 0.1, effect.id


def test_effects_behind_one_draw_add_up(bench):
    motor, tests = bench
    alone = Model.of("second", motor).scaled(motor, tests)
    rows = [alone.with_bodies(test) for test in tests]
    known = parameters(alone, motor, rows).by_test[0]
    values = {name: p.centre for name, p in known.items() if not p.per_test}
    named = {"ambient_recirculation": {"r": 0.02}, "ac_copper_loss": {"k": 0.5}}
    effects = []
    for kind in (each for each in EFFECTS if each.card.id in named):
        own = {f"{kind.card.id}.{n}": v for n, v in named[kind.card.id].items()}
        effects.append(PlausibleEffect(kind, None, 0.5, {**values, **own}, values))

    def median(*sizes):
        plausible = PlausibleEffects(tuple(effects), np.tile(sizes, (NUM_DRAWS, 1)))
        drawn = draws_of(alone, motor, tests, plausible)
        return predict(drawn, tests[0], fitted_as=tests[0].name).median

    bare, first, second = median(0.0, 0.0), median(1.0, 0.0), median(0.0, 0.5)
    assert np.ptp(first - bare) > 0.1
    assert np.ptp(second - bare) > 0.1
    np.testing.assert_allclose(median(1.0, 0.5), first + second - bare, atol=1e-6)
