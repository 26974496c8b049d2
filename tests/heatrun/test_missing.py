"""What `calibrate` says of a network that misses something: too small to see, large enough to err.

The records come from the bench with hidden causes, which shares no code with the packages.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from measured_machine import measured_record
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

import heatrun
from heatrun.bench.reduction import reduce
from heatrun.effects.linear import evidence
from heatrun.effects.missing import SCALES, Missing, _small, missing, missing_finding
from heatrun.inference.catalogue import all_effects
from heatrun.inference.fitting.fit import fit
from heatrun.inference.model import Model
from heatrun.inference.plausible_effects import PlausibleEffect
from heatrun.inference.problem import Problem


@pytest.fixture(scope="module")
def calibrated(hidden_bench, tmp_path_factory):
    """Calibrate a machine with a hidden cause of 0.12 K; return the run and its case."""

    def calibrate(hidden, seed):
        case = hidden_bench.make_case(hidden, seed, target_K=0.12, resolution_K=0.1)
        folder = tmp_path_factory.mktemp("missing")
        motor = folder / "motor.toml"
        motor.write_text(
            f'[motor]\nname = "study"\nlosses = "{case.losses}"\n'
            f"rated_speed_rpm = {case.machine.rated_speed_rpm:.2f}\n[winding]\n"
            f"phase_resistance_ohm = {case.machine.phase_resistance_ohm:.6g}\n",
            encoding="utf-8",
        )
        paths = {}
        for test, name in ((case.tests[0], "stairs"), (case.tests[2], "other")):
            paths[name] = folder / f"{name}.csv"
            table = pd.DataFrame(test.columns).iloc[::4]  # a logger with 2 s
            table.to_csv(paths[name], index=False, float_format="%.6g")
        run = heatrun.calibrate(
            motor, paths["stairs"], holdout=paths["other"], model="second", method="quick",
            out=folder / "run",
        )  # fmt: skip
        return run, case

    return calibrate


@pytest.fixture(scope="module")
def clean(generator, motor):
    """Return the fit of a clean record, and what it may miss."""
    record = measured_record(generator, generator.duty(3600.0), 71)
    model = Model.of("second", motor)
    found = fit(Problem.of(model, motor, [model.with_bodies(reduce(record, motor))]))
    return found, missing(found)


@pytest.mark.parametrize("one_sign", [True, False])
def test_the_evidence_of_a_small_effect_is_that_of_its_law(one_sign):
    """A line with a parameter and an effect, by numerical integration over the effect's size."""
    rng = np.random.default_rng(3)
    by_score, by_size = rng.normal(size=(2, 12))
    rows = 0.7 * by_score + 0.2 * by_size + rng.normal(size=12)

    def likelihood(size):  # the score integrated out, with its standard normal prior
        covariance = np.eye(12) + np.outer(by_score, by_score)
        density = multivariate_normal(-size * by_size, covariance)  # residual + slope * step
        return density.pdf(rows) / multivariate_normal(np.zeros(12), covariance).pdf(rows)

    def integrated(scale):
        low, folded = (0.0, 2.0) if one_sign else (-np.inf, 1.0)
        return quad(lambda s: folded * norm.pdf(s, scale=scale) * likelihood(s), low, np.inf)[0]

    at = np.array([0.4]), 0.3  # a fit that stands somewhere
    residual = rows + at[0][0] * by_score + at[1] * by_size
    joined = np.column_stack([residual, by_score, by_size])
    found, parts = _small(joined.T @ joined, *at, has_one_sign=one_sign)
    none = np.column_stack([rows, by_score])
    log_bayes = found - evidence(none.T @ none, np.zeros(1))[0]
    expected = np.mean([integrated(scale) for scale in SCALES])
    assert log_bayes == pytest.approx(np.log(expected), abs=1e-6)
    assert sum(part.share for part in parts) == pytest.approx(1.0)
    wide = parts[-1]
    by_hand = np.linalg.inv(joined[:, 1:].T @ joined[:, 1:] + np.diag([1.0, 1.0 / SCALES[-1] ** 2]))
    np.testing.assert_allclose(wide.covariance, by_hand)
    np.testing.assert_allclose(wide.mean, -by_hand @ joined[:, 1:].T @ rows)


def test_of_a_clean_record_nothing_is_seen(clean):
    _, found = clean
    assert found.p > 0.02  # the duty is clean; seed 71 of its noise was not chosen for this
    assert not found.is_seen
    assert found.probability_of_none >= 0.5
    sights = {each.candidate.id: each for each in found.sights}
    # a gain of the losses is taken up by C and R; a lag of the sensor by nothing
    assert not sights["loss_gain"].is_visible
    assert sights["sensor_lag"].is_visible


def test_a_resistance_stands_for_its_mean_over_the_tests(clean):
    """An effect of next to nothing once moved it by 15 %, for its size was that of another fit."""
    fitted, found = clean
    assert found.alternatives
    for each in found.alternatives:
        apart = np.abs(each.mean() - fitted.z) / np.sqrt(
            np.diag(fitted.covariance)[: fitted.z.size]
        )
        assert np.max(apart) < 3.0, each.effect.id
        if np.any(each.turn):
            place = int(np.argmax(np.abs(each.turn)))
            without = each.effect.without[fitted.slots[place].parameter.name]
            value = each.effect.with_effect[fitted.slots[place].parameter.name]
            parameter = fitted.slots[place].parameter
            assert parameter.score(without) - parameter.score(value) == pytest.approx(
                each.turn[place]
            )


def of_kind(run, name):
    return [finding for finding in run.result.findings if finding.id == name]


def of_friction(fitted, probability, shift=0.0):
    """Return the finding that bearing friction may be missing, which moves the first parameter."""
    kind = next(kind for kind in all_effects() if kind.card.id == "bearing_friction")
    moved = fitted.z.copy()
    moved[0] += shift * np.sqrt(fitted.covariance[0, 0])
    first = SimpleNamespace(
        effect=PlausibleEffect(kind, None, probability, {}, {}), mean=lambda: moved
    )
    finding = missing_finding(
        fitted,
        Missing(0.004, 3.0, (first,)),  # pyright: ignore[reportArgumentType]
    )
    assert finding is not None
    assert f"bearing_friction ({100 * probability:.0f} %)" in finding.message
    assert finding.values["probability_of_none"] == pytest.approx(1.0 - probability)
    return finding


def test_what_does_not_matter_is_a_note(fitted):
    """What matters is in the network by now; the intervals allow for the rest."""
    finding = of_friction(fitted, 0.45)
    assert finding.severity == "note"
    assert "too little for a name" in finding.message
    assert "no parameter of the network would move" in finding.message
    moved = of_friction(fitted, 0.45, shift=-1.5)
    assert moved.severity == "note"
    assert fitted.slots[0].name in moved.message


def test_of_one_effect_in_two_tests_the_likelier_is_told(fitted):
    kind = next(kind for kind in all_effects() if kind.card.id == "cooling_step")
    moved = fitted.z.copy()
    moved[0] += 3.0 * np.sqrt(fitted.covariance[0, 0])
    likelier, other = (
        SimpleNamespace(effect=PlausibleEffect(kind, test, share, {}, {}), mean=lambda z=z: z)
        for test, share, z in (("first", 0.5, moved), ("second", 0.3, fitted.z))
    )
    found = Missing(0.004, 3.0, (likelier, other))  # pyright: ignore[reportArgumentType]
    finding = missing_finding(fitted, found)
    assert finding is not None
    name = fitted.slots[0].name
    assert f"against the network alone: {name}" in finding.message
    assert finding.values[f"change_of_{name}"] != 0.0


@pytest.mark.slow
def test_an_effect_too_small_to_see_is_told_and_the_intervals_allow_for_it(calibrated):
    run, case = calibrated(("external_loss",), 7)
    model = run.result.models["second"]
    # the error is small, and yet the network alone would put a parameter far off
    assert next(row for row in model.residuals if row.role == "calibration").rmse_K < 0.35
    (finding,) = of_kind(run, "missing_effect")
    assert "external_loss" in finding.message
    assert "--with" in finding.remedy
    assert finding.values["familywise_p"] < 0.01
    assert "external_loss" in [row.id for row in model.maybe_missing]
    entry, truth = model.parameters["Ceq_sr"], case.machine.Ceq_sr
    alone = entry.value / (1.0 + finding.values["change_of_Ceq_sr"])
    assert abs(alone - truth) > 3.0 * abs(entry.value - truth)
    for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"):
        entry = model.parameters[name]
        assert entry.interval_95[0] < getattr(case.machine, name) < entry.interval_95[1], name


@pytest.mark.slow
def test_a_run_read_back_predicts_with_the_effects_that_it_may_miss(calibrated):
    run, _ = calibrated(("external_loss",), 7)
    course = run.courses()[1]
    again = run.predict(run.source(run.tests[1]))
    np.testing.assert_allclose(again.median, course["second_winding_degC"], atol=0.05)
    draws = run.draws()
    with_effect = draws.plausible.which != -1
    assert with_effect.mean() == pytest.approx(
        sum(row.probability for row in run.result.models["second"].maybe_missing), abs=0.05
    )
    assert np.ptp(draws.plausible.size[with_effect]) > 0.0


@pytest.mark.slow
def test_of_a_machine_that_is_what_it_seems_nothing_is_told(calibrated):
    run, _ = calibrated((), 8)
    for name in ("missing_effect", "holdout_outside_band", "instrument_beyond_prior"):
        assert not of_kind(run, name)
