"""A discovery on reduced records: search and story, without sampling."""

from heatrun.discovery.discovery import tell
from heatrun.effects.found import find
from heatrun.effects.small_effects import small_effects
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior.fit_checks import holding_heat


def discovered(motor, tests, *, order="second", kinds=None, held_out=()):
    """Return what the effects change, as `heatrun discover` finds it before it samples."""
    model = Model.of(order, motor).scaled(motor, tests)
    rows = [model.with_bodies(test) for test in tests]
    alone = holding_heat(fit(Problem.of(model, motor, rows)))
    asked = find(model, motor, rows, kinds=kinds, held_out=held_out, start=alone)
    return tell(asked, small_effects(asked.fit, kinds), command="heatrun discover")
