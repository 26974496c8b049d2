"""The field's exam on files of the public layout: profiles are split, and errors are counted."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import heatrun

RECORD = Path(__file__).parents[3] / "shared/bench/paderborn_profile24_heatrun_2p5s.csv.gz"
ROWS = {7: 90, 24: 100, 60: 90, 62: 80}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A file of numbers whose profiles do not stand in one piece, and what is in it."""
    from exam import COLUMNS

    rng = np.random.default_rng(1)
    ids = rng.permutation(np.repeat(list(ROWS), list(ROWS.values())))
    whole = pd.DataFrame({name: rng.uniform(20.0, 90.0, ids.size) for name in COLUMNS})
    path = tmp_path_factory.mktemp("exam") / "measures_v2.csv"
    whole.assign(profile_id=ids).to_csv(path, index=False)
    return path, whole.assign(profile_id=ids)


def test_profiles_are_split_by_their_id(made):
    from exam import profiles, training

    path, whole = made
    parts = profiles(path)
    assert {n: len(part) for n, part in parts.items()} == ROWS
    for number, part in parts.items():
        own = whole.loc[whole.profile_id == number, "stator_winding"]
        np.testing.assert_allclose(part["stator_winding"], own)
    assert training("all", parts, (60, 62)) == (7, 24)
    assert training("24", parts, (60, 62)) == (24,)
    assert set(training("few", parts, (60,))) == {7, 24, 62}


@pytest.mark.parametrize(
    ("wanted", "told"), [("60", "held out"), ("8", "no profile 8"), ("all,", "ids of profiles")]
)
def test_a_training_set_that_cannot_be_is_refused(made, wanted, told):
    from exam import profiles, training

    with pytest.raises(SystemExit, match=told):
        training(wanted, profiles(made[0]), (60, 62))


def test_another_layout_is_refused_and_no_file_is_no_failure(tmp_path, capsys):
    from exam import main, profiles

    main([str(tmp_path / "measures_v2.csv"), "--out", str(tmp_path / "out")])
    assert "nothing is done" in capsys.readouterr().out
    assert not (tmp_path / "out").exists()
    pd.DataFrame({"profile_id": [1], "pm": [20.0]}).to_csv(tmp_path / "x.csv", index=False)
    with pytest.raises(SystemExit, match="stator_winding"):
        profiles(tmp_path / "x.csv")


def test_a_profile_is_read_with_losses_current_and_clock(made, tmp_path):
    from exam import Bench, profiles

    from heatrun.readers.joined import read_test

    bench = Bench(tmp_path, profiles(made[0]))
    record = read_test(bench.test(60), heatrun.load_motor(bench.motor))
    part = made[1][made[1].profile_id == 60]
    terminals = 1.5 * (part.u_d * part.i_d + part.u_q * part.i_q)
    shaft = part.torque * part.motor_speed * 2.0 * np.pi / 60.0
    np.testing.assert_allclose(record["losses_W"], terminals - shaft, atol=1e-6)
    np.testing.assert_allclose(record["phase_current_A"] ** 2, 0.5 * (part.i_d**2 + part.i_q**2))
    np.testing.assert_allclose(record["winding_degC"], part.stator_winding)
    np.testing.assert_allclose(record["coolant_degC"], part.coolant)
    np.testing.assert_allclose(np.diff(record.time_s), 0.5)


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
