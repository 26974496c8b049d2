"""`heatrun --help`, and that of every command, prints what the command does."""

from __future__ import annotations

import pytest

from heatrun import cli
from heatrun.commands import all_commands


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
