"""A limit of the address space is a sentence, not the abort of compiled code."""

from __future__ import annotations

import gzip
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from heatrun import cli

pytest.importorskip("resource")
DATA = Path(__file__).parents[2] / "data" / "synthetic"


def limited(kilobytes: int, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "heatrun.cli", *words]
    line = ["bash", "-c", f'ulimit -v {kilobytes}; exec "$@"', "bash", *command]
    return subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("command", ["calibrate", "compare", "discover"])
def test_a_limit_below_what_a_fit_takes_is_said_at_once(command, tmp_path):
    done = limited(1_500_000, tmp_path, command, "motor.toml", "duty.csv", "--json")
    assert done.returncode == 1, done.stderr
    assert (
        "more memory than there is: the address space of a process is limited to 1.5 GB"
        in (json.loads(done.stdout)["error"]["problem"])
    )
    assert "ulimit -v" in done.stderr
    assert not list(tmp_path.iterdir())


def test_commands_that_compile_nothing_have_no_such_limit(tmp_path):
    done = limited(1_500_000, tmp_path, "sheet", "run")
    assert "is not a run folder" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) > 2, reason="more cores take more")
def test_a_little_above_the_floor_is_enough_for_both_orders(tmp_path):
    (tmp_path / "motor.toml").write_bytes((DATA / "motor.toml").read_bytes())
    with gzip.open(DATA / "duty_30min.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    (tmp_path / "duty.csv").write_text("\n".join([lines[0], *lines[1::10]]) + "\n")
    done = limited(
        2_600_000, tmp_path, "calibrate", "motor.toml", "duty.csv", "--quick", "--out", "run"
    )
    assert done.returncode == 0, done.stderr


def test_the_sentence_about_memory_needs_no_more_of_it(monkeypatch, capsys):
    def too_much(options):
        raise MemoryError

    monkeypatch.setattr("heatrun.commands.check.run", too_much)
    # a package that is loaded at this point ends in a traceback: there is no room for it
    monkeypatch.setitem(sys.modules, "heatrun.runs.run_folder", None)
    assert cli.main(["check", "motor.toml", "test.csv", "--json"]) == 1
    printed = capsys.readouterr()
    assert "more memory than there is" in json.loads(printed.out)["error"]["problem"]
    assert "more memory than there is" in printed.err


def test_a_package_for_which_there_is_no_room_is_said_so(monkeypatch, capsys):
    def no_room(options):
        raise ImportError("libjax_common.so: failed to map segment from shared object")

    monkeypatch.setattr("heatrun.commands.check.run", no_room)
    assert cli.main(["check", "motor.toml", "test.csv"]) == 1
    assert "more memory than there is" in capsys.readouterr().err

    def not_there(options):
        raise ImportError("No module named 'pyarrow'")

    monkeypatch.setattr("heatrun.commands.check.run", not_there)
    with pytest.raises(ImportError, match="pyarrow"):
        cli.main(["check", "motor.toml", "test.csv"])
