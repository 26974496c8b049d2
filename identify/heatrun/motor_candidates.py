"""In which order columns are offered for a channel, by their names and by what they hold.

- Winding: copper is heated by its own loss and has little heat capacity, so its temperature moves
  the most of all; what stays while others move is none. A mean of three phases goes before each.
- Ambient: every body of the machine becomes warmer than the room, so the room is the column whose
  highest value is the lowest; what moves nearly as far as the warmest body is none.
- Phase current: an rms value is never negative; the one that moves the most with the load.
- Losses: positive in the mean. Time: never falls.

A name that speaks for the channel goes before values, unless they contradict it, as a power that is
torque·omega and a little more contradicts its name of losses. Columns that stay at one number come
last, except for the ambient, which may be one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .bench.channels.likely_names import LIKELY
from .bench.channels.schema import REQUIRED
from .bench.column_course import Course
from .bench.free_columns import Evidence

LEAST_MOVE_K = 5.0
"""Below it, temperatures of a record do not tell bodies apart [K]."""

STAYS_SHARE, DRIFTS_SHARE, FOLLOWS_SHARE = 0.05, 0.1, 0.5
"""Of the largest move [1]: what moves by less stays and is no winding; a room may drift by more
than that; what moves by more follows the load."""

WINDING_RANGE = (-60.0, 300.0)
"""No insulation lives above; an open thermocouple reads there [°C]."""

ROOM_RANGE = (-40.0, 60.0)
"""Rooms in which motors are tested [°C]."""

OFFSET_SHARE = 0.02
"""A current transducer's zero may be below 0 by this share of its largest reading [1]."""


@dataclass(frozen=True)
class Candidate:
    """A line of `[columns]` that may be a channel.

    Attributes:
        line: Right-hand side.
        shown: What its column holds, in words.
        score: How surely the name speaks for the channel, as `likely_names`.
        is_assumed: Its unit is not known.
        course: In the channel's unit; None where the values were not looked at.
        columns: Its column, or those of the three phases that it is the mean of.
        evidence: What other columns say of it, or None.
    """

    line: str
    shown: str
    score: int
    is_assumed: bool
    course: Course | None
    columns: tuple[str, ...]
    evidence: Evidence | None = None

    @property
    def is_mean(self) -> bool:
        """It is the mean of the sensors of three phases."""
        return len(self.columns) > 1

    @property
    def is_likely(self) -> bool:
        """The name speaks for the channel, or the other columns do, and for no other one."""
        return self.score >= LIKELY or (self.evidence is not None and self.evidence.is_alone)

    @property
    def move(self) -> float:
        """How far it moves, in the channel's unit."""
        return 0.0 if self.course is None else self.course.high - self.course.low


@dataclass(frozen=True)
class _Verdict:
    """What values say.

    Attributes:
        grade: 0 where they speak for the channel, 1 where they allow it, 2 where they speak
            against it, 3 where they say nothing.
        order: Among columns of one grade, the smaller first.
        words: Why.
        praise: Why, if it is the first.
    """

    grade: int
    order: float = 0.0
    words: str = ""
    praise: str = ""


@dataclass(frozen=True)
class Ranked:
    """A candidate in its place.

    Attributes:
        candidate: The candidate.
        note: What speaks for it or against it.
        is_open: Nothing speaks against it.
    """

    candidate: Candidate
    note: str
    is_open: bool


def ranked(channel: str, candidates: Sequence[Candidate]) -> list[Ranked]:
    """Return candidates with a note on each, the likely ones first, each line once.

    Args:
        channel: Canonical name.
        candidates: In the order of the files.
    """
    moves = [one.move for one in candidates if not _is_outside(WINDING_RANGE, one)]
    largest = max(moves, default=0.0)
    judged = [(one, _verdict(channel, one, largest)) for one in candidates]
    judged.sort(key=_place)
    found: dict[str, Ranked] = {}
    for one, said in judged:
        words = [one.shown]
        if len(judged) > 1 and not found:
            words += ["by its name"] if one.score >= LIKELY and not one.is_mean else []
            words.append(said.praise or said.words)
        elif len(judged) > 1 or said.grade > 1:
            words.append(said.words)
        words.append(one.evidence.words if one.evidence and one.evidence.speaks else "")
        note = "; ".join(filter(None, words))
        found.setdefault(one.line, Ranked(one, note, said.grade <= 1))
    return list(found.values())


def _place(judged: tuple[Candidate, _Verdict]) -> tuple[float, ...]:
    one, said = judged
    return (
        said.grade if said.grade > 1 else 0,
        not one.is_likely,
        -one.score if one.is_likely else 0,
        one.is_assumed,
        said.grade,
        not (one.is_mean and one.is_likely),
        said.order,
        not one.is_mean,
    )


def _verdict(channel: str, one: Candidate, largest: float) -> _Verdict:
    course = one.course
    if one.evidence is not None and not one.evidence.speaks:
        return _Verdict(2, words=one.evidence.words)
    if course is None:
        return _Verdict(1)
    if channel == "ambient_degC":
        return _ambient(one, course, largest)
    if channel == "winding_degC":
        return _winding(one, largest)
    if course.low == course.high and channel in REQUIRED:
        return _Verdict(3)
    if channel == "phase_current_A":
        if course.low < -OFFSET_SHARE * abs(course.high):
            return _Verdict(2, -one.move, "negative at times, which an rms value never is")
        return _Verdict(0, -one.move, praise="never negative, varies the most")
    if channel == "losses_W" and course.mean < 0.0:
        return _Verdict(2, words="negative in the mean")
    if channel == "time_s" and not course.is_growing:
        return _Verdict(2, words="does not grow throughout")
    return _Verdict(0)


def _winding(one: Candidate, largest: float) -> _Verdict:
    if _is_outside(WINDING_RANGE, one):
        return _Verdict(2, words=_outside(WINDING_RANGE, "windings"))
    if largest < LEAST_MOVE_K:
        return _Verdict(0, -one.move)
    if one.move == 0.0:
        return _Verdict(3)
    if one.move < STAYS_SHARE * largest:
        return _Verdict(2, -one.move, f"stays within {_kelvin(one.move)}")
    moves = f"moves by {_kelvin(one.move)}"
    return _Verdict(0, -one.move, moves, f"{moves}, the most" if one.move == largest else moves)


def _ambient(one: Candidate, course: Course, largest: float) -> _Verdict:
    if _is_outside(ROOM_RANGE, one):
        return _Verdict(2, course.high, _outside(ROOM_RANGE, "rooms"))
    if largest < LEAST_MOVE_K:
        return _Verdict(0, course.high)
    if one.move > FOLLOWS_SHARE * largest:
        return _Verdict(2, course.high, f"moves by {_kelvin(one.move)}")
    if one.move > DRIFTS_SHARE * largest:
        return _Verdict(1, course.high, f"moves by {_kelvin(one.move)}")
    if one.move == 0.0:
        return _Verdict(1, course.high)
    stays = f"stays within {_kelvin(one.move)}"
    return _Verdict(0, course.high, stays, f"{stays} and is the coldest")


def _is_outside(limits: tuple[float, float], one: Candidate) -> bool:
    low, high = limits
    return one.course is not None and not low <= one.course.low <= one.course.high <= high


def _outside(limits: tuple[float, float], of: str) -> str:
    return f"outside of the {limits[0]:g} … {limits[1]:g} °C of {of}"


def _kelvin(move: float) -> str:
    return f"{move:.2g} K" if move < 10.0 else f"{move:.0f} K"
