"""Discovery from one node, on the discrepancy of the thesis: the winding runs ahead of the body."""

import json
from pathlib import Path

import pytest

from heatrun.cli import main

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


def test_the_held_out_test_took_no_part_in_the_selection(written):
    assert written["holdout"]["took_part_in_selection"] is False
