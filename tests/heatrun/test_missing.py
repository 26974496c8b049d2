"""What `calibrate` says of a network that misses something: too small to see, large enough to err.

The records come from the bench with hidden causes, which shares no code with the packages.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import heatrun
from heatrun.effects.missing import Missing, missing_finding
from heatrun.inference.catalogue import all_effects
from heatrun.inference.plausible_effects import PlausibleEffect


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
