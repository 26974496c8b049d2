"""What the packages beside heatrun bring into it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import heatrun
from heatrun import commands
from heatrun.cli import main


def test_names_of_other_packages_are_reached_and_unknown_ones_refused():
    assert {"calibrate", "calibrate_fleet", "population"} <= set(dir(heatrun))
    assert heatrun.calibrate_fleet.__module__ == "heatrun_fleet.api"
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = heatrun.nonsense


def test_a_command_of_another_package_stands_last_in_the_help_and_runs(monkeypatch, capsys):
    def add_parser(parsers):
        return parsers.add_parser("weigh", help="the mass")

    module = SimpleNamespace(add_parser=add_parser, run=lambda options: print("4 kg") or 0)
    entries = [SimpleNamespace(name="weigh", load=lambda: module),
               SimpleNamespace(name="check", load=lambda: module)]  # fmt: skip
    monkeypatch.setattr(commands, "entry_points", lambda group: entries)
    assert list(commands.all_commands()) == [*commands.COMMANDS, "weigh"]
    assert commands.all_commands()["check"]() is not module  # ours are not replaced
    assert main(["weigh"]) == 0
    assert capsys.readouterr().out == "4 kg\n"
