"""A resistance stands for its mean over the tests, whatever an effect adds to it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from measured_machine import measured_record

from heatrun.bench.reduction import reduce
from heatrun.effects.alternatives import _alternative, _refitted, nearest_resistance
from heatrun.effects.engine import placed
from heatrun.effects.extension import extended_engine
from heatrun.effects.missing import look
from heatrun.inference.catalogue import all_effects
from heatrun.inference.fitting.fit import fit
from heatrun.inference.model import Model
from heatrun.inference.problem import Problem

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


@pytest.fixture(scope="module")
def small(generator, motor):
    """Return the refit of an effect that no test shows, the parameter Req_w, and its place."""
    record = measured_record(generator, generator.duty(3600.0), 71)
    model = Model.of("second", motor)
    found = fit(Problem.of(model, motor, [model.with_bodies(reduce(record, motor))]))
    library, engine = extended_engine(model, motor, found.problem.tests, all_effects())
    z, order = placed(engine, found)
    engine = engine.with_loggers(found.problem.loggers).with_heat(found.problem.heat)
    screen, _ = look(engine, engine.refit(z, order, found.noise), library.candidates)
    score = next(s for s in screen.scores() if s.candidate.id == "insulation_conductivity")
    refitted = _refitted(found, engine, screen.present, score)
    alternative = _alternative(engine, refitted, 1.0)
    place = found.problem.parameters.index("Req_w")
    return alternative, found.slots[place].parameter, place


def test_an_effect_of_next_to_nothing_does_not_move_the_resistance(small):
    """Its mean over the tests was taken at another amplitude than was found: 15 % off."""
    alternative, parameter, place = small
    found = alternative.parts[-1].mean
    conductance = alternative.effect.with_effect["insulation_conductivity.b"] * found[-1] / 0.3
    moved = np.log(
        parameter.value(alternative.centred(found)[place]) / parameter.value(found[place])
    )
    assert abs(moved) < 100.0 * abs(conductance)  # no winding was 100 K from the 60 degC of the law
