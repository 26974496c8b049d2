"""Laws of effects against the machines of `make study-ordinary`, whose laws are others."""

import numpy as np
import pytest
from ordinary_machines import make, write_case

from heatrun.calibration import load_tests, with_scales_of
from heatrun.effects.engine import Engine
from heatrun.effects.found import with_catalogue
from heatrun.effects.search import Search
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor


def test_teeth_that_do_not_follow_the_load_leave_the_winding_its_capacity(tmp_path):
    """An induction motor at varied speed by independent code, whose rotor loss goes with the load.

    A loss of the teeth taken as a share of all that is no copper loss heated the winding too much
    at a step of load: heat capacity and conductance came out 14 % too large.
    """
    case = make("enclosed induction motor", 8072)
    *paths, _ = write_case(case, tmp_path)
    motor = load_motor(tmp_path / "motor.toml")
    tests = load_tests(motor, paths)
    motor, rows = with_scales_of(tests, motor), [test.blocks for test in tests]
    model = Model.of("second", motor).scaled(motor, rows)
    rows = [model.with_bodies(test) for test in rows]
    library, extended = with_catalogue(model, motor, rows)
    there = {"speed_cooling", "iron_loss_in_winding"}
    engine = Engine(Problem.of(extended, motor, rows))
    search = Search(engine, library.candidates)
    wanted = frozenset(each for each in library.candidates if each.id in there)
    found = search.fit(wanted, np.zeros(len(engine.slots)))
    values, _ = engine.values(np.nan_to_num(found.z), 0)
    truth = case.truth()
    assert values["Ceq_w"] == pytest.approx(truth["Ceq_w"], rel=0.04)
    assert values["Req_w"] == pytest.approx(truth["Req_w"], rel=0.04)
