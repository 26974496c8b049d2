"""Duties as a user states them: by the duty types of IEC 60034-1, or phase by phase.

Where their current is stated, the time to the limit or the number of starts is sought; else the
current.
"""

import re
from collections.abc import Collection, Mapping, Sequence
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
    """A part of a duty over which the load stays."""

    seconds: float  # Its length [s].
    # Rms current over that which is asked for, in a file the largest of the duty [1].
    current: float
    rpm: float | None = None  # Speed; None for that of the loaded tests.
    other_W: float | None = None  # Losses other than copper; None for those of the loaded tests.


STANDING = {"current": 0.0, "rpm": 0.0, "other_W": 0.0}


@dataclass(frozen=True)
class Duty:
    """A duty type of IEC 60034-1, or any other."""

    # As asked for: `"S2-30"` is 30 minutes from cold, `"S3-40"` 40 % of each cycle, then at rest;
    # `"S6-40"` the same, then without current at the speed of the tests.
    name: str
    phases: tuple[Phase, ...]  # What is repeated.
    num_cycles: int  # Cycles until the last one counts.
    losses: str  # What the losses are, for the condition.
    words: str  # The duty in words, for the condition.


class Stated(NamedTuple):
    """A load whose current is stated: held, or started in succession, until the limit."""

    name: str  # As asked for, without what is sought.
    # Their `current` in amperes; of a load that is held, one of any length.
    phases: tuple[Phase, ...]
    # `"cold"`, `"hot"`, the winding's temperature [degC], or that of each node; None for starts,
    # from cold and from hot.
    start: str | float | Mapping[str, float] | None


TYPES = {
    "S2": ("S2-MINUTES or S2:PHASES from cold, such as S2-30 or S2:5x2,1x600", True, 0, 0, None),
    "S3": ("S3-PERCENT, such as S3-40", True, 0, 0, STANDING),
    "S4": ("S4-PERCENT:START, such as S4-40:5x2", True, 1, 0, STANDING),
    "S5": ("S5-PERCENT:START,BRAKING, such as S5-40:5x2,3x1", True, 2, 1, STANDING),
    "S6": ("S6-PERCENT, such as S6-40", True, 0, 0, {"current": 0.0}),
    "S7": ("S7:START,BRAKING, such as S7:5x2,3x1", False, 2, 1, None),
    "S8": ("S8:PHASE,PHASE, such as S8:1x300@3000,0.7x300@1500", False, 2, 0, None),
}
"""The duty types that are named: how, whether a number belongs to them, the fewest phases that are
stated, how many of these come after the load, and what ends a cycle."""

N = r"(?:\d+(?:\.\d+)?)"
MORE = rf"(?=[\d.]*[1-9]){N}"
NAME = re.compile(rf"(S[2-8])(?:-({MORE}))?(?::(.+))?")
PHASE = re.compile(rf"(?P<load>{N})(?P<ampere>A?)x(?P<seconds>{MORE})(?:@(?P<rpm>{N}))?")
PER_HOUR = re.compile(rf"({MORE})/h")
AT_NODE = re.compile(rf"(\w+)=(-?{N})")

PHASES = (
    "A phase is LOADxSECONDS or LOADxSECONDS@RPM, its load over the current that is asked for; "
    "N/h beside phases states the cycles in an hour."
)
STATED = (
    "time:LOAD or time:LOAD:START, such as time:150A, time:150A:hot, time:1.2:80 (°C of the "
    "winding) or time:150A:winding=80,stator=60; or starts:PHASES, such as starts:600Ax5@0 with "
    "the locked-rotor current for 5 s at 0 rpm, or starts:6x5,0x30 with 30 s of rest between"
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

    def cycled(name: str, phases: tuple[Phase, ...], losses: str, words: str) -> Duty:
        cycle = sum(phase.seconds for phase in phases)
        return Duty(name, phases, max(2, round(5 * slow_s / cycle)), losses, words)

    if text.lower().endswith(".csv"):
        phases, name = _read(Path(text)), Path(text).stem
        losses = "as the file has them" if phases[0].other_W is not None else ""
        return cycled(name, phases, losses, name)
    if text == "S1":
        return Duty(text, (Phase(CYCLE_S, 1.0),), 1, "", text)
    kind = text[:2]
    if kind not in TYPES:
        raise UsageError(
            f"rating {text!r}: expected S1, a CSV file of the phases of a duty, "
            f"{'; '.join(form for form, *_ in TYPES.values())}; {STATED}."
        )
    form, has_number, fewest, num_after, rest = TYPES[kind]
    wrong = UsageError(f"rating {text!r}: expected {form}. {PHASES}")
    if (found := NAME.fullmatch(text)) is None:
        raise wrong
    number, cycle, stated, rate = float(found[2] or 0.0), CYCLE_S, list[Phase](), list[str]()
    for part in found[3].split(",") if found[3] else ():
        phase = PHASE.fullmatch(part)
        if phase is not None and not phase["ampere"]:
            stated.append(_phase(phase, 1.0))
        elif (per_hour := PER_HOUR.fullmatch(part)) and kind not in ("S2", "S8"):
            cycle, rate = 3600.0 / float(per_hour[1]), [f"{per_hour[1]} cycles an hour"]
        else:
            raise UsageError(f"{wrong} Got {part!r}.")
    words = ", ".join([text.partition(":")[0], *map(phase_words, stated), *rate])
    if kind == "S2" and bool(number) != bool(stated):
        return Duty(text, tuple(stated) or (Phase(60.0 * number, 1.0),), 1, "", words)
    on = 0.01 * number * cycle if number else cycle
    running = on - sum(phase.seconds for phase in stated)
    is_such = bool(number) == has_number and number < 100.0 and kind != "S2"
    if not is_such or len(stated) < fewest or (stated and not fewest):
        raise wrong
    if kind != "S8":
        if running <= 0.0:
            raise UsageError(f"{wrong} These leave nothing of {on:g} s under load.")
        at = len(stated) - num_after
        stated[at:at] = [Phase(running, 1.0)]
        stated += [Phase(cycle - on, **rest)] if rest else []
    if not any(phase.current for phase in stated):
        raise UsageError(f"{wrong} No phase has a load.")
    return cycled(text, tuple(stated), "", words)


def parse_rating(
    text: str, slow_s: float, rated_A: float | None, nodes: Sequence[Collection[str]] = ()
) -> Duty | Stated:
    """Return what is asked for by `--rating`.

    Args:
        text: As `parse_duty`, or in the forms of `STATED`; their loads are in amperes, or over the
            rated current.
        slow_s: As `parse_duty`.
        rated_A: Rated current [A]; None where the motor file gives none.
        nodes: Of each network that it is asked of; not looked at where none are given.

    Raises:
        UsageError: As `parse_duty`, and for start temperatures of nodes that no network has.
        InputError: Likewise.
    """
    sought, _, name = text.partition(":")
    if sought not in ("time", "starts"):
        return parse_duty(text, slow_s)
    parts, start = name.split(","), None
    if sought == "time":
        load, _, said = name.partition(":")
        # a load that is held is a phase of any length
        parts, start, name = [f"{load}x1"], _start(said), f"{load}_{said or 'cold'}"
        if nodes and (why := other_nodes(start, nodes)):
            raise UsageError(f"rating {text!r}: {why}.")
    phases = []
    for found in map(PHASE.fullmatch, parts):
        if found is None or (start is None and sought == "time"):
            raise UsageError(f"rating {text!r}: expected {STATED}.")
        if rated_A is None and not found["ampere"] and float(found["load"]):
            raise UsageError(
                f"rating {text!r}: expected currents in A, such as 150A, got {found['load']} times "
                "a rated current that is not stated: give [motor] rated_current_A."
            )
        phases.append(_phase(found, 1.0 if found["ampere"] else rated_A or 0.0))
    if not any(phase.current for phase in phases):
        raise UsageError(f"rating {text!r}: expected a load, got none. Such as {STATED}.")
    return Stated(name, tuple(phases), start)


def other_nodes(
    start: str | float | Mapping[str, float] | None, nodes: Sequence[Collection[str]]
) -> str:
    """Return why a start fits none of the networks of these nodes; empty where it fits one."""
    if not isinstance(start, Mapping) or set(start) in map(set, nodes):
        return ""
    each, got = ", or ".join(map(" and ".join, nodes)), " and ".join(start)
    return f"expected start temperatures of {each}, got {got}"


def _start(said: str) -> str | float | Mapping[str, float] | None:
    """Return the state that a time counts from; None for a text that says none."""
    if said in ("", "cold", "hot"):
        return said or "cold"
    if re.fullmatch(f"-?{N}", said):
        return float(said)
    found = [AT_NODE.fullmatch(part) for part in said.split(",")]
    return None if None in found else {each[1]: float(each[2]) for each in found if each}


def _phase(found: re.Match[str], unit: float) -> Phase:
    """Return a phase with its load in a unit; one without load and speed is at rest."""
    seconds, load, rpm = float(found["seconds"]), unit * float(found["load"]), found["rpm"]
    if not load and not float(rpm or 0.0):
        return Phase(seconds, **STANDING)
    return Phase(seconds, load, None if rpm is None else float(rpm))


def phase_words(phase: Phase, unit: str = "times the current") -> str:
    """Return a phase in the words of the sheet."""
    at = "" if phase.rpm is None else f" at {phase.rpm:g} rpm"
    if not phase.current:
        return f"{phase.seconds:g} s without current{at}"
    return f"{phase.current:g} {unit} for {phase.seconds:g} s{at}"


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
            # a shaft that turns has its iron and friction without current too
            row.get("other_losses_W", None if row["current_A"] or row.get("speed_rpm") else 0.0),
        )
        for row in table.to_dict("records")
    )  # fmt: skip
