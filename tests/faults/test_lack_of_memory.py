"""Where Python runs out of memory, a sentence says so."""

from __future__ import annotations

import json
import sys

import pytest

from heatrun import cli


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
