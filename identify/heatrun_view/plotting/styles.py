"""Colour and dash of each line: a signal keeps its colour in every test and every selection."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

from heatrun.bench.channels.schema import CHANNELS

from ..look import DASHES
from .trace import Trace


def _fixed() -> dict[str, int]:
    """Return the number of each channel among those of its unit, which share a plot."""
    seen: dict[str, int] = {}
    found = {}
    for channel in CHANNELS:
        found[channel.name] = seen.get(channel.unit, 0)
        seen[channel.unit] = found[channel.name] + 1
    return found


MEASURED, MODEL, RESIDUAL = FIT = ("measured", "model", "residual")
"""Lines of a fit."""

FIXED = _fixed() | {name: number for number, name in enumerate(FIT)}


def colours(traces: Sequence[Trace], num_colours: int) -> list[int]:
    """Return the number of each line's colour.

    A channel has its own; another column takes one by its name, or the next that is free in its
    plot.

    Args:
        traces: The lines.
        num_colours: Colours of the palette.
    """
    taken: dict[str, dict[str, int]] = {}
    for trace in traces:
        if trace.channel in FIXED:
            taken.setdefault(trace.unit, {})[trace.channel] = FIXED[trace.channel] % num_colours
    for trace in traces:
        held = taken.setdefault(trace.unit, {})
        if trace.channel in held:
            continue
        first = zlib.crc32(trace.channel.encode()) % num_colours
        turns = [(first + step) % num_colours for step in range(num_colours)]
        held[trace.channel] = next((turn for turn in turns if turn not in held.values()), first)
    return [taken[trace.unit][trace.channel] for trace in traces]


def dashes(traces: Sequence[Trace]) -> list[str]:
    """Return the dash of each line: one for each test; a model shows what is measured below it."""
    tests = list(dict.fromkeys(trace.test for trace in traces))
    places = [tests.index(trace.test) + (trace.channel == MODEL) for trace in traces]
    return [DASHES[place % len(DASHES)] for place in places]


def sample(colour: str, dash: str) -> str:
    """Return a piece of a line for a table, as HTML.

    Args:
        colour: Of the line.
        dash: One of `DASHES`.
    """
    pattern = {"solid": "", "dashed": "6", "dotted": "2 3", "dotdash": "2 3 6 3"}.get(dash, "6 3 2")
    return (
        "<svg width='26' height='10'><line x1='0' y1='6' x2='26' y2='6' stroke-width='2' "
        f"stroke='{colour}' stroke-dasharray='{pattern}'/></svg>"
    )
