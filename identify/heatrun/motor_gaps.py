"""What tests do not say and a calibration needs: why it matters, and where it may come from."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from .bench.channels.derive import DERIVATIONS
from .bench.channels.likely_names import read_name
from .bench.channels.schema import CHANNEL, REQUIRED
from .bench.channels.units import find_unit
from .bench.column_course import Course
from .bench.free_columns import FreeColumn, Proposal, flat
from .bench.phase_means import PhaseMean
from .bench.survey import Survey
from .io.printable import printable
from .motor_candidates import ROOM_RANGE, Candidate, ranked
from .motor_stated import stated_ohms

WHY = {
    "time_s": "no sample has a time. Name the column of times, or the sampling rate: "
    'time_s = "rate 10 Hz".',
    "phase_current_A": "the copper loss, which heats the winding itself, follows from the current.",
    "losses_W": "they are the heat that the temperatures answer to. They may also follow from",
    "ambient_degC": "heat flows by the difference to it. Name its column, or write its mean under "
    '[constants]; a liquid-cooled machine takes sink = "coolant" under [motor].',
    "winding_degC": "it is what the network is fitted to.",
}
"""Why a channel that a calibration needs matters."""

NUMBER = re.compile(r"(?<![\w.,])[+-]?[0-9]{1,4}(?:[.,][0-9]+)?(?![\w.,]*[0-9])")
MOST_CANDIDATES = 12
LONGEST_LINE = 450
"""Characters; the motor file takes 500 on a right-hand side."""


@dataclass(frozen=True)
class Gap:
    """Something that is missing.

    Attributes:
        channel: Canonical name, empty for a key.
        key: Key of the motor file, empty for a channel.
        sentence: Why it matters and what to do.
        candidates: Right-hand sides of `[columns]` with a note on each.
        constants: Lines of `[constants]`, commented.
        lines: Further lines of comment at the key.
    """

    channel: str
    key: str
    sentence: str
    candidates: tuple[tuple[str, str], ...] = ()
    constants: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()

    @property
    def place(self) -> str:
        """Where it is to be written."""
        return f"[columns] {self.channel}" if self.channel else f"[winding] {self.key}"


def gaps(surveys: Sequence[Survey]) -> tuple[Gap, ...]:
    """Return what tests leave out, in the order of the motor file.

    A channel counts as missing if one of the files has it neither as a column nor by a formula,
    and no other file of the tests does either.

    Args:
        surveys: What the files hold.
    """
    have = frozenset().union(*(one.channels for one in surveys))
    found = [] if found_resistance(surveys) else [_resistance(surveys)]
    return (*found, *(_channel(name, surveys) for name in REQUIRED if name not in have))


def found_resistance(surveys: Sequence[Survey]) -> dict[str, str]:
    """Return the resistance and its temperature where a file states both as `Rrif` and `Trif`.

    Args:
        surveys: What the files hold.
    """
    for one in surveys:
        held = one.constants or {}
        if held.get("Rrif", 0.0) > 0.0 and -60.0 < held.get("Trif", 999.0) < 250.0:
            return {
                "phase_resistance_ohm": f"{held['Rrif'] / 3.0:.9g}  # Rrif/3 of the file",
                "reference_temperature_degC": f"{held['Trif']:.9g}  # Trif of the file",
            }
    return {}


def _resistance(surveys: Sequence[Survey]) -> Gap:
    notes = tuple(
        f"# A resistance in {Path(one.path).name}: column '{printable(flat(column.name))}' holds "
        f"{column.low:.6g} … {column.high:.6g}."
        for one in surveys
        for column in one.free
        if (column.unit or "").casefold() in ("ohm", "ω", "mohm", "mω") and column.low is not None
    )
    offered = " or ".join(f"{ohm:g} Ω" for ohm in stated_ohms(surveys))
    return Gap(
        "",
        "phase_resistance_ohm",
        "the copper loss 3 I² R(T) follows from it. Without it only --model first can be "
        "calibrated. It is measured at the terminals of the cold machine (half of what a star "
        "shows between two of them), or stands on its data sheet."
        + (f" The tests state {offered}: confirm it in [winding]." if offered else ""),
        lines=notes,
    )


def _channel(name: str, surveys: Sequence[Survey]) -> Gap:
    sentence = WHY[name]
    if name == "losses_W":
        ways = [" and ".join(way.needs) for way in DERIVATIONS if way.channel == name]
        sentence = f"{sentence} {'; or '.join(ways)}."
    found = [candidate for one in surveys for candidate in _candidates(name, one)]
    candidates = ranked(name, [one for one in found if len(one.line) <= LONGEST_LINE])
    constants = _constants(name, surveys)
    silent = [sentence for one in surveys for sentence in _silent(name, one)]
    sentence = " ".join((sentence, *silent))
    if not candidates and not constants and not silent and name != "time_s":
        sentence += " No column has a unit or a name that speaks for it."
    return Gap(name, "", sentence, tuple(candidates[:MOST_CANDIDATES]), constants)


def _candidates(name: str, one: Survey) -> Iterator[Candidate]:
    """Yield the columns of a file that may be a channel, and the means of three of them."""
    held: dict[str, Candidate] = {}
    for column in one.free:
        proposal = _proposal(name, column)
        if proposal is not None and not column.is_silent:
            held[column.name] = Candidate(
                proposal.line,
                _note(column),
                proposal.is_likely,
                proposal.unit_from == "assumed",
                _in_unit_of(name, proposal, column),
            )
    yield from (_mean(mean, held) for mean in one.means if mean.channel == name)
    yield from held.values()


def _proposal(name: str, column: FreeColumn) -> Proposal | None:
    """Return how a column may be a channel; one whose name speaks of another is none of it."""
    is_others = any(one.is_likely for one in column.proposals)
    for one in column.proposals:
        if one.channel == name and (one.is_likely or not is_others):
            return one
    return None


def _mean(mean: PhaseMean, held: Mapping[str, Candidate]) -> Candidate:
    parts = [held[name] for name in mean.columns]
    return Candidate(
        mean.line,
        "three columns that move together",
        any(part.is_likely for part in parts),
        any(part.is_assumed for part in parts),
        max(parts, key=lambda part: part.move).course,
        is_mean=True,
    )


def _in_unit_of(name: str, proposal: Proposal, column: FreeColumn) -> Course | None:
    unit = find_unit(proposal.unit, CHANNEL[name].quantity)
    if column.course is None or unit is None:
        return column.course
    return column.course.converted(unit.factor, unit.offset)


def _silent(name: str, one: Survey) -> Iterator[str]:
    """Yield a sentence for each column that would be the channel and holds nothing."""
    where = printable(flat(Path(one.path).name))
    for column in one.silent:
        if column.channel == name:
            yield (
                f"Column '{printable(flat(column.column))}' of {where} is read for it and holds "
                f"{column.held}.{'' if column.is_empty else ' If that was measured, it may stay.'}"
            )
    for free in one.free:
        proposal = _proposal(name, free)
        if proposal is not None and proposal.is_likely and free.is_silent:
            held = "0 throughout" if free.num_values else "no values"
            line = f' If that was measured: {name} = "{printable(flat(proposal.line))}".'
            yield (
                f"Column '{printable(flat(free.name))}' of {where} holds {held}."
                f"{line if free.num_values else ''}"
            )


def _note(column: FreeColumn) -> str:
    assumed = all(one.unit_from == "assumed" for one in column.proposals)
    return f"{column.shown()}{'; check the unit' if assumed else ''}"


def _constants(name: str, surveys: Sequence[Survey]) -> tuple[str, ...]:
    """Return lines of `[constants]` with what the files hold for a room that was not recorded."""
    if name != "ambient_degC":
        return ()
    lines = []
    for one in surveys:
        for column in one.free:
            is_room = find_unit(column.unit or "", "temperature") is not None
            value = column.low
            is_steady = value == column.high and not column.is_silent
            if is_room and value is not None and is_steady and _is_room(value):
                what = "the one value of" if column.num_values == 1 else "throughout in"
                column_name = printable(flat(column.name))
                lines.append(f"# {name} = {value!r}  # {what} column '{column_name}'")
        for line in one.preamble:
            numbers = NUMBER.findall(line) if "ambient" in read_name(line).meanings else []
            values = [float(number.replace(",", ".")) for number in numbers]
            lines += [f"# {name} = {value!r}  # from the line '{printable(flat(line))[:80]}'"
                      for value in values if _is_room(value)]  # fmt: skip
    return tuple(dict.fromkeys(lines))


def _is_room(value: float) -> bool:
    coldest, hottest = ROOM_RANGE
    return coldest <= value <= hottest
