"""Equilibrium in the thermal report: verdict on each stretch, and what was not waited for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from heatrun.reports.printed import places_of
from heatrun.runs.equilibrium import Equilibrium, SteadyRise

from .figures.plot import wording
from .report import Column, Line, Row, Table

if TYPE_CHECKING:
    from heatrun.runs.steady_of_network import SteadyNetwork

VERDICT = {True: "reached", False: "not reached", None: "undecided"}


def last_of_each(settled: Sequence[Equilibrium]) -> tuple[Equilibrium, ...]:
    """Return the verdict on the last stretch of each part."""
    return tuple({each.channel: each for each in settled}.values())


def equilibrium_rows(settled: Sequence[Equilibrium]) -> list[Row]:
    """Return the rows of the main table: each part on its last stretch, and its steady state."""
    rows = []
    for last in last_of_each(settled):
        earlier = [e for e in settled if e.channel == last.channel and e is not last]
        name = wording(last.channel)
        notes = [_when(last), last.reason, _first(last)]
        notes += [f"before, {_when(e)}: {VERDICT[e.is_reached]}" for e in earlier]
        rows.append(
            Row(f"{name.replace(' ', '_')}_equilibrium", f"Equilibrium of the {name}",
                VERDICT[last.is_reached], "", "; ".join(note for note in notes if note))
        )  # fmt: skip
        if isinstance(last.steady, SteadyRise):
            rows.append(_steady_row(last, last.steady))
    return rows


def network_rows(found: SteadyNetwork | None) -> list[Row]:
    """Return the steady state of the run's network under the load of the last stretch."""
    if found is None:
        return []
    rows = []
    for node, value in found.median_degC.items():
        low, high = found.limits_degC[node]
        label = "Tsr" if node == "stator" else node.replace("_", " ")
        rows.append(
            Row(f"{node}_network_steady_degC", f"{_upper(label)} at rest, network, extrapolated",
                value, "°C", f"95 %: {low:.1f} … {high:.1f} °C; load and sink as from "
                f"{found.from_s / 60.0:.0f} to {found.to_s / 60.0:.0f} min; no measurement", 1)
        )  # fmt: skip
    return rows


def gradients(settled: Sequence[Equilibrium]) -> Table:
    """Return the gradients of each part on each stretch."""
    columns = (
        Column("from", "min"),
        Column("to", "min"),
        Column("last but one interval"),
        Column("standard error"),
        Column("last interval"),
        Column("standard error"),
        Column("equilibrium", ""),
    )
    lines = []
    for each in settled:
        stretch = each.stretch
        span = (None, None) if stretch is None else (stretch.from_s / 60.0, stretch.to_s / 60.0)
        pairs = list(zip(each.gradients_K_per_h, each.errors_K_per_h, strict=True))
        figures = (None,) * (4 - 2 * len(pairs)) + tuple(v for pair in pairs for v in pair)
        not_continued = f"not continued: {each.steady}" if isinstance(each.steady, str) else ""
        note = "; ".join(part for part in (each.reason, not_continued) if part)
        cells = (*span, *figures, VERDICT[each.is_reached])
        of_pairs = [places_of(error) if error > 0.0 else None for _, error in pairs]
        places = (None,) * (4 - 2 * len(pairs)) + tuple(d for d in of_pairs for _ in range(2))
        lines.append(Line(wording(each.channel), "K/h", cells, note, (1, 1, *places, None)))
    return Table("Gradients of the rise over the sink", columns, tuple(lines))


def equilibrium_sentence(settled: Sequence[Equilibrium]) -> str:
    """Return the verdict in words: on the whole record, or on each stretch of constant load."""
    spans = dict.fromkeys(each.stretch for each in settled)
    if len(spans) < 2:
        return f"thermal equilibrium {_state(settled)}"
    parts = []
    for span in spans:
        of_span = [each for each in settled if each.stretch == span]
        parts.append(f"{_when(of_span[0])} {_state(of_span)}")
    return f"thermal equilibrium by stretch of constant load: {'; '.join(parts)}"


def _state(settled: Sequence[Equilibrium]) -> str:
    states = {each.is_reached for each in settled}
    if states == {True}:
        return "is reached in every measured part"
    if False in states:
        moving = dict.fromkeys(wording(e.channel) for e in settled if e.is_reached is False)
        return f"is not reached ({', '.join(moving)})"
    return "is undecided"


def _steady_row(found: Equilibrium, steady: SteadyRise) -> Row:
    low, high = (found.sink_degC + side for side in steady.rise_95_K)
    name = wording(found.channel)
    return Row(
        f"{name.replace(' ', '_')}_steady_degC",
        f"{_upper(name)} at rest, extrapolated",
        found.sink_degC + steady.rise_K,
        "°C",
        f"95 %: {low:.1f} … {high:.1f} °C; a rise of {steady.rise_K:.1f} K over a sink of "
        f"{found.sink_degC:.1f} °C; one exponential with a time constant of "
        f"{steady.tau_s / 60.0:.0f} min; no measurement",
        1,
    )


def _when(found: Equilibrium) -> str:
    if found.stretch is None:
        return ""
    return f"{found.stretch.from_s / 60.0:.0f} to {found.stretch.to_s / 60.0:.0f} min"


def _first(found: Equilibrium) -> str:
    if found.first_reached_s is None:
        return ""
    return f"first met at {found.first_reached_s / 60.0:.0f} min"


def _upper(label: str) -> str:
    return label[0].upper() + label[1:]
