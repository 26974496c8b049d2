"""A small version of the study `first_hour.py`: all files up to `check`, one to its sheet."""

import json
from pathlib import Path

import pytest
from first_hour import FILES, MOST_LINES, edited, entry_of, run

from heatrun.cli import main


@pytest.mark.parametrize("kind", list(FILES))
def test_what_init_drafts_needs_five_lines_at_most_to_pass_the_check(kind, tmp_path, capsys):
    handed, motor = FILES[kind], tmp_path / "motor.toml"
    record = handed.write(tmp_path)
    assert main(["init", str(record), "--accept", "--out", str(motor), "--json"]) == 0
    missing = json.loads(capsys.readouterr().out)["missing"]
    text, typed = edited(motor.read_text(encoding="utf-8"), missing, handed)
    assert 1 <= len(typed) <= MOST_LINES
    motor.write_text(text, encoding="utf-8")
    assert main(["check", str(motor), str(record), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["suitability"][0]["will_do"] is True
    read = {one["channel"]: one["column"] for one in said["tests"][0]["mapping"]}
    assert handed.columns.items() <= read.items()


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
    row = run("German SCADA, means of 5 s", tmp_path)
    assert row["covered"] >= 3
    assert "sheet.pdf" in row["written"]
    assert not row["read_wrongly"]
