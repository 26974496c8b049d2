"""`[tests.NAME]` that is for none of the tests is said; a mistyped name is named."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from heat_runs import CLEAN

from heatrun.checks.suitability import other_tests
from heatrun.cli import main
from heatrun.commands.loading import load
from heatrun.motor.file import load_motor, parse_motor


def motor(*names: str):
    sections = "".join(f'[tests."{name}"]\nmask = [[600, 630]]\n' for name in names)
    return parse_motor(f'[motor]\nname = "M"\n{sections}'.encode(), "motor.toml")


def test_a_section_of_a_given_test_or_of_its_parts_is_no_finding():
    assert other_tests(motor(), ["duty"]) == ()
    assert other_tests(motor("duty"), ["duty"]) == ()
    assert other_tests(motor("duty"), ["duty_1", "duty_2"]) == ()


@pytest.mark.parametrize("name", ["step", "run_002", "Test_2024_03_05_002"])
def test_a_section_of_another_test_is_a_note(name):
    (found,) = other_tests(motor(name), ["duty", "run_001", "Test_2024_03_05_001"])
    assert found.severity == "note"
    assert found.message.startswith(f"[tests.{name}] of the motor file is for none")


@pytest.mark.parametrize("name", ["dtuy_90min", "Duty_90min", "duty_90min.csv", "duty-90min"])
def test_a_mistyped_name_is_a_warning_with_the_right_one(name):
    (found,) = other_tests(motor(name), ["duty_90min"])
    assert found.severity == "warning"
    assert "Did you mean [tests.duty_90min]?" in found.remedy


def test_a_test_that_has_its_own_section_is_not_the_one_that_was_meant():
    (found,) = other_tests(motor("step", "stepp"), ["step"])
    assert found.severity == "note"


@pytest.fixture
def bench(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = replace(CLEAN, channels={k: v[::10] for k, v in CLEAN.channels.items()})
    np.savetxt("duty.csv", np.stack(list(record.channels.values()), axis=1), "%.7g", ",",
               header=",".join(record.channels), comments="")  # fmt: skip
    text = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.0062\n'
    (tmp_path / "motor.toml").write_text(f"{text}[tests.dutty]\nmask = [[600, 630]]\n")
    return tmp_path


def test_check_finds_it(bench, capsys):
    assert main(["check", "motor.toml", "duty.csv", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    (found,) = [one for one in said["findings"] if one["id"] == "other_test"]
    assert "[tests.duty]" in found["remedy"]


def test_a_command_that_fits_says_it(bench, capsys):
    load(load_motor("motor.toml"), [bench / "duty.csv"], [], as_json=False)
    assert "[tests.dutty] of the motor file is for none of the tests" in capsys.readouterr().err
