"""`heatrun check` of a test that cannot be read yet: every column, every lack, what comes next."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mdf_files import signal, written

from heatrun import cli

MOTOR = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.0062\n'
ROWS = [f"{100 + i % 7},{300 + i % 11},20.1,{20 + 0.1 * i:.1f},{i % 2}" for i in range(60)]
HEAD = "Is [A],Pd [W],Te [degC],T_Mot [degC],Pump [bar]"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("motor.toml").write_text(MOTOR)
    return tmp_path


def said(capsys, *words: str) -> tuple[int, str]:
    capsys.readouterr()
    code = cli.main(["check", "motor.toml", *words])
    return code, capsys.readouterr().out


def without_times(path: Path) -> None:
    path.write_text("\n".join([HEAD, *ROWS]))


def of_strange_names(path: Path) -> None:
    times = np.arange(0.0, 60.0, 0.5)
    written(path, ("Logger", [signal("T_Mot", 20.0 + times, times, "°C"),
                              signal("Pump", 0.0 * times, times, "bar")]))  # fmt: skip


def test_a_measurement_of_unknown_names_lists_them_and_says_what_comes_next(here, capsys):
    of_strange_names(here / "rec.mf4")
    code, out = said(capsys, "rec.mf4")
    assert code == 1
    assert "No channel claims, in rec: T_Mot, Pump" in out
    assert "No channel of the file is known" in out
    assert "it has no losses_W, ambient_degC, winding_degC." in out
    assert out.endswith(
        "Next: name the missing channels in motor.toml (heatrun init rec.mf4 --out draft.toml "
        "proposes), then: heatrun check motor.toml rec.mf4\n"
    )


def test_a_text_without_times_shows_what_was_read_and_what_was_not(here, capsys):
    without_times(here / "log.csv")
    code, out = said(capsys, "log.csv", "-v")
    assert code == 1
    assert "No channel claims, in log: T_Mot [degC], Pump [bar]" in out
    rows = {line.split()[0]: line.split()[1] for line in out.splitlines() if line.startswith("  ")}
    assert rows["phase_current_A"] == "Is"
    assert 'time_s = "rate 10 Hz"' in out
    assert "it has no time_s, winding_degC." in out
    assert out.splitlines()[-1].startswith("Next: name the missing channels in motor.toml")


def test_what_the_motor_file_names_is_claimed_and_other_tests_are_checked(here, capsys):
    without_times(here / "log.csv")
    (here / "good.csv").write_text(
        "\n".join([f"t [s],{HEAD}", *(f"{i},{row}" for i, row in enumerate(ROWS))])
    )
    (here / "motor.toml").write_text(MOTOR + '[columns]\nwinding_degC = "T_Mot"\n')
    code, out = said(capsys, "log.csv", "good.csv", "--json")
    assert code == 1
    content = json.loads(out)
    assert {"findings", "tests", "unclaimed", "suitability", "next"} == set(content)
    assert content["unclaimed"] == {"log": ["Pump [bar]"], "good": ["Pump [bar]"]}
    (unread,) = [one for one in content["findings"] if one["id"] == "not_read"]
    assert (unread["test"], unread["severity"]) == ("log", "error")
    assert "no time column" in unread["message"]
    assert content["suitability"][0]["sentence"].endswith("it has no time_s.")
    assert "heatrun check motor.toml log.csv good.csv" in content["next"]


def test_a_wrong_line_of_columns_is_said_beside_the_columns_that_are_free(here, capsys):
    without_times(here / "log.csv")
    columns = '[columns]\nwinding_degC = "T_Mto"\ntime_s = "rate 1 Hz"\nlosses_W = "Pd [degC]"\n'
    (here / "motor.toml").write_text(MOTOR + columns)
    code, out = said(capsys, "log.csv")
    assert code == 1
    assert "No channel claims, in log: Pd [W], T_Mot [degC], Pump [bar]" in out
    assert "'T_Mto' for winding_degC" in out
    assert "Did you mean" in out
    assert "column 'Pd [W]' as losses_W" in out  # the second fault, said at once
    assert "Next: " in out.splitlines()[-1]


def test_what_is_no_table_stays_an_error(here, capsys):
    (here / "notes.csv").write_text("nothing of use\n")
    assert said(capsys, "notes.csv") == (1, "")
    assert cli.main(["check", "motor.toml", "none.csv"]) == 1
    assert "none.csv" in capsys.readouterr().err
