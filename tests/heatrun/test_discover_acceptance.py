"""What an effect must show to be told, and how what is left is told."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heatrun.bench.reduction import reduce
from heatrun.discovery.grow import Growth, Round, look, refitted
from heatrun.discovery.judging.acceptance import Rival, judged
from heatrun.discovery.judging.final_check import Adequacy, adequacy
from heatrun.discovery.rivals import Swap, probability, settle
from heatrun.discovery.screening.engine import Engine, Refit
from heatrun.discovery.screening.library import Candidate, library
from heatrun.discovery.screening.screen import Score
from heatrun.discovery.screening.start import base_start
from heatrun.discovery.verdict import sampled_apart, verdict
from heatrun.inference.model import Model
from heatrun.inference.noise import Noise
from heatrun.inference.problem import Problem
from lptn import EFFECTS, second_order

KINDS = {kind.card.id: kind for kind in EFFECTS}
NOTHING: Any = None


def rival(effect: str, values: dict[str, float], sd: dict[str, float], **other: Any) -> Rival:
    """An effect that passes all but what its interval shows: much evidence, gap closed, drop."""
    given = {
        "candidate": Candidate(KINDS[effect]), "score": NOTHING, "refit": NOTHING,
        "delta_log_evidence": 40.0, "rmse_K": 0.2, "gap_K": 1.0, "left_out_K": 0.3,
        "left_out_without_K": 1.0, "drop": 90.0, "least_K": 0.1, "values": values, "sd": sd,
    }  # fmt: skip
    return judged(Rival(**{**given, **other}))


def test_an_effect_whose_interval_holds_its_null_is_not_accepted():
    """The overhang of 3 kg that was not there: f = -0.003 [-0.59, 0.59]."""
    found = rival(
        "end_winding_node",
        {"f": -0.003, "tau": 30.0, "p": 0.1}, {"f": 0.3, "tau": 10.0, "p": 0.5},
    )  # fmt: skip
    assert not found.is_physical
    assert "holds no effect at all" in found.reason
    assert "f from -0.591 to 0.585 holds 0" in found.reason
    assert "p from -0.88 to 1.08 holds 0" in found.reason


@pytest.mark.parametrize(
    ("value", "is_accepted"), [(0.57, False), (0.60, True)]
)  # 1.96 standard deviations of 0.3 are 0.588
def test_the_limit_is_the_interval_of_95_percent(value, is_accepted):
    found = rival("natural_convection", {"f": value, "n": 0.3}, {"f": 0.3, "n": 0.02})
    assert (found.reason == "") == is_accepted


def test_a_null_that_is_not_zero_counts_likewise():
    at_null = {"k": 1.05, "t_star": 1800.0}, {"k": 0.04, "t_star": 60.0}
    assert "k from 0.972 to 1.13 holds 1" in rival("cooling_step", *at_null).reason
    assert rival("cooling_step", {**at_null[0], "k": 1.2}, at_null[1]).reason == ""


def test_one_amplitude_away_from_its_null_is_enough():
    values, sd = {"f": 0.3, "tau": 30.0, "p": 0.5}, {"f": 0.2, "tau": 10.0, "p": 0.1}
    assert rival("end_winding_node", values, sd).reason == ""


def test_a_body_is_judged_with_its_time_constant_held():
    """A rotor that lowers chi2 by 32^2 had p at 1.5 standard deviations of the joint fit."""
    values, sd = {"p": 0.10, "C": 2e4, "tau": 2000.0}, {"p": 0.068, "C": 1e4, "tau": 1500.0}
    assert rival("rotor_node", values, sd).reason
    assert rival("rotor_node", values, sd, amplitude_sd={"p": 0.01}).reason == ""


def swap(effect: str, delta: float, reason: str) -> Swap:
    score = Score(Candidate(KINDS[effect]), 0.0, 0.0, {}, 0.0, 0.0, np.zeros(1), np.zeros(1))
    return Swap(score, NOTHING, delta, 0.9, {}, reason)


def test_a_rival_that_cannot_be_the_cause_takes_no_part_in_the_probability():
    swaps = [swap("sensor_gain", -3.2, "g = 0.04 is not physical"), swap("radiation", 2.0, "")]
    expected = 1.0 / (1.0 + math.exp(-10.0) + math.exp(-2.0))
    assert probability(10.0, swaps, 1.0) == pytest.approx(expected)
    assert probability(10.0, swaps, 4.0) == pytest.approx(
        1.0 / (1.0 + math.exp(-2.5) + math.exp(-0.5))
    )


@pytest.fixture(scope="module")
def lagged(duty, motor):
    """A record whose winding sensor lags by 25 s, with three kinds to search."""
    time_s, winding = duty.time_s, duty["winding_degC"]
    reading = np.empty(winding.size)
    reading[0] = winding[0]
    share = -np.expm1(-(time_s[1] - time_s[0]) / 25.0)
    for i in range(1, winding.size):
        reading[i] = reading[i - 1] + share * (winding[i] - reading[i - 1])
    blocks = reduce(replace(duty, channels={**duty.channels, "winding_degC": reading}), motor)
    kinds = tuple(KINDS[name] for name in ("sensor_lag", "speed_cooling", "time_shift"))
    found = library(kinds, second_order(1.0, 1.0, 1.0, 1.0), [blocks])
    model = Model.of("second", motor, found.kinds)
    return Engine(Problem.of(model, motor, [blocks], found.kinds)), found.candidates


def grown(engine: Engine, candidates, accepted: str) -> Growth:
    """A model that grew by an effect whatever speaks against it."""
    screen, noise_scores = look(engine, base_start(engine), candidates)
    scores, present = screen.scores(), screen.present
    score = next(score for score in scores if score.candidate.id == accepted)
    chosen = replace(refitted(engine, present, present, score), reason="")
    round_ = Round(present, noise_scores, scores, 0.001, [chosen], chosen)
    return Growth(present, present, [round_], chosen.refit, [chosen])


def test_a_rival_far_better_takes_the_place_of_what_was_accepted(lagged):
    engine, candidates = lagged
    final, named, dropped = settle(engine, grown(engine, candidates, "time_shift"), 1.0)
    assert [each.rival.candidate.id for each in named] == ["sensor_lag"]
    assert named[0].probability > 0.95
    (gone,) = dropped
    assert gone.candidate.id == "time_shift"
    assert gone.reason.startswith("sensor_lag explains the tests better in its place")
    at = engine.find("sensor_lag.tau")
    tau = float(engine.slots[at].parameter.value(np.asarray(final.z[at])))
    assert tau == pytest.approx(25.0, abs=3.0)


def test_an_effect_that_the_final_model_does_not_need_is_dropped_with_the_reason(lagged):
    engine, candidates = lagged
    alone = [c for c in candidates if c.id == "speed_cooling"]
    final, named, dropped = settle(engine, grown(engine, alone, "speed_cooling"), 1.0)
    assert named == []
    assert dropped[0].reason
    assert engine.find("speed_cooling.g") not in final.free


def test_slow_misfit_and_whole_error_are_of_the_same_residuals(lagged):
    """A wave of one hour and 2 K, and a fast one of 3 K that every window of 10 min averages."""
    engine, _ = lagged
    test = engine.tests[0]
    time_s = test.time
    fast = np.where(np.arange(time_s.size) % 2, 3.0, -3.0)
    residual = np.where(engine.is_observed, 2.0 * np.sin(2 * np.pi * time_s / 3600.0) + fast, 0.0)
    quiet = Noise(*(np.float64(x) for x in (1e-3, 30.0, 1e-3, 1e-6)))
    z = np.zeros(len(engine.slots))
    refit = Refit(engine.base, z, residual, engine.linearise(z, engine.base)[1], 0.0, 0.0, quiet)
    left = adequacy(engine, refit)
    assert left.rmse_K == pytest.approx(math.sqrt(2.0**2 / 2 + 3.0**2), rel=0.02)
    # the mean of a sine over a sixth of its period is sin(pi/6)/(pi/6) = 0.955 of it
    assert left.misfit_K == pytest.approx(0.955 * 2.0 / math.sqrt(2.0), rel=0.03)
    assert left.window_s == pytest.approx(600.0, abs=test.block_s)


LEFT = Adequacy(30.0, True, 900.0, misfit_K=0.57, rmse_K=1.31, window_s=600.0, noise_K=0.4)


def test_the_verdict_tells_the_slow_misfit_within_the_whole_error():
    first = SimpleNamespace(rivals=[], scores=[])
    growth: Any = SimpleNamespace(rounds=[first])
    words = "a slow misfit of 0.57 K (means over 10 min, less what noise leaves in them) in an RMSE"
    assert f"leaves {words} of 1.31 K that no" in verdict(growth, [], LEFT, LEFT, []).sentence
    named: Any = SimpleNamespace(
        rival=SimpleNamespace(candidate=SimpleNamespace(id="radiation")), equivalents=[]
    )
    said = verdict(growth, [named], LEFT, LEFT, [])
    assert said.word == "unexplained"
    assert f"radiation helps, but {words} of 1.31 K is left" in said.sentence


def test_a_sampled_model_that_left_its_fit_is_told():
    said = sampled_apart(LEFT, 6.6)
    assert "RMSE of 6.60 K" in said
    assert "1.31 K of the fit" in said
    assert sampled_apart(LEFT, 1.4) == ""
