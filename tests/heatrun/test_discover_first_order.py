"""Discovery from one node, on the discrepancy of the thesis: the winding runs ahead of the body."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from heatrun.calibration import load_tests
from heatrun.cli import main
from heatrun.discovery.run import discover
from heatrun.motorfile import load_motor
from lptn import EFFECTS

DATA = Path(__file__).parents[2] / "data" / "synthetic"
DUTY, STEP = DATA / "duty_30min.csv.gz", DATA / "step_90min.csv.gz"

X, TAU = 0.14485 / 0.11625, 0.14485 * 666.75 * 15060.1 / (666.75 + 15060.1)
"""The reference machine's: resistances in a row, and how fast two bodies even out [s]."""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    run = tmp_path_factory.mktemp("first") / "run"
    code = main([
        "discover", str(DATA / "motor.toml"), str(DUTY), "--holdout", str(STEP),
        "--model", "first", "--quick", "--out", str(run),
    ])  # fmt: skip
    assert code == 0
    return json.loads((run / "discovery.json").read_text(encoding="utf-8"))


def test_the_second_order_is_what_the_first_misses(written):
    assert written["verdict"] == "named"
    (found,) = written["effects"]
    assert found["id"] == "winding_node"
    for name, true in (("x", X), ("tau", TAU)):
        value, (low, high) = (found["parameters"][name][key] for key in ("value", "interval_95"))
        # instruments and a reading in whole degrees: a few per cent, and three times the interval
        assert value == pytest.approx(true, rel=0.05)
        assert abs(value - true) < 1.5 * (high - low)


def test_the_held_out_test_is_predicted_better(written):
    gap = written["holdout"]
    assert gap["rmse_before_K"] > 10.0
    assert gap["rmse_after_K"] < 2.0  # what a two-node network is expected to reach
    assert gap["coverage_95_after"] > 0.85


def test_the_result_says_that_held_out_tests_took_part_in_the_selection(written):
    assert written["holdout"]["took_part_in_selection"] is True
    assert "no independent proof" in written["holdout"]["sentence"]
    (row,) = [row for row in written["candidates"] if row["id"] == "winding_node"]
    (errors,) = row["held_out"]
    assert errors["rmse_with_K"] < 2.0 < errors["rmse_without_K"]


@pytest.fixture(scope="module")
def without_the_effect():
    """The catalogue as it was: some other law has to stand in."""
    motor = load_motor(DATA / "motor.toml")
    tests = load_tests(motor, [DUTY], [STEP])
    fitted, held_out = ([t.blocks for t in tests if t.role == role] for role in
                        ("calibration", "holdout"))  # fmt: skip
    kinds = [kind for kind in EFFECTS if kind.card.id != "winding_node"]

    def found(tests_held_out):
        return discover(motor, fitted, order="first", kinds=kinds, held_out=tests_held_out)

    return found, held_out


@pytest.mark.slow
def test_an_effect_that_worsens_a_held_out_test_is_not_added(without_the_effect):
    found, held_out = without_the_effect
    blind, seeing = found([]), found(held_out)
    assert [each.rival.candidate.id for each in blind.named] == ["cooling_step"]
    assert not [each for each in seeing.named if each.rival.candidate.id == "cooling_step"]
    (fallen,) = [
        rival for rival in seeing.growth.rounds[0].rivals if rival.candidate.id == "cooling_step"
    ]
    assert fallen.reason.startswith("it predicts the held-out test worse: ")
    ((without, with_it),) = fallen.held_out_K
    assert with_it > 1.5 * without
    assert seeing.verdict.word == "unexplained"
