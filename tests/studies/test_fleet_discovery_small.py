"""The study of effects that a fleet shares, in small: a fleet through the command, and its page."""

import numpy as np
import pytest

from heatrun import cli
from heatrun_fleet.shared_effects.job import read_discovery

pytest.importorskip("pyarrow")

from fleet_discovery import cases, table
from fleet_of_hidden_causes import EFFECTS, TRUTH, amplitude_of, fleet, march, programme, write
from gate_rows import limits_95


def rows_of(hits):
    effect = {"id": "rotor_node", "equivalents": [], "is_beyond_instruments": True}
    return [
        {"kind": "clean", "name": "", "num": 40, "num_machines": 40, "num_alone": 2,
         "verdict": "named" if hit else "nothing_found", "effects": [effect] * hit}
        for hit in hits
    ]  # fmt: skip


def test_the_page_counts_false_finds_with_their_limits():
    (line,) = [each for each in table(rows_of([True, False, False, False])) if "fleets of" in each]
    assert line == "| fleets of 40 | 1 of 4 (1…81 %) | 1 of 4 (1…81 %) | 5 % |"
    assert limits_95(0, 60)[1] == pytest.approx(0.0596, abs=1e-4)


def test_a_study_that_is_stopped_has_a_part_of_each_kind():
    every = cases(12, 4, 1, 4, 4)
    assert len({each["seed"] for each in every}) == len(every) == 12 + 5 * 4 + 5 + 5 * 4 + 2 * 4
    half = every[: len(every) // 2]
    assert {each["name"] for each in half} >= set(EFFECTS)


def test_the_fleet_without_an_effect_keeps_the_balance_of_heat():
    """What is stored and what has left are what was lost, in the simulator itself."""
    centre = {name: np.array([value]) for name, value in TRUTH.items()}
    current, speed = programme(0)
    course = march(centre, current[:, None], speed, np.array([22.0]), "", np.zeros(1))
    winding, losses = course["winding"][:, 0], course["losses"][:, 0]
    heat = np.sum(0.5 * (losses[1:] + losses[:-1])) * 0.5
    copper = 3.0 * current**2 * 0.0062 * (234.5 + winding) / 259.5
    # the stator from the winding's own balance, then both together
    across = copper - TRUTH["Ceq_w"] * np.gradient(winding, 0.5)
    stator = winding - TRUTH["Req_w"] * across
    left = np.sum((stator - 22.0) / TRUTH["Req_sr"]) * 0.5
    kept = TRUTH["Ceq_w"] * (winding[-1] - 22.0) + TRUTH["Ceq_sr"] * (stator[-2] - 22.0)
    assert left + kept == pytest.approx(heat, rel=2e-3)


def test_an_effect_in_all_machines_is_named_by_the_command(tmp_path, capsys):
    amplitude = amplitude_of("natural_convection", 0.25)
    drawn = fleet(12, 129_500, "natural_convection", amplitude)
    path = write(drawn, tmp_path / "bench")
    words = ["fleet", str(path), "--discover", "--workers", "0", "--out", str(tmp_path / "out")]
    assert cli.main(words) == 0
    (found,) = read_discovery(tmp_path / "out").types
    assert found.num_machines == 12
    names = {found.effects[0].id, *found.effects[0].equivalents}
    assert "natural_convection" in names
    assert 0.1 < found.effects[0].visible_K.value < 0.5
    assert "Type A: The 12 machines share" in capsys.readouterr().out
