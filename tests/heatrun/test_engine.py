"""The engine of the search starts where the fit ended, however far that is from the priors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured_machine import measured_record

from heatrun.effects.engine import Engine, placed
from heatrun.effects.found import with_catalogue
from heatrun.fit.fit import fit
from heatrun.model.catalogue import all_effects
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Adequacy
from heatrun.record.reduction import reduce


@pytest.mark.slow
def test_an_instrument_far_beyond_its_prior_is_refitted_where_it_is(generator, motor):
    """Held at 8 standard deviations, a stator sensor that sits on the housing left 4 K of misfit to
    the search, which named an effect for it."""
    record = measured_record(generator, generator.duty(3600.0), 71)
    sink = record.channels["ambient_degC"]
    cool = sink + 0.6 * (record.channels["stator_degC"] - sink)
    record = replace(record, channels={**record.channels, "stator_degC": cool})
    # with next to no unmodelled heat, or that takes the blame
    model = Model.of("second", replace(motor, adequacy=Adequacy(unmodelled_heat=1e-4)))
    found = fit(Problem.of(model, motor, [model.with_bodies(reduce(record, motor))]))
    gain = found.problem.parameters.index("stator_gain")
    assert found.z[gain] < -10.0

    tests = found.problem.tests
    usable, extended = with_catalogue(model, motor, tests, all_effects())
    engine = Engine(Problem.of(extended, motor, tests, searched=usable.kinds))
    z, order = placed(engine, found)
    engine = engine.with_loggers(found.problem.loggers).with_heat(found.problem.heat)
    again = engine.refit(z, order, found.noise)
    assert again.z[order[gain]] < -10.0
    before, after = (np.sqrt(np.mean(rows**2))
                     for rows in (np.concatenate(found.residual), again.residual))  # fmt: skip
    assert after < 1.1 * before
