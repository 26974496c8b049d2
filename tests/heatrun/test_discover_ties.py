"""An ambiguous verdict speaks for its whole set, in its numbers too."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_machines import machine

from heatrun.discovery.result import assemble
from heatrun.discovery.run import discover, show
from lptn import EFFECTS

pytestmark = pytest.mark.slow

RIVALS = ("radiation", "natural_convection")


@pytest.fixture(scope="module")
def case(hidden_bench):
    """A surface that radiates, by 0.25 K: the tests do not tell it from natural convection."""
    return machine(hidden_bench, ("radiation",), 33, target_K=0.25)


@pytest.fixture(scope="module")
def found(case):
    _, motor, tests, _ = case
    return discover(motor, tests, kinds=[kind for kind in EFFECTS if kind.card.id in RIVALS])


@pytest.fixture(scope="module")
def shown(case, found):
    return show(found, case[3], method="quick")


def test_the_draws_are_of_all_members_by_their_probabilities(found, shown):
    assert found.verdict.word == "ambiguous"
    last = shown.posteriors[1]
    effects = last.plausible.effects
    assert sorted(each.id for each in effects) == sorted(RIVALS)
    assert sum(each.probability for each in effects) == pytest.approx(1.0)
    assert min(each.probability for each in effects) > 0.05
    shares = np.bincount(last.plausible.which, minlength=2) / last.plausible.which.size
    np.testing.assert_allclose(shares, [each.probability for each in effects], atol=0.03)
    # the model that carries them has none of them itself
    assert last.fit.problem.model.effects == ()


def test_the_result_states_the_probabilities_and_holds_the_truth(case, found, shown):
    machine = case[0].machine
    roles = ["calibration", "calibration", "holdout"]
    result = assemble(found, shown, roles, command="test", seed=0)
    (effect,) = result.effects
    (tied,) = [rival for rival in effect.rivals if rival.id in effect.equivalents]
    assert effect.probability + tied.probability == pytest.approx(1.0)
    assert f"{tied.id} ({100 * tied.probability:.0f} %)" in effect.equivalents_in_words()
    assert set(effect.parameters) <= {"eA", "f", "n"}
    for name in ("Ceq_w", "Ceq_sr", "Req_w"):
        low, high = result.parameters[name].after.interval_95
        assert low < getattr(machine, name) < high
    assert result.holdout.rmse_after_K < 0.7 * result.holdout.rmse_before_K
    assert result.holdout.coverage_95_after > 0.9
