"""What tests do not say and a calibration needs: why it matters, and where it may come from."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .bench.channels.derive import DERIVATIONS
from .bench.channels.likely_names import LIKELY
from .bench.channels.schema import REQUIRED
from .bench.channels.units import find_unit
from .bench.survey import FreeColumn, Survey, flat
from .io.printable import printable

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
COLDEST, HOTTEST = -40.0, 60.0
"""Range of rooms in which motors are tested [°C]."""

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
    return Gap(
        "",
        "phase_resistance_ohm",
        "the copper loss 3 I² R(T) follows from it. Without it only --model first can be "
        "calibrated. It is measured at the terminals of the cold machine (half of what a star "
        "shows between two of them), or stands on its data sheet.",
        lines=notes,
    )


def _channel(name: str, surveys: Sequence[Survey]) -> Gap:
    sentence = WHY[name]
    if name == "losses_W":
        ways = [" and ".join(way.needs) for way in DERIVATIONS if way.channel == name]
        sentence = f"{sentence} {'; or '.join(ways)}."
    ranked = sorted(
        (
            (not one.is_likely, one.unit_from == "assumed", one.line, _note(column))
            for each in surveys
            for column in each.free
            for one in column.proposals
            if one.channel == name
            and len(one.line) <= LONGEST_LINE
            # a column whose name speaks of another channel is none of this one
            and (one.is_likely or not any(other.is_likely for other in column.proposals))
        ),
        key=lambda row: row[:2],
    )
    candidates = tuple(dict.fromkeys((line, note) for _, _, line, note in ranked))
    constants = _constants(name, surveys)
    if not candidates and not constants and name != "time_s":
        sentence += " No column has a unit or a name that speaks for it."
    return Gap(name, "", sentence, candidates[:MOST_CANDIDATES], constants)


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
            if is_room and value is not None and value == column.high and _is_room(value):
                what = "the one value of" if column.num_values == 1 else "throughout in"
                column_name = printable(flat(column.name))
                lines.append(f"# {name} = {value!r}  # {what} column '{column_name}'")
        for line in one.preamble:
            numbers = NUMBER.findall(line) if LIKELY[name].search(line) else []
            values = [float(number.replace(",", ".")) for number in numbers]
            lines += [f"# {name} = {value!r}  # from the line '{printable(flat(line))[:80]}'"
                      for value in values if _is_room(value)]  # fmt: skip
    return tuple(dict.fromkeys(lines))


def _is_room(value: float) -> bool:
    return COLDEST <= value <= HOTTEST
