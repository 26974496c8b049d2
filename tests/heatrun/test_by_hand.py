"""Parameters moved by hand: the curve is that of the simulation."""

import numpy as np
import pytest

from heatrun.record.reduction import reduce
from heatrun.simulation import ByHand, exact_draws, predict_values


@pytest.fixture(scope="module")
def record(bench, generator):
    return bench(generator.constant_load(1200.0, torque=0.9), seed=47)


def test_the_moved_curve_is_the_simulated_one(record, motor, truth):
    hand = ByHand.of(record, motor)
    assert hand.units == {"Ceq_w": "J/K", "Ceq_sr": "J/K", "Req_w": "K/W", "Req_sr": "K/W"}
    moved = {name: truth[name] for name in hand.units}
    found = predict_values(motor, moved, record, "second")
    # the start temperatures stay those that the priors read off the first samples
    np.testing.assert_allclose(hand.course(moved), found.median, atol=0.02)
    error = {name: np.abs(hand.course(values) - hand.test.measured).max()
             for name, values in (("start", {}), ("truth", moved))}  # fmt: skip
    assert error["truth"] < 2.0 < error["start"]  # the priors know the size of the machine alone


def test_a_run_starts_where_it_was_fitted(record, motor, truth):
    class Fitted:
        """What of a run is asked for."""

        def __init__(self):
            self.motor = motor

        def draws(self):
            model = ByHand.of(record, motor).model
            return exact_draws(model, motor, moved, reduce(record, motor))

        def fitted_as(self, of):
            assert of is record

    moved = {name: 1.1 * truth[name] for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")}
    hand = ByHand.of(record, motor, Fitted())
    assert {name: hand.values[name] for name in moved} == pytest.approx(moved)
    np.testing.assert_allclose(hand.course({}), ByHand.of(record, motor).course(moved), atol=0.02)
