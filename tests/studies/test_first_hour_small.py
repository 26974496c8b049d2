"""A small version of the study `first_hour.py`: all files up to `check`, one to its sheet."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from heatrun.cli import main

sys.path.insert(0, str(Path(__file__).parent))

from first_hour import edited, run, table
from first_hour_files import FILES


@pytest.mark.parametrize("kind", list(FILES))
def test_what_init_drafts_needs_only_its_own_lines_to_pass_the_check(kind, tmp_path, capsys):
    if "MDF" in kind:
        pytest.importorskip("asammdf")
    record, motor = FILES[kind](tmp_path), tmp_path / "motor.toml"
    assert main(["init", str(record), "--out", str(motor)]) == 0
    draft = motor.read_text(encoding="utf-8")
    text, touched = edited(draft)
    assert touched
    assert text.count("\n") == draft.count("\n")
    motor.write_text(text, encoding="utf-8")
    capsys.readouterr()
    assert main(["check", str(motor), str(record), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["suitability"][0]["will_do"] is True
    assert not [one for one in said["findings"] if one["severity"] == "error"]


@pytest.mark.slow
def test_one_file_to_its_sheet(tmp_path):
    row = run("German text export", tmp_path)
    assert row["covered"] >= 3
    assert "sheet.pdf" in row["written"]
    assert "German text export" in table([row])
