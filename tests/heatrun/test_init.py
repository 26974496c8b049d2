"""`heatrun init`: from a file that nobody has described to a motor file that reads it."""

import gzip
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import given
from hypothesis import strategies as st
from mdf_files import signal, written

from heatrun import cli
from heatrun.errors import InputError
from heatrun.init.draft import draft
from heatrun.init.free_columns import FreeColumn, Proposal
from heatrun.init.survey import Survey, survey
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.joined import read_test
from heatrun.readers.likely_names import LIKELY

DATA = Path(__file__).parents[2] / "data"
DUTY = DATA / "synthetic" / "duty_90min.csv.gz"


@pytest.fixture(scope="module")
def table():
    """The bundled duty at 1 Hz."""
    with gzip.open(DUTY, "rt") as file:
        return pd.read_csv(file).iloc[::10].reset_index(drop=True)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def init(*words: str) -> int:
    return cli.main(["init", *words])


def uncommented(text: str, *keys: str) -> str:
    """Remove the # in front of the first line of each key, as a person would."""
    for key in keys:
        text, count = re.subn(rf"^# ({key} = )", r"\1", text, count=1, flags=re.MULTILINE)
        assert count == 1, f"{key} has no line"
    return text


def with_resistance(text: str) -> str:
    """Put in the resistance of the reference motor, as a person would."""
    line = "# phase_resistance_ohm =    # put in the number, such as 0.0062"
    assert line in text
    return text.replace(line, "phase_resistance_ohm = 0.0062")


GERMAN = {
    "t": "Zeit [s]",
    "Is": "I_Mot [A]",
    "Pd": "P_V [kW]",
    "Te": "T_a [°C]",
    "Tw_m": "Temp_Mot [°C]",
}


def german(table: pd.DataFrame, path: Path) -> Path:
    """A text export with names that may mean more than one thing, but for the time."""
    renamed = table.assign(Pd=table["Pd"] / 1000.0)[list(GERMAN)].rename(columns=GERMAN)
    renamed["Pumpe"] = 1
    renamed.to_csv(path, sep=";", decimal=",", index=False, encoding="utf-8")
    return path


def test_recognised_columns_need_no_line(here, table, capsys):
    table.to_csv(here / "duty.csv", index=False)
    assert init("duty.csv") == 0
    assert load_motor("motor.toml").columns == {}
    assert load_motor("motor.toml").name == "duty"
    assert (
        "Next: edit motor.toml, then heatrun check motor.toml duty.csv" in capsys.readouterr().out
    )
    assert cli.main(["check", "motor.toml", "duty.csv"]) == 0
    said = capsys.readouterr().out
    assert "once the motor file is complete: the phase resistance is not given" in said


def test_foreign_names_become_lines_to_uncomment(here, table, capsys):
    german(table, here / "prüfstand.csv")
    assert init("prüfstand.csv") == 0
    load_motor("motor.toml")
    text = Path("motor.toml").read_text(encoding="utf-8")
    needed = ("phase_current_A", "losses_W", "ambient_degC", "winding_degC")
    Path("motor.toml").write_text(with_resistance(uncommented(text, *needed)), "utf-8")
    motor = load_motor("motor.toml")
    assert motor.columns == {
        "phase_current_A": "I_Mot [A]",
        "losses_W": "P_V [kW]",
        "ambient_degC": "T_a [°C]",
        "winding_degC": "Temp_Mot [°C]",
    }
    capsys.readouterr()
    assert cli.main(["check", "motor.toml", "prüfstand.csv"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("This record will do for a second-order calibration")
    assert said.endswith("Next: heatrun calibrate motor.toml 'prüfstand.csv'\n")
    record = read_test("prüfstand.csv", motor)
    np.testing.assert_allclose(record["losses_W"], table["Pd"], rtol=1e-12)


def test_an_example_is_never_taken_for_a_number_that_is_missing(here, table):
    table[["t", "Is", "Pd", "Tw_m"]].to_csv(here / "test.csv", index=False)
    assert init("test.csv") == 0
    text = Path("motor.toml").read_text(encoding="utf-8")
    for key in ("phase_resistance_ohm", "ambient_degC"):
        Path("motor.toml").write_text(uncommented(text, key), encoding="utf-8")
        with pytest.raises(InputError, match="no valid TOML"):
            load_motor("motor.toml")


def test_what_lacks_a_unit_is_proposed_by_its_name_and_says_so(here, table):
    names = {"t": "time", "Is": "Iph", "Pd": "losses total", "Te": "room", "Tw_m": "coil temp"}
    table[list(names)].rename(columns=names).to_csv(here / "plain.csv", index=False)
    assert init("plain.csv") == 0
    lines = Path("motor.toml").read_text(encoding="utf-8").split("\n")
    (line,) = [one for one in lines if one.startswith("# winding_degC = ")]
    assert line.startswith('# winding_degC = "coil temp"  # ')
    assert "no unit given; read in degC: check the unit" in line
    assert any(one.startswith('# ambient_degC = "room"') for one in lines)


def test_a_file_of_this_name_is_left_alone(here, table, capsys):
    table.to_csv(here / "duty.csv", index=False)
    Path("motor.toml").write_text("precious")
    assert init("duty.csv") == 1
    assert Path("motor.toml").read_text() == "precious"
    assert "--force" in capsys.readouterr().err
    assert init("duty.csv", "--out", "other.toml") == 0
    assert init("duty.csv", "--force") == 0
    assert load_motor("motor.toml").name == "duty"
    before = (here / "duty.csv").read_bytes()
    assert init("duty.csv", "--out", "duty.csv", "--force") == 1
    assert (here / "duty.csv").read_bytes() == before


def test_a_link_to_nowhere_is_a_file_of_this_name(here, table):
    table.to_csv(here / "duty.csv", index=False)
    Path("motor.toml").symlink_to(here / "gone.toml")
    assert init("duty.csv") == 1
    assert not (here / "gone.toml").exists()


def test_a_file_that_is_no_table_leaves_nothing(here, capsys):
    (here / "notes.csv").write_text("nothing of use\n")
    assert init("notes.csv") == 1
    assert not Path("motor.toml").exists()
    assert "Traceback" not in capsys.readouterr().err


def test_json_is_one_object(here, table, capsys):
    german(table, here / "test.csv")
    assert init("test.csv", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["motor_file"] == "motor.toml"
    assert said["next"] == "heatrun check motor.toml test.csv"
    missing = {gap["channel"]: gap for gap in said["missing"] if gap["channel"]}
    assert missing["winding_degC"]["candidates"][0][0] == "Temp_Mot [°C]"
    (test,) = said["tests"]
    assert "time_s" in [one["channel"] for one in test["recognised"]]
    (motor,) = [column for column in test["free"] if column["name"] == "Temp_Mot [°C]"]
    assert motor["low"] == pytest.approx(table["Tw_m"].min())
    assert motor["high"] == pytest.approx(table["Tw_m"].max())


def test_two_loggers_are_looked_at_together(here, table, capsys):
    table[["t", "Te", "Tw_m"]].to_csv(here / "temps.csv", index=False)
    table[["Is", "Pd"]].to_csv(here / "drive.csv", index=False)
    assert init("temps.csv+drive.csv@1Hz", "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert [one["path"] for one in said["tests"]] == ["temps.csv", "drive.csv"]
    assert said["next"] == "heatrun check motor.toml temps.csv+drive.csv@1Hz"


def test_scalars_of_prova_mat_become_the_resistance(here, table):
    columns = {name: table[name].to_numpy() for name in ("t", "Is", "Pd", "Te", "Tw_m")}
    scipy.io.savemat(here / "prova.mat", {**columns, "Rrif": 0.0186, "Trif": 20.0})
    assert init("prova.mat") == 0
    motor = load_motor("motor.toml")
    assert motor.phase_resistance_ohm == pytest.approx(0.0062, rel=1e-9)
    assert motor.reference_temperature_degC == 20.0


def test_two_columns_for_one_channel_are_a_question_with_both(here, table):
    table["T_w"] = table["Tw_m"] + 1.0
    names = {"Tw_m": "winding [°C]", "T_w": "winding [K]"}
    table.rename(columns=names).to_csv(here / "both.csv", index=False)
    found = survey(here / "both.csv")
    assert len(found.questions) == 1
    assert "both stand for winding_degC" in found.questions[0]
    free = {column.name: column for column in found.free}
    assert {"winding [°C]", "winding [K]"} <= free.keys()
    assert free["winding [K]"].proposals[0].channel == "winding_degC"


def test_the_mean_of_the_room_in_a_title_row_is_offered(here, table):
    rows = table[["t", "Is", "Pd", "Tw_m"]].to_csv(index=False, sep=";", decimal=",")
    (here / "head.csv").write_text(f"Tamb med;19,36\n{rows}")
    assert init("head.csv") == 0
    text = Path("motor.toml").read_text()
    constants = text[text.index("\n[constants]\n") :]
    Path("motor.toml").write_text(text.replace(constants, uncommented(constants, "ambient_degC")))
    assert load_motor("motor.toml").constants == {"ambient_degC": 19.36}
    assert cli.main(["check", "motor.toml", "head.csv"]) == 0


PRINTED = DATA / "thesis" / "worksheet.csv"


def test_the_worksheet_of_the_thesis_is_recognised_as_printed():
    found = survey(PRINTED)
    assert {one.channel: one.column for one in found.recognised} == {
        "time_s": "t [s]",
        "phase_current_A": "Is [A]",
        "losses_W": "P [W]",
        "winding_degC": "Tw [degC]",
    }
    made = draft("m", [found])
    text = made.split("\n[constants]\n")[1].split("\n[sensors]\n")[0]
    assert tomllib.loads(uncommented(text, "ambient_degC"))["ambient_degC"] == 19.35772099


def test_few_of_the_worksheets_names_are_not_taken_for_it(tmp_path, table):
    names = {"Is": "Is", "Pd": "P", "Tw_m": "Tw"}
    table[["t", *names]].rename(columns=names).to_csv(tmp_path / "short.csv", index=False)
    assert {one.channel for one in survey(tmp_path / "short.csv").recognised} == {"time_s"}


def test_of_many_recognised_columns_none_is_cut(tmp_path):
    heads = "Zeit [s];Wicklungstemperatur [°C];Gehäuse [°C];Raumtemperatur [°C];Strangstrom [A];"
    heads = f"{heads}Wirkleistung [kW];Drehmoment [Nm];Drehzahl [1/min]".split(";")
    path = tmp_path / "lang.csv"
    rows = [";".join(f"{k + i}" for i in range(len(heads))) for k in range(50)]
    path.write_text("\n".join([";".join(heads), *rows]))
    (line,) = (x for x in draft("m", [survey(path)]).splitlines() if "Recognised" in x)
    assert "…" not in line
    assert line.endswith(", and 6 more")  # with the losses that follow
    assert len(line) <= 160


def test_a_file_name_with_control_characters_leaves_a_draft_that_loads():
    column = FreeColumn("R", "Ω", 0.1, 0.2, 100)
    made = draft("motor", [Survey("a\x1fb.csv", "text", (), {}, (column,))])
    assert "a\\x1fb.csv" in made
    parse_motor(made.encode(), "motor.toml")


NAMES = st.text(st.characters(codec="utf-8"), min_size=1, max_size=60)


@given(name=NAMES, text=NAMES, unit=NAMES, question=NAMES)
def test_any_name_out_of_a_file_leaves_a_file_that_loads(name, text, unit, question):
    proposal = Proposal("winding_degC", name, "stated", LIKELY)
    free = (
        FreeColumn(name, unit, 20.0, 90.0, 100, proposals=(proposal,)),
        FreeColumn(text, None, None, None, 0, text=text),
        FreeColumn(f"{name} amb", "degC", 21.0, 21.0, 1),
    )
    one = Survey(f"{name}.csv", "text", (), {}, free, (question,), {}, (f"amb {text} 21,5",))
    made = draft(name, [one])
    parse_motor(made.encode(), "motor.toml")
    if name.strip():
        columns = made.split("\n[columns]\n")[1].split("\n[constants]\n")[0]
        line = uncommented(columns, "winding_degC").split("\n")
        (said,) = [each for each in line if each.startswith("winding_degC")]
        assert tomllib.loads(said)["winding_degC"] == name


def test_a_file_without_a_name_drafts_a_motor_that_has_one():
    one = Survey(" .csv", "text", (), {}, (), (), {}, ())
    assert parse_motor(draft(" ", [one]).encode(), "motor.toml").name == "motor"


def test_channels_of_a_measurement_file_are_proposed(here):
    time = np.arange(0.0, 60.0, 0.5)
    logged = [signal("T_Mot", 20.0 + time, time, "°C"), signal("Pump", 0.0 * time, time, "bar")]
    written(here / "bench.mf4", ("Logger", logged))
    found = survey(here / "bench.mf4")
    free = {column.name: column for column in found.free}
    assert (free["T_Mot"].low, free["T_Mot"].high) == (20.0, 79.5)
    assert free["T_Mot"].proposals[0] == Proposal("winding_degC", "T_Mot", "stated", LIKELY, "degC")
    assert free["Pump"].proposals == ()
    assert {one.channel for one in found.recognised} == {"time_s"}


def test_a_pipe_is_looked_at_once(here, table):
    text = table.to_csv(index=False).encode()
    command = [sys.executable, "-m", "heatrun.cli", "init", "/dev/stdin", "--json"]
    done = subprocess.run(command, input=text, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    assert len(json.loads(done.stdout)["tests"][0]["recognised"]) == 6
    load_motor("motor.toml")


def test_the_version_is_printed(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(["--version"])
    assert end.value.code == 0
    assert re.fullmatch(r"heatrun \d+\.\d+\.\d+\n", capsys.readouterr().out)
