"""Duties as a user states them: by the duty types of IEC 60034-1, or phase by phase."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError, UsageError

CYCLE_S = 600.0
"""Length of a cycle of S3 to S7 [s]; IEC 60034-1, 4.2.3 and 4.2.6, if not agreed otherwise."""

COLUMNS = ("seconds", "current_A", "speed_rpm", "other_losses_W")
"""Columns of a duty's file; the last two may be left out."""


class Phase(NamedTuple):
    """A part of a duty over which the load stays.

    Attributes:
        seconds: Its length [s].
        current: Rms current over that which is asked for, in a file the largest of the duty [1].
        rpm: Speed; None for that of the loaded tests.
        other_W: Losses other than copper; None for those of the loaded tests.
    """

    seconds: float
    current: float
    rpm: float | None = None
    other_W: float | None = None


AT_REST = {"current": 0.0, "rpm": 0.0, "other_W": 0.0}


@dataclass(frozen=True)
class Duty:
    """A duty type of IEC 60034-1, or any other.

    Attributes:
        name: As asked for: `"S2-30"` is 30 minutes from cold, `"S3-40"` 40 % of each cycle, then
            at rest; `"S6-40"` the same, then without current at the speed of the tests.
        phases: What is repeated.
        num_cycles: Cycles until the last one counts.
        losses: What the losses are, for the condition.
        words: The duty in words, for the condition.
    """

    name: str
    phases: tuple[Phase, ...]
    num_cycles: int
    losses: str
    words: str


class _Type(NamedTuple):
    """A duty type: whether a number, a start, a braking and a rest belong to it, and its form."""

    form: str
    has_number: bool = False
    num_stated: tuple[int, int] = (0, 0)
    is_braked: bool = False
    rests: bool = False


MANY = 99
TYPES = {
    "S2": _Type("S2-MINUTES, such as S2-30, or phases from cold, such as S2:5x2,1x600", False,
                (0, MANY)),
    "S3": _Type("S3-PERCENT, such as S3-40", True, rests=True),
    "S4": _Type("S4-PERCENT:START, such as S4-40:5x2", True, (1, MANY), rests=True),
    "S5": _Type("S5-PERCENT:START,BRAKING, such as S5-40:5x2,3x1", True, (2, MANY), True, True),
    "S6": _Type("S6-PERCENT, such as S6-40", True),
    "S7": _Type("S7:START,BRAKING, such as S7:5x2,3x1", False, (2, MANY), True),
    "S8": _Type("S8:PHASE,PHASE, such as S8:1x300@3000,0.7x300@1500", False, (2, MANY)),
}  # fmt: skip
"""The duty types that are named; S1 is one phase."""

N = r"\d+(?:\.\d+)?"
NAME = re.compile(rf"(?P<kind>S[2-8])(?:-(?P<number>{N}))?(?::(?P<stated>.*))?")
PHASE = re.compile(rf"(?P<load>{N})(?P<ampere>A?)x(?P<seconds>{N})(?:@(?P<rpm>{N}))?")
PER_HOUR = re.compile(rf"(?P<cycles>{N})/h")

PHASES = (
    "A phase is LOADxSECONDS or LOADxSECONDS@RPM, its load over the current that is asked for; "
    "N/h beside them states the cycles in an hour."
)


def parse_duty(text: str, slow_s: float) -> Duty:
    """Return a duty by its name.

    Args:
        text: `"S1"`, a name in the form of `TYPES`, or the path of a CSV file with a phase of the
            cycle in each row: `COLUMNS`.
        slow_s: Slow time constant [s]; a cycled duty runs for five of them.

    Raises:
        UsageError: If the name is none of these, or its phases do not make such a duty.
        InputError: If the file is not such a duty.
    """
    if text.lower().endswith(".csv"):
        phases = _read(Path(text))
        losses = "as the file has them" if phases[0].other_W is not None else ""
        return _cycled(Path(text).stem, phases, slow_s, losses)
    if text == "S1":
        return Duty(text, (Phase(CYCLE_S, 1.0),), 1, "", text)
    found = NAME.fullmatch(text)
    if found is None:
        forms = "; ".join(each.form for each in TYPES.values())
        raise UsageError(
            f"rating {text!r}: expected S1, a CSV file of the phases of a duty, or one of: {forms}."
        )
    kind, number = found["kind"], float(found["number"] or 0.0)
    of_type = TYPES[kind]

    def wrong(what: str) -> UsageError:
        return UsageError(f"rating {text!r}: expected {of_type.form}, got {what}. {PHASES}")

    stated, per_hour = [], 0.0
    for part in (found["stated"] or "").split(",") if found["stated"] is not None else ():
        if rate := PER_HOUR.fullmatch(part):
            per_hour = float(rate["cycles"])
            continue
        phase = PHASE.fullmatch(part)
        if phase is None or phase["ampere"] or not float(phase["seconds"]):
            raise wrong(f"the phase {part!r}")
        stated.append(_phase(phase))
    if kind == "S2":
        if bool(number) == bool(stated) or per_hour:
            raise wrong("both" if number else "neither minutes nor phases")
        phases = tuple(stated) or (Phase(60.0 * number, 1.0),)
        return Duty(text, phases, 1, "", _in_words(kind, number, stated, 0.0))
    fewest, most = of_type.num_stated
    if not fewest <= len(stated) <= most:
        raise wrong(f"{len(stated)} phases")
    if of_type.has_number != bool(number) or number >= 100.0:
        raise wrong(f"{number:g} %" if found["number"] else "no share of the cycle")
    if kind == "S8":
        if per_hour:
            raise wrong("cycles in an hour beside all phases")
        phases = tuple(stated)
    else:
        cycle = 3600.0 / per_hour if per_hour else CYCLE_S
        on = cycle * number / 100.0 if number else cycle
        running = on - sum(phase.seconds for phase in stated)
        if running <= 0.0:
            raise wrong(f"phases that leave nothing of {on:g} s under load")
        start, brake = stated, []
        if of_type.is_braked:
            start, brake = stated[:-1], stated[-1:]
        after = [Phase(cycle - on, **(AT_REST if of_type.rests else {"current": 0.0}))]
        phases = (*start, Phase(running, 1.0), *brake, *(after if number else []))
    if not any(phase.current for phase in phases):
        raise wrong("no load in any phase")
    return _cycled(text, phases, slow_s, "", _in_words(kind, number, stated, per_hour))


def _phase(found: re.Match[str]) -> Phase:
    """Return a phase; one without load and speed is at rest."""
    seconds, load = float(found["seconds"]), float(found["load"])
    if not load and not float(found["rpm"] or 0.0):
        return Phase(seconds, **AT_REST)
    return Phase(seconds, load, None if found["rpm"] is None else float(found["rpm"]))


def _in_words(kind: str, number: float, stated: list[Phase], per_hour: float) -> str:
    """Return a duty in the words of the sheet."""
    name = f"{kind}-{number:g}" if number else kind
    rate = [f"{per_hour:g} cycles an hour"] if per_hour else []
    return ", ".join([name, *map(phase_words, stated), *rate])


def phase_words(phase: Phase, unit: str = "times the current") -> str:
    """Return a phase in the words of the sheet."""
    at = "" if phase.rpm is None else f" at {phase.rpm:g} rpm"
    if not phase.current:
        return f"{phase.seconds:g} s without current{at}"
    return f"{phase.current:g} {unit} for {phase.seconds:g} s{at}"


def _cycled(
    name: str, phases: tuple[Phase, ...], slow_s: float, losses: str, words: str = ""
) -> Duty:
    cycle = sum(phase.seconds for phase in phases)
    return Duty(name, phases, max(2, round(5 * slow_s / cycle)), losses, words or name)


def _read(path: Path) -> tuple[Phase, ...]:
    """Return the phases of a duty's file, by the largest of its currents."""
    import pandas as pd

    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(
            f"the duty cannot be read: {error}", where=str(path),
            remedy=f"Write a CSV file with the columns {', '.join(COLUMNS)}.",
        ) from None  # fmt: skip
    found = [name for name in COLUMNS if name in table]
    numbers = table.apply(pd.to_numeric, errors="coerce").to_numpy(float)
    is_known = set(COLUMNS[:2]) <= set(found) == set(table.columns)
    if not is_known or not numbers.size or not np.all(np.isfinite(numbers)):
        raise InputError(
            f"expected numbers in the columns {', '.join(COLUMNS)} (the last two may be left out), "
            f"got the columns {', '.join(map(str, table.columns))} and {len(table)} rows.",
            where=str(path),
            remedy="Write one row for each phase of the cycle.",
        )
    largest = float(table["current_A"].abs().max())
    if not largest > 0.0 or not (table["seconds"] > 0.0).all():
        raise InputError(
            "a duty needs a current in one phase, and phases of more than 0 s.",
            where=str(path),
            remedy="Write the rms current of each phase [A] and its length [s].",
        )
    return tuple(
        Phase(
            row["seconds"], abs(row["current_A"]) / largest,
            row.get("speed_rpm", None if row["current_A"] else 0.0),
            row.get("other_losses_W", None if row["current_A"] else 0.0),
        )
        for row in table.to_dict("records")
    )  # fmt: skip
