"""The field's exam on files of the public layout: profiles are split, and errors are counted."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import heatrun

sys.path.insert(0, str(Path(__file__).parent))

RECORD = Path(__file__).parents[3] / "shared/bench/paderborn_profile24_heatrun_2p5s.csv.gz"
IDS = {7: 0.5, 24: 0.6, 60: 0.5, 62: 0.4}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A file of a simulated machine whose profiles do not stand in one piece."""
    from exam_machine import machine_file

    path = tmp_path_factory.mktemp("exam") / "measures_v2.csv"
    whole = machine_file(IDS)
    # the public file is grouped, but nothing says that it must be
    mixed = pd.concat([whole[whole.profile_id == n] for n in (62, 24, 7, 60)])
    mixed.to_csv(path, index=False)
    return path, whole


def test_profiles_are_split_by_their_id(simulated):
    from exam import profiles, training

    path, whole = simulated
    parts = profiles(path)
    assert {n: len(part) for n, part in parts.items()} == {
        n: round(hours * 7200) for n, hours in IDS.items()
    }
    for number, part in parts.items():
        own = whole.loc[whole.profile_id == number, "stator_winding"]
        np.testing.assert_allclose(part["stator_winding"], own)
    assert training("all", parts, (60, 62)) == (7, 24)
    assert training("24", parts, (60, 62)) == (24,)
    assert set(training("few", parts, (60,))) == {7, 24, 62}


@pytest.mark.parametrize(
    ("wanted", "told"),
    [("60", "held out"), ("8", "no profile 8"), ("all,", "ids of profiles")],
)
def test_a_training_set_that_cannot_be_is_refused(simulated, wanted, told):
    from exam import profiles, training

    with pytest.raises(SystemExit, match=told):
        training(wanted, profiles(simulated[0]), (60, 62))


def test_another_layout_is_refused_and_no_file_is_no_failure(tmp_path, capsys):
    from exam import main, profiles

    main([str(tmp_path / "measures_v2.csv"), "--out", str(tmp_path / "out")])
    assert "nothing is done" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()
    pd.DataFrame({"profile_id": [1], "pm": [20.0]}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(SystemExit, match="stator_winding"):
        profiles(tmp_path / "x.csv")


def test_a_profile_is_read_with_losses_current_and_clock(simulated, tmp_path):
    from exam import Bench, profiles

    from heatrun.readers.joined import read_test

    bench = Bench(tmp_path, profiles(simulated[0]))
    record = read_test(bench.test(60), heatrun.load_motor(bench.motor))
    part = simulated[1][simulated[1].profile_id == 60]
    terminals = 1.5 * (part.u_d * part.i_d + part.u_q * part.i_q)
    shaft = part.torque * part.motor_speed * 2.0 * np.pi / 60.0
    np.testing.assert_allclose(record["losses_W"], terminals - shaft, atol=1e-6)
    np.testing.assert_allclose(record["phase_current_A"] ** 2, 0.5 * (part.i_d**2 + part.i_q**2))
    np.testing.assert_allclose(record["winding_degC"], part.stator_winding)
    np.testing.assert_allclose(record["coolant_degC"], part.coolant)
    np.testing.assert_allclose(np.diff(record.time_s), 0.5)
    assert not bench.refusal(60)


def test_errors_by_hand():
    from exam import errors

    mse, largest = errors(np.array([20.0, 21.0, 25.0]), np.array([20.0, 23.0, 24.0]))
    assert mse == pytest.approx((0.0 + 4.0 + 1.0) / 3.0)
    assert largest == 2.0


def test_a_row_names_what_it_shows():
    from exam import Outcome, Score, table

    scores = (Score(60, 4.8, 9.0, 0.94), Score(62, 1.2, 3.0, 0.5))
    text = table([Outcome((24,), {3: "no load"}, "four", scores, 60.0, 50.0)])
    assert "| 24 | four | 4.8 (94 %, 9.0 K) | 1.2 (50 %, 3.0 K) | 3 | 60 s | 50 s |" in text
    assert "- profile 3: no load." in text
    refused = table([Outcome((), {3: "no load"}, "four", (), 1.0, 1.0, "every profile is refused")])
    assert "| – | four | refused: every profile is refused |" in refused


@pytest.mark.slow
def test_the_exam_on_a_simulated_machine(simulated, tmp_path):
    """The errors are those of the courses in the run folder, counted anew from the readings."""
    from exam import Bench, examined, profiles

    bench = Bench(tmp_path, profiles(simulated[0]))
    (tmp_path / "run").mkdir()
    outcome = examined(bench, (24,), (60, 62), "second", out=tmp_path / "run" / "exam")
    assert not outcome.refused
    run = heatrun.open_run(tmp_path / "run" / "exam")
    for score, course in zip(outcome.scores, run.courses()[1:], strict=True):
        winding = bench.parts[score.profile]["stator_winding"].to_numpy()
        length_s = 0.5 * np.round(np.median(np.diff(course["time_s"])) / 0.5)
        # a sample belongs to the block that it ends
        block = np.maximum(np.ceil(np.arange(winding.size) * 0.5 / length_s).astype(int) - 1, 0)
        means = np.bincount(block, winding) / np.bincount(block)
        predicted = course["second_winding_degC"].to_numpy()
        of_blocks = np.mean((means - predicted) ** 2)
        # beside the error of block means the samples have that of the sensor, 0.05 K
        assert score.mse_K2 == pytest.approx(of_blocks + 0.05**2, rel=0.1)
        low = course["second_total_95_low_degC"]
        high = course["second_total_95_high_degC"]
        # a mean that a sample at the edge of its block moves may lie on the other side of a limit
        seen = course["measured_degC"]
        np.testing.assert_allclose(means, seen, atol=0.2)
        assert score.coverage_95 == pytest.approx(np.mean((seen >= low) & (seen <= high)))
        assert score.mse_K2 < 9.0, "four bodies are not two, but no worse than 3 K"


@pytest.mark.slow
@pytest.mark.skipif(not RECORD.exists(), reason="the record is not part of the project")
def test_the_exam_on_a_file_made_of_a_real_profile(tmp_path):
    """Profile 24, brought to 2 Hz: whole as 24, its cooling as 60. No exam, since 60 is of 24."""
    from exam import main

    record = pd.read_csv(RECORD)
    time_s = np.arange(0.0, record.time_s.iloc[-1], 0.5)
    names = {
        "u_q_V": "u_q", "coolant_degC": "coolant", "stator_winding_degC": "stator_winding",
        "u_d_V": "u_d", "stator_tooth_degC": "stator_tooth", "speed_rpm": "motor_speed",
        "i_d_A": "i_d", "i_q_A": "i_q", "pm_degC": "pm", "stator_yoke_degC": "stator_yoke",
        "ambient_degC": "ambient", "torque_Nm": "torque",
    }  # fmt: skip
    whole = pd.DataFrame(
        {new: np.interp(time_s, record.time_s, record[old]) for old, new in names.items()}
    )
    cooling = whole[time_s >= 4400.0]
    file = pd.concat([whole.assign(profile_id=24), cooling.assign(profile_id=60)])
    file.to_csv(tmp_path / "measures_v2.csv", index=False)
    out = tmp_path / "out"
    main([str(tmp_path / "measures_v2.csv"), "--train", "24", "--test", "60", "--networks",
          "second", "--out", str(out)])  # fmt: skip
    text = (out / "exam.md").read_text()
    (row,) = [line for line in text.splitlines() if line.startswith("| 24 | second |")]
    mse = float(row.split("|")[3].split("(")[0])
    assert 0.05 < mse < 25.0, "a part of what was fitted, by a network of two nodes"
