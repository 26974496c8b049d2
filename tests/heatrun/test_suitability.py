"""Whether a record will do, and what comes next; also of a test that cannot be read yet."""

import gzip
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mdf_files import signal, written

from heatrun import cli
from heatrun.checks.suitability import as_holdout, suitability
from heatrun.errors import InputError
from heatrun.readers.read import read_record
from heatrun.record.channels import REQUIRED
from heatrun.record.motor import Motor
from heatrun.record.record import Finding
from heatrun.record.samples import require

DATA = Path(__file__).parents[2] / "data" / "synthetic"
AIM = "a second-order calibration"


def finding(id: str, severity: str, where: str = "t", message: str = "Too hot.") -> Finding:
    return Finding(id, severity, message, where)


def warned(*ids: str) -> list[Finding]:
    return [finding(id, "warning") for id in ids]


DO, DO_NOT = f"This record will do for {AIM}", f"This record will not do for {AIM}: "
SHORT = f"{DO}, with wide intervals: it is too short for the slow time constant"
TAUS = {"tau_fast_s": 36.79, "tau_slow_s": 1037.7}
ANSWERS = {
    "nothing found": ([], f"{DO}."),
    "a note": ([finding("sampling", "note")], f"{DO}."),
    "a note on its length": ([finding("too_short", "note")], f"{DO}."),
    "short, one step": (
        warned("too_short", "single_step"), f"{SHORT} and it holds a single load step."),
    "short, with a warning": (
        warned("too_short", "nan_block"), f"{SHORT}; read the warnings first (nan_block)."),
    "a cool-down": (
        [Finding("no_heating", "warning", "Falls.", "t", values=TAUS)],
        "This record gives time constants only: 36.8 s and 1040 s. Heat capacities and "
        "resistances need a test under load beside it."),
    "nothing of the slow constant": (
        [Finding("too_short", "warning", "Short.", "t",
                 values={"fast_from_s": 31.63, "fast_to_s": 140.3})],
        "This record tells the fast time constant of the winding alone (31.6 to 140 s) and leaves "
        "the slow one open: Ceq_sr and Req_sr need a longer test beside it."),
    "a unit in doubt": (
        warned("unit_suspected", "nan_block"),
        "To be cleared up first: a column may be in another unit (unit_suspected). Then this "
        f"record will do for {AIM}, read the warnings first (nan_block)."),
    "simulated": (
        warned("simulated_by_heatrun"),
        f"{DO_NOT}it was simulated by heatrun, not measured (simulated_by_heatrun)."),
    "no losses": (
        [finding("missing_channel", "error", "t, losses_W"), finding("kelvin", "error")],
        f"{DO_NOT}it has no losses_W."),
    "two errors": (
        [finding("sensor_stuck", "error"), finding("kelvin", "error", message="Cold.")],
        f"{DO_NOT}Too hot. (sensor_stuck) And 1 more."),
}  # fmt: skip


@pytest.mark.parametrize("case", ANSWERS)
def test_the_answer_follows_from_the_findings(case):
    findings, sentence = ANSWERS[case]
    answer = suitability("t", findings, AIM)
    assert (answer.will_do, answer.sentence) == (not sentence.startswith(DO_NOT), sentence)


NEXT = {
    "simulated_by_heatrun": "name tests that were measured, then: heatrun check ",
    "current_amplitude": "clear up the warnings named above, then: heatrun calibrate ",
    "ambient_moving": "heatrun calibrate ",
}


@pytest.mark.parametrize(("id", "next_step"), NEXT.items())
def test_what_is_in_doubt_comes_before_a_calibration(here, capsys, monkeypatch, id, next_step):
    doubt = finding(id, "warning")
    monkeypatch.setattr("heatrun.checks.check_record", lambda record, motor: (doubt,))
    _, out = said(capsys, "duty.csv")
    assert next_step in out.splitlines()[-1]


def test_what_the_network_lacks_is_said_and_no_error():
    lacking = finding("model_refused", "error", message="This test cannot be used: no Rs0.")
    answer = suitability("t", [], AIM, lacking)
    assert not answer.will_do
    assert answer.sentence.endswith("once the motor file is complete: no Rs0.")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motor.toml").write_text((DATA / "motor.toml").read_text())
    with gzip.open(DATA / "duty_90min.csv.gz", "rt") as file:
        table = pd.read_csv(file).iloc[::10]
    table["spare"] = 1
    table["door\n"] = "open"
    table.to_csv("duty.csv", index=False)
    table.drop(columns="Pd").to_csv("no losses.csv", index=False)
    return tmp_path


def said(capsys, *words: str) -> tuple[int, str]:
    capsys.readouterr()
    code = cli.main(["check", "motor.toml", *words])
    return code, capsys.readouterr().out


def test_a_good_record_ends_with_the_command_that_calibrates_it(here, capsys):
    code, out = said(capsys, "duty.csv", "--model", "first")
    assert code == 0
    lines = out.splitlines()
    assert lines[0] == "This record will do for a first-order calibration."
    assert lines[-1] == "Next: heatrun calibrate motor.toml duty.csv --model first"
    assert not any(line.startswith("note") for line in lines)
    assert "notes" in lines[-2]
    code, whole = said(capsys, "duty.csv", "--model", "first", "-v")
    assert "No channel claims, in duty: spare, door" in whole
    assert (whole.splitlines()[0], whole.splitlines()[-1]) == (lines[0], lines[-1])
    assert any(line.startswith("note ") for line in whole.splitlines())


def test_a_record_that_lacks_a_channel_says_so_for_itself(here, capsys):
    code, out = said(capsys, "duty.csv", "no losses.csv")
    assert code == 1
    assert "duty: This record will do for a second-order calibration." in out
    assert "no losses: This record will not do for a second-order calibration: it has no " in out
    assert "No channel claims, in no losses: spare, door" in out  # one of them may be what lacks
    assert "claims, in duty" not in out
    assert out.rstrip("\n").endswith("then: heatrun check motor.toml duty.csv 'no losses.csv'")


def test_tests_of_which_the_same_is_said_share_a_line(here, capsys):
    shutil.copy("duty.csv", "again.csv")
    _, out = said(capsys, "duty.csv", "again.csv")
    assert out.startswith("duty, again: This record will do for a second-order calibration")


def test_the_same_stands_in_the_json(here, capsys):
    code, out = said(capsys, "duty.csv", "--json")
    assert code == 0
    content = json.loads(out)
    assert content["unclaimed"]["duty"][0] == "spare"
    assert content["suitability"][0]["will_do"] is True
    assert content["next"] == "heatrun calibrate motor.toml duty.csv"


def test_a_motor_file_for_another_network_is_said_to_be_one(here, capsys):
    text = Path("motor.toml").read_text() + "\n[parameters.Ceq_tooth]\nfixed = 100.0\n"
    Path("motor.toml").write_text(text)
    code, out = said(capsys, "duty.csv")
    assert code == 0
    assert "will not do for a second-order calibration once" not in out
    assert "Ceq_tooth" in out.splitlines()[0]
    assert out.rstrip("\n").endswith("Then: heatrun check motor.toml duty.csv")


MOTOR = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.0062\n'
ROWS = [f"{100 + i % 7},{300 + i % 11},20.1,{20 + 0.1 * i:.1f},{i % 2}" for i in range(60)]
HEAD = "Is [A],Pd [W],Te [degC],T_Mot [degC],Pump [bar]"


@pytest.fixture
def at_hand(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("motor.toml").write_text(MOTOR)
    return tmp_path


def without_times(path: Path) -> None:
    path.write_text("\n".join([HEAD, *ROWS]))


def of_strange_names(path: Path) -> None:
    times = np.arange(0.0, 60.0, 0.5)
    written(path, ("Logger", [signal("T_Mot", 20.0 + times, times, "°C"),
                              signal("Pump", 0.0 * times, times, "bar")]))  # fmt: skip


def test_a_measurement_of_unknown_names_lists_them_and_says_what_comes_next(at_hand, capsys):
    of_strange_names(at_hand / "rec.mf4")
    code, out = said(capsys, "rec.mf4")
    assert code == 1
    assert "No channel claims, in rec: T_Mot, Pump" in out
    assert "No channel of the file is known" in out
    assert "it has no losses_W, ambient_degC, winding_degC." in out
    assert out.endswith(
        "Next: name the missing channels in motor.toml (heatrun init rec.mf4 --out draft.toml "
        "proposes), then: heatrun check motor.toml rec.mf4\n"
    )


def test_a_text_without_times_shows_what_was_read_and_what_was_not(at_hand, capsys):
    without_times(at_hand / "log.csv")
    code, out = said(capsys, "log.csv", "-v")
    assert code == 1
    assert "No channel claims, in log: T_Mot [degC], Pump [bar]" in out
    rows = {line.split()[0]: line.split()[1] for line in out.splitlines() if line.startswith("  ")}
    assert rows["phase_current_A"] == "Is"
    assert 'time_s = "rate 10 Hz"' in out
    assert "it has no time_s, winding_degC." in out
    assert out.splitlines()[-1].startswith("Next: name the missing channels in motor.toml")


def test_what_the_motor_file_names_is_claimed_and_other_tests_are_checked(at_hand, capsys):
    without_times(at_hand / "log.csv")
    (at_hand / "good.csv").write_text(
        "\n".join([f"t [s],{HEAD}", *(f"{i},{row}" for i, row in enumerate(ROWS))])
    )
    (at_hand / "motor.toml").write_text(MOTOR + '[columns]\nwinding_degC = "T_Mot"\n')
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


def test_a_channel_whose_column_is_refused_is_not_missing_besides(at_hand, capsys):
    rows = "\n".join(f"{i},{row},{1.0 + 1e-3 * i}" for i, row in enumerate(ROWS))
    (at_hand / "coil.csv").write_text(f"t [s],{HEAD},R coil [Ohm]\n{rows}")
    (at_hand / "motor.toml").write_text(MOTOR + '[columns]\nwinding_degC = "R coil [Ohm] [degC]"\n')
    code, out = said(capsys, "coil.csv")
    assert code == 1
    assert out.count("ERROR") == 1
    assert 'winding_resistance_ohm = "R coil [Ohm]"' in out
    assert "No channel claims, in coil: " in out


def test_a_file_of_another_logger_is_one_error(at_hand, capsys):
    rows = "\n".join(f"{i},{row}" for i, row in enumerate(ROWS))
    (at_hand / "other.csv").write_text(f"t [s],{HEAD}\n{rows}")
    columns = {"phase_current_A": "mean(L1, L2)", "losses_W": "PV", "winding_degC": "W",
               "ambient_degC": "Raum"}  # fmt: skip
    lines = "\n".join(f'{name} = "{column}"' for name, column in columns.items())
    (at_hand / "motor.toml").write_text(f"{MOTOR}[columns]\n{lines}\n")
    code, out = said(capsys, "other.csv")
    assert code == 1
    assert out.count("ERROR") == 1
    assert re.search("Nor has it what .* names for [^.]*winding_degC", out)
    assert (
        "If it is of another logger, name its columns under [tests.other.columns]; heatrun" in out
    )


def test_a_wrong_line_of_columns_is_said_beside_the_columns_that_are_free(at_hand, capsys):
    without_times(at_hand / "log.csv")
    columns = '[columns]\nwinding_degC = "T_Mto"\ntime_s = "rate 1 Hz"\nlosses_W = "Pd [degC]"\n'
    (at_hand / "motor.toml").write_text(MOTOR + columns)
    code, out = said(capsys, "log.csv")
    assert code == 1
    assert "No channel claims, in log: Pd [W], T_Mot [degC], Pump [bar]" in out
    assert "'T_Mto' for winding_degC" in out
    assert "Did you mean" in out
    assert "column 'Pd [W]' as losses_W" in out  # the second fault, said at once
    assert "Next: " in out.splitlines()[-1]


def test_what_is_no_table_stays_an_error(at_hand, capsys):
    (at_hand / "notes.csv").write_text("nothing of use\n")
    assert said(capsys, "notes.csv") == (1, "")
    assert cli.main(["check", "motor.toml", "none.csv"]) == 1
    assert "none.csv" in capsys.readouterr().err


BENCH = Path(__file__).parents[3] / "shared" / "bench"
needs_bench = pytest.mark.skipif(not BENCH.is_dir(), reason="measured records are not here")
CONTROLLER = "Voltage (V),Current (A),Temperature (C),eRPM,Motor Duty,Phase Current (A),Power (W)"


def write(tmp_path: Path, header: str, *rows: str) -> Path:
    path = tmp_path / "run.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_a_phase_current_of_zeros_is_not_recorded(tmp_path):
    path = write(tmp_path, CONTROLLER, "60,2,24,900,3,0,120", "60,3,25,950,3,0,180")
    record = read_record(path, rate_Hz=10)
    assert set(record.channels) == {
        *("time_s", "dc_voltage_V", "dc_current_A", "dc_power_W", "controller_degC")
    }
    assert [finding.id for finding in record.findings] == ["not_recorded"]
    assert any("eRPM" in note and "electrical" in note for note in record.notes)
    measured = write(tmp_path, CONTROLLER, "60,2,24,900,3,0,120", "60,3,25,950,3,7,180")
    assert read_record(measured, rate_Hz=10)["phase_current_A"].tolist() == [0.0, 7.0]
    asked = Motor("M", columns={"phase_current_A": "Phase Current"})
    path = write(tmp_path, CONTROLLER, "60,2,24,900,3,0,120", "60,3,25,950,3,0,180")
    assert read_record(path, asked, rate_Hz=10)["phase_current_A"].tolist() == [0.0, 0.0]


def test_a_file_without_time_needs_a_rate(tmp_path):
    path = write(tmp_path, "winding_degC,P", "20,1", "21,2", "22,3")
    with pytest.raises(InputError, match="no time column") as caught:
        read_record(path)
    assert 'time_s = "rate 10 Hz"' in caught.value.remedy
    assert read_record(path, rate_Hz=4).time_s.tolist() == [0.0, 0.25, 0.5]
    motor = Motor("M", columns={"time_s": "rate 10 Hz"})
    assert read_record(path, motor).time_s.tolist() == [0.0, 0.1, 0.2]
    for rate in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="above 0 Hz"):
            read_record(path, rate_Hz=rate)


def test_a_rate_never_replaces_a_measured_time(tmp_path):
    path = write(tmp_path, "time_s,winding_degC", "0,20", "2,21")
    with pytest.raises(InputError, match="has a time column"):
        read_record(path, rate_Hz=10)
    record = read_record(path, Motor("M", columns={"time_s": "rate 10 Hz"}))
    assert record.time_s.tolist() == [0.0, 2.0]
    assert any("rate in [columns] is not used" in note for note in record.notes)


def test_the_record_of_a_plain_file(tmp_path):
    header = "phase_current_A,time_s,winding_degC,spare"
    path = write(tmp_path, header, "1,5,20,7", ",4,nan,7", "3,6.5,x,7", "4,7,22,7", "5,8,23,7")
    record = read_record(path)
    assert next(iter(record.channels)) == "time_s"
    assert record.time_s.tolist() == [0.0, -1.0, 1.5, 2.0, 3.0]  # backwards stays
    assert np.isnan(record["winding_degC"]).tolist() == [False, True, True, False, False]
    assert record.unused == ("spare",)
    assert any("at 5 s in the file" in note for note in record.notes)
    assert [(finding.id, finding.test) for finding in record.findings] == [
        ("unreadable_cells", "run")
    ]
    (source,) = record.sources
    assert len(source.sha256) == 64
    assert all(values.dtype == np.float64 for values in record.channels.values())
    assert read_record(path, name="first").name == "first"


def test_a_time_column_without_times_is_refused(tmp_path):
    path = write(tmp_path, "time_s,winding_degC,P", "nan,20,1", "nan,21,2")
    with pytest.raises(InputError, match="time"):
        read_record(path)


def test_what_a_fit_needs_is_named(tmp_path):
    record = read_record(write(tmp_path, "time_s,winding_degC,Pv", "0,20,1", "1,21,2"))
    with pytest.raises(InputError, match="Missing: phase_current_A") as caught:
        require(record, REQUIRED)
    assert "not used: Pv" in caught.value.problem
    assert '[columns] phase_current_A = "COLUMN [A]"' in caught.value.remedy
    require(record, ["time_s", "winding_degC"])


@needs_bench
def test_measured_car_motor():
    record = read_record(BENCH / "paderborn_profile24_heatrun_2p5s.csv.gz")
    require(record, REQUIRED)
    assert record.name == "paderborn_profile24_heatrun_2p5s"
    assert record.unused == ()
    assert record.time_s.size == 3003
    loaded = (record.time_s > 2000) & (record.time_s < 4300)
    unloaded = record.time_s > 5000
    # The README beside the file: 3.3 to 3.7 kW loaded, "1.5 kW" (two digits) unloaded
    assert 3300 < np.median(record["losses_W"][loaded]) < 3700
    assert 1400 < np.median(record["losses_W"][unloaded]) < 1650


@needs_bench
@pytest.mark.parametrize("run", ["Run2-Throttle100", "Run3-Throttle48", "Run13-Throttle8"])
def test_measured_small_motor(run):
    (logger,) = (BENCH / "tass" / run).glob("DAQ_*.csv")
    (controller,) = (BENCH / "tass" / run).glob("Export_*.csv")
    temperatures = read_record(logger)
    assert set(temperatures.channels) == {"time_s", "winding_degC", "stator_degC", "ambient_degC"}
    (count,) = (note for note in temperatures.notes if "Sample Count" in note)
    assert temperatures.time_s.size == int(count.split()[-1])
    assert (np.diff(temperatures.time_s) > 0).all()
    assert temperatures.findings == ()
    with pytest.raises(InputError, match="no time column"):
        read_record(controller)
    power = read_record(controller, rate_Hz=10)
    assert "phase_current_A" not in power
    assert np.median(power["dc_power_W"]) > 0


def test_a_test_that_is_predicted_need_not_suit_a_fit():
    of_a_fit = [*warned("too_short", "single_step"), finding("too_short", "note"),
                replace(finding("no_heating", "warning"), values={"rise_K": 0.1})]  # fmt: skip
    steady = replace(finding("no_heating", "error"), values={"rise_K": 0.1})
    other = [*warned("sensor_stuck"), finding("no_heating", "error")]
    found = as_holdout((*of_a_fit, steady, *other))
    assert [(each.id, each.severity) for each in found] == [
        ("no_heating", "warning"), ("sensor_stuck", "warning"), ("no_heating", "error"),
    ]  # fmt: skip
    assert "how the model holds a level" in found[0].message
