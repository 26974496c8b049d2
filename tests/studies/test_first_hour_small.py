"""A small version of the study `first_hour.py`: all files up to `check`, one to its sheet."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from heatrun.cli import main

sys.path.insert(0, str(Path(__file__).parent))

from first_hour import edited, entry_of, run, table
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


def test_its_numbers_are_those_of_the_certificate_without_exponents():
    """663.61 with u = 7.4963: U = 15, by hand from the stored result."""
    stored = Path(__file__).parents[1] / "stored" / "fit-1.json"
    found = json.loads(stored.read_bytes())["models"]["second"]["parameters"]
    shown = {name: entry_of(found[name], 15060.0) for name in ("Ceq_w", "Ceq_sr")}
    assert shown["Ceq_w"]["printed"] == "664 ± 15 J/K"
    assert shown["Ceq_sr"]["printed_truth"] == "15060 J/K"
    assert not any("e+" in text for each in shown.values() for key, text in each.items()
                   if key.startswith("printed"))  # fmt: skip


@pytest.mark.slow
def test_one_file_to_its_sheet(tmp_path):
    row = run("German text export", tmp_path)
    assert row["covered"] >= 3
    assert "sheet.pdf" in row["written"]
    assert "German text export" in table([row])
