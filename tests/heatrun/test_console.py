"""What commands say comes out in whole lines, whichever thread says it."""

from __future__ import annotations

import io
import json
import sys

from heatrun.commands.console import EVERY_S, PROGRESS, bar, say


class Pieces(io.StringIO):
    """A stream that remembers what it was given at once."""

    def __init__(self) -> None:
        super().__init__()
        self.pieces: list[str] = []

    def write(self, text: str) -> int:
        self.pieces.append(text)
        return super().write(text)


def test_a_line_is_written_in_one_piece(monkeypatch):
    stream = Pieces()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv(PROGRESS, "json")
    say("first order: sampling")
    with bar() as progress:
        progress("250 steps", 0.31)
    assert stream.pieces[0] == "· first order: sampling\n"
    assert json.loads(stream.pieces[1]) == {"share": 0.31, "doing": "250 steps"}
    assert len(stream.pieces) == 2
    assert stream.pieces[1].endswith("\n")


def test_without_a_terminal_the_time_left_is_printed_now_and_then(monkeypatch):
    stream = Pieces()
    now = [100.0]
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.delenv(PROGRESS, raising=False)
    with bar(lambda: now[0]) as progress:
        progress("first order: fitting; about 2 min left", 0.0)
        progress("first order: fitted; about 2 min left", 0.1)
        now[0] += EVERY_S
        progress("second order: 500 steps; about 1 min left", 0.534)
        now[0] += EVERY_S
        progress("done", 1.0)
    assert stream.pieces == [
        "· 0 %, first order: fitting; about 2 min left\n",
        "· 53 %, second order: 500 steps; about 1 min left\n",
    ]
