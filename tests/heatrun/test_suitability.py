"""Whether a record will do, and what comes next: from the findings, as text and as JSON."""

from __future__ import annotations

import gzip
import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from heatrun import cli
from heatrun.checks.suitability import suitability
from heatrun.record.record import Finding

DATA = Path(__file__).parents[2] / "data" / "synthetic"
AIM = "a second-order calibration"


def finding(id: str, severity: str, where: str = "t", message: str = "Too hot.") -> Finding:
    return Finding(id, severity, message, where)


@pytest.mark.parametrize(
    ("findings", "will_do", "sentence"),
    [
        ([], True, f"This record will do for {AIM}."),
        ([finding("sampling", "note")], True, f"This record will do for {AIM}."),
        (
            [finding("too_short", "warning"), finding("single_step", "warning")],
            True,
            f"This record will do for {AIM}, with wide intervals: it is too short for the slow "
            "time constant and it holds a single load step.",
        ),
        ([finding("too_short", "note")], True, f"This record will do for {AIM}."),
        (
            [finding("too_short", "warning"), finding("nan_block", "warning")],
            True,
            f"This record will do for {AIM}, with wide intervals: it is too short for the slow "
            "time constant; read the warnings first (nan_block).",
        ),
        (
            [
                Finding(
                    "no_heating",
                    "warning",
                    "Falls.",
                    "t",
                    values={"tau_fast_s": 36.79, "tau_slow_s": 1037.7},
                )
            ],
            True,
            "This record gives time constants only: 36.8 s and 1040 s. Heat capacities and "
            "resistances need a test under load beside it.",
        ),
        (
            [finding("unit_suspected", "warning"), finding("nan_block", "warning")],
            True,
            "To be cleared up first: a column may be in another unit (unit_suspected). Then this "
            f"record will do for {AIM}, read the warnings first (nan_block).",
        ),
        (
            [finding("simulated_by_heatrun", "warning")],
            False,
            f"This record will not do for {AIM}: it was simulated by heatrun, not measured "
            "(simulated_by_heatrun).",
        ),
        (
            [finding("missing_channel", "error", "t, losses_W"), finding("kelvin", "error")],
            False,
            f"This record will not do for {AIM}: it has no losses_W.",
        ),
        (
            [finding("sensor_stuck", "error"), finding("kelvin", "error", message="Cold.")],
            False,
            f"This record will not do for {AIM}: Too hot. (sensor_stuck) And 1 more.",
        ),
    ],
)
def test_the_answer_follows_from_the_findings(findings, will_do, sentence):
    answer = suitability("t", findings, AIM)
    assert (answer.will_do, answer.sentence) == (will_do, sentence)


@pytest.mark.parametrize(
    ("id", "next_step"),
    [
        ("simulated_by_heatrun", "name tests that were measured, then: heatrun check "),
        ("current_amplitude", "clear up the warnings named above, then: heatrun calibrate "),
        ("ambient_moving", "heatrun calibrate "),
    ],
)
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
