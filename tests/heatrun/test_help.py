"""`heatrun --help`, and that of every command, prints what the command does.

What a command loads: the seconds before its answer.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from heatrun import cli
from heatrun.commands import all_commands

SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"
MOTOR, DUTY = (str(SYNTHETIC / name) for name in ("motor.toml", "duty_30min.csv.gz"))


@pytest.mark.parametrize(
    "words", [[], *([name] for name in all_commands())], ids=lambda w: " ".join(w)
)
def test_help_is_printed(words, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main([*words, "--help"])
    said = capsys.readouterr()
    assert (stop.value.code, said.err) == (0, "")
    assert " ".join(["usage: heatrun", *words]) in said.out
    if not words:
        assert "parameters with 95 % intervals" in said.out
        assert all(name in said.out for name in all_commands())


COMPUTING, DRAWING = {"jax", "equinox", "lptn", "scipy", "arviz", "xarray"}, {"matplotlib", "PIL"}
"""Packages that take long to load."""


@pytest.mark.parametrize(
    ("words", "spared"),
    [
        (["--help"], COMPUTING | DRAWING | {"numpy", "pandas"}),
        (["check", MOTOR, DUTY], COMPUTING | DRAWING),
        (["init", DUTY, "--out", "draft.toml"], COMPUTING | DRAWING),
        (["report", "--type", "thermal", MOTOR, DUTY, "--out", "."], COMPUTING),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_what_a_command_has_no_use_for_is_not_loaded(words, spared, tmp_path):
    said = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "heatrun.cli", *words],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    loaded = {line.split("|")[-1].strip().split(".")[0] for line in said.stderr.splitlines()}
    assert "heatrun" in loaded
    assert not loaded & spared
