"""The same command with the same seed writes the same bytes, on one core and on all."""

import gzip
import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pypdf import PdfReader

from heatrun import cli

DATA = Path(__file__).parents[2] / "data" / "synthetic"
EPOCH = "1700000000"  # 2023-11-14T22:13:20Z
COMMANDS = (
    ("calibrate", "motor.toml", "{in}/duty.csv", "--holdout", "{in}/second.csv", "--quick",
     "--model", "second", "--seed", "3", "--out", "run"),
    ("sheet", "run", "--out", "sheet"),
    ("report", "--type", "general", "motor.toml", "{in}/duty.csv", "--out", "reports"),
    ("report", "--type", "thermal", "motor.toml", "{in}/duty.csv", "--run", "run", "--out",
     "reports"),
    ("simulate", "motor.toml", "run", "{in}/second.csv", "--out", "virtual"),
    ("export", "run", "--to", "mat", "--out", "exported"),
)  # fmt: skip
PROGRAM = """
import json, os, sys
if sys.argv[1] == "one":
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
from heatrun.cli import main
codes = [main(words) for words in json.loads(sys.argv[2])]
sys.exit(max(codes))
"""


def write_inputs(folder: Path) -> None:
    """Write the motor file and two records of 15 minutes with a sample every 2 s."""
    folder.mkdir()
    (folder / "motor.toml").write_bytes((DATA / "motor.toml").read_bytes())
    with gzip.open(DATA / "duty_30min.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    for name, rows in (("duty", lines[1:9002:20]), ("second", lines[9001::20])):
        (folder / f"{name}.csv").write_text("\n".join([lines[0], *rows]) + "\n")
        os.utime(folder / f"{name}.csv", (1_700_000_000, 1_700_000_000))


def made(home: Path, cores: str, epoch: str, num_commands: int) -> dict[str, bytes]:
    """Run commands in a folder, in one process; return the files by name."""
    chosen = COMMANDS[:num_commands]
    commands = [[w.replace("{in}", str(home / "in")) for w in command] for command in chosen]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, cores, json.dumps(commands)],
        cwd=home,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "SOURCE_DATE_EPOCH": epoch},
    )
    assert done.returncode == 0, done.stderr
    return {
        str(path.relative_to(home)): path.read_bytes()
        for path in sorted(home.rglob("*"))
        if path.is_file() and path.relative_to(home).parts[0] != "in"
    }


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The files of three times the same: on all cores, on one core, and without a stated date."""
    home = tmp_path_factory.mktemp("same") / "a folder of nobody's business"
    found = []
    for cores, epoch, num_commands in (
        ("all", EPOCH, len(COMMANDS)),
        ("one", EPOCH, len(COMMANDS)),
        ("all", "", 2),
    ):
        home.mkdir()
        write_inputs(home / "in")
        shutil.copy(home / "in" / "motor.toml", home)
        found.append(made(home, cores, epoch, num_commands))
        shutil.rmtree(home)
    return found


def digests(files: dict[str, bytes]) -> dict[str, str]:
    return {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen here")
@pytest.mark.slow
def test_one_core_writes_the_bytes_that_all_write(runs):
    if len(os.sched_getaffinity(0)) == 1:
        pytest.skip("there is one core only")
    assert digests(runs[1]) == digests(runs[0])
    kinds = {Path(name).suffix for name in runs[0]}
    assert {".json", ".csv", ".pdf", ".xlsx", ".nc", ".png", ".mat"} <= kinds


@pytest.mark.slow
def test_a_stated_date_stands_in_the_files_that_have_a_place_for_one(runs):
    dated = {"run/manifest.json", "run/sheet.xlsx", "sheet/sheet.xlsx",
             "run/posterior_second.nc"}  # fmt: skip
    first, last = digests(runs[0]), digests(runs[2])
    assert {name for name in last if first[name] != last[name]} == dated
    assert json.loads(runs[0]["run/manifest.json"])["date"] == "2023-11-14T22:13:20+00:00"


@pytest.mark.slow
def test_no_folder_stands_in_a_document(runs, tmp_path):
    for name, content in runs[0].items():
        if name.endswith(".pdf"):
            (tmp_path / "document.pdf").write_bytes(content)
            reader = PdfReader(tmp_path / "document.pdf")
            text = "".join(page.extract_text() for page in reader.pages) + str(reader.metadata)
            assert "duty" in text
            assert "nobody's business" not in text, name
            assert "/in/" not in text, name
            assert b"nobody" not in content
            assert b"CreationDate" not in content


@pytest.mark.parametrize("epoch", ["yesterday", "-5", "1e9", "9" * 30])
def test_a_wrong_stated_date_is_said_before_any_work(epoch, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    assert cli.main(["check", "motor.toml", "duty.csv"]) == 2
    said = capsys.readouterr().err
    assert "SOURCE_DATE_EPOCH" in said
    assert "whole seconds since 1970" in said
