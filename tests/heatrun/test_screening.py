"""The screening of effects: signatures that the parameters mimic, or that leave the model."""

from types import SimpleNamespace

import numpy as np
import pytest

from heatrun.effects import screen as screening
from heatrun.effects.screen import Screen, Signature

NUM_BLOCKS = 200

TOLD = 1e9
"""How much better than the priors the readings tell the parameters [1], as long steps of many
kilowatts do: beyond 1e7 a difference of products loses the priors to rounding."""


@pytest.fixture
def scored(monkeypatch):
    """Score signatures against a present model of three parameters in white noise."""
    monkeypatch.setattr(screening, "typical", lambda engine, slot: 1.0)
    rng = np.random.default_rng(3)
    jacobian = TOLD * rng.standard_normal((NUM_BLOCKS, 3))
    noise = rng.standard_normal(NUM_BLOCKS)

    def of(columns, hidden=0.0):
        columns = np.reshape(columns, (NUM_BLOCKS, -1))
        rows = noise - hidden * np.sum(columns, axis=1)
        precision = jacobian.T @ jacobian + np.eye(3)
        z = -np.linalg.solve(precision, jacobian.T @ np.nan_to_num(rows))
        present = SimpleNamespace(
            noise=None, free=(0, 1, 2), z=z, jacobian=jacobian, residual=rows + jacobian @ z
        )
        engine = SimpleNamespace(
            whiten=lambda noise, stacked: stacked,
            bounds=lambda slots: (np.full(len(slots), -np.inf), np.full(len(slots), np.inf)),
            rms_K=lambda raw: float(np.sqrt(np.mean(raw**2))),
        )
        slots = tuple(range(3, 3 + columns.shape[1]))
        signature = Signature("effect", slots, {}, columns)
        screen = Screen(engine, present, [signature])
        return screen.scores()[0], screen.largest_gain(rng.standard_normal((NUM_BLOCKS, 5)))

    return jacobian, rng, of


def test_a_large_signature_in_the_span_of_the_parameters_is_scored_by_the_priors(scored):
    jacobian, _, of = scored
    mimic = np.array([1.0, -2.0, 0.5])
    for size in (1e-3, 1.0, 30.0):
        score, largest = of(size * jacobian @ mimic)
        # what the parameters mimic costs their priors, which is all that speaks against it
        information = 1.0 + size**2 * mimic @ mimic
        assert score.log_bayes == pytest.approx(-0.5 * np.log(information), abs=0.01)
        assert np.all(np.isfinite(largest))


def test_a_signature_that_is_not_finite_scores_nothing(scored):
    jacobian, _, of = scored
    columns = jacobian[:, 0].copy()
    columns[7] = np.nan
    score, largest = of(columns)
    assert score.log_bayes == -np.inf
    assert not score.is_visible
    assert np.all(largest == -np.inf)


def test_the_gain_is_the_drop_of_the_sum_of_squares_of_a_joint_refit(scored):
    _, rng, of = scored
    columns = rng.standard_normal(NUM_BLOCKS)
    score, _ = of(columns, hidden=0.4)
    # the residual falls along minus its signature: the amplitude that was hidden comes back
    assert score.start[3] == pytest.approx(0.4, abs=4.0 / np.sqrt(NUM_BLOCKS))
    assert score.log_bayes > 5.0


def test_amplitudes_that_do_the_same_leave_their_difference_to_the_prior(scored):
    _, rng, of = scored
    column = 1e9 * rng.standard_normal(NUM_BLOCKS)
    score, largest = of(np.column_stack([column, column]))
    assert np.isfinite(score.log_bayes)
    # of their difference the prior alone speaks
    assert score.start[3] == pytest.approx(score.start[4], abs=1e-4)
    assert np.all(np.isfinite(largest))
