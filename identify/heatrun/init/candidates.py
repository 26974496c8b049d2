"""The columns of files that may be a channel, in the order in which they are offered."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from ..readers.likely_names import LIKELY, SURE
from ..record.channels import REQUIRED
from ..record.motor import COEFFICIENTS_degC
from .free_columns import Course, Evidence, FreeColumn, Proposal
from .phase_means import MADE_OF_PHASES, PhaseMean
from .survey import Survey

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

AT_REST = frozenset(("mechanical_power_W", "torque_Nm", "speed_rpm"))
ZERO = {**dict.fromkeys(AT_REST, "where the rotor stands"),
        "i_d_A": "where the field is not weakened"}  # fmt: skip
"""Channels that nobody records where they are 0, with when they are."""

NEAR_THE_WINDING = frozenset(("winding_degC", "winding_resistance_ohm", "end_winding_degC",
                              "stator_degC", "tooth_degC", "yoke_degC"))  # fmt: skip
"""Bodies whose sensor may stand for the winding's where there is no other."""

COLD_DEGC = 20.0
"""What a winding is taken to have where its resistance is least, to judge a column of ohms [°C]."""


@dataclass(frozen=True)
class Candidate:
    """A line of `[columns]` that may be a channel."""

    line: str  # Right-hand side.
    shown: str  # What its column holds, in words.
    score: int  # How surely the name speaks for the channel, as `likely_names`.
    is_assumed: bool  # Its unit is not known.
    course: Course | None  # In the channel's unit; None where the values were not looked at.
    columns: tuple[str, ...]  # Its column, or those of the three phases that it is the mean of.
    evidence: Evidence | None = None  # What other columns say of it, or None.
    note: str = ""  # What speaks for it or against it; `ranked` says it.
    is_open: bool = True  # Nothing speaks against it.

    @property
    def is_mean(self) -> bool:
        """It is the mean of the sensors of three phases, or their sum."""
        return len(self.columns) > 1

    @property
    def is_likely(self) -> bool:
        """The name speaks for the channel, or the other columns do, and for no other one."""
        return self.score >= LIKELY or (self.evidence is not None and self.evidence.is_alone)

    @property
    def move(self) -> float:
        """How far it moves, in the channel's unit."""
        return 0.0 if self.course is None else self.course.high - self.course.low


def candidates(name: str, surveys: Iterable[Survey]) -> list[Candidate]:
    """Return the columns of files that may be a channel, and the means of three of them."""
    return [each for one in surveys for each in _candidates(name, one)]


def _candidates(name: str, one: Survey) -> Iterator[Candidate]:
    held: dict[str, Candidate] = {}
    for column in one.free:
        proposal = proposal_of(name, column)
        # a speed of 0 may have been measured, a current of 0 is none
        is_held = bool(column.num_values) if name in ZERO else not column.is_silent
        if proposal is not None and is_held:
            is_assumed = all(one.unit_from == "assumed" for one in column.proposals)
            check_unit = f"; read in {proposal.unit}: check the unit" if is_assumed else ""
            held[column.name] = Candidate(
                proposal.line,
                f"{column.shown()}{check_unit}",
                proposal.score,
                proposal.unit_from == "assumed",
                _course(column, proposal),
                (column.name,),
                column.evidence.get(name),
            )
    yield from (_mean(mean, held) for mean in one.means if mean.channel == name)
    yield from held.values()
    for each in one.recognised if name == "winding_degC" else ():
        if each.channel == "end_winding_degC":
            note = "recognised as end_winding_degC, a part of the winding"
            yield Candidate(each.column, note, LIKELY, False, None, (each.column,))
    for column in one.free if name == "winding_degC" else ():
        end = column.read_as("end_winding_degC")
        if end is not None and end.is_likely and not column.is_silent:
            note = f"{column.shown()}; the end winding by its name, a part of the winding"
            yield Candidate(end.line, note, LIKELY, False, None, (column.name,))


def proposal_of(name: str, column: FreeColumn) -> Proposal | None:
    """Return how a column may be a channel; one whose name speaks of another is none of it."""
    is_others = any(one.is_likely for one in column.proposals)
    of_others = (each for channel, each in column.evidence.items() if channel != name)
    if name in ZERO and any(each.is_alone for each in of_others):
        return None
    speaks = name in column.evidence and column.evidence[name].speaks
    # many a body warms with the load: a sure name says which
    named = {one.channel for one in column.proposals if one.score >= SURE}
    speaks &= name != "winding_degC" or named <= NEAR_THE_WINDING
    for one in column.proposals:
        is_winding = name == "winding_degC" and one.channel == "winding_resistance_ohm"
        if (one.channel == name or is_winding) and (one.is_likely or speaks or not is_others):
            return one
    return None


OF_PHASES = Evidence(True, "three wattmeters beside three currents", is_alone=True)


def _mean(mean: PhaseMean, held: Mapping[str, Candidate]) -> Candidate:
    parts = [held[name] for name in mean.columns]
    return Candidate(
        mean.line,
        "three columns that move together",
        max(part.score for part in parts),
        any(part.is_assumed for part in parts),
        max(parts, key=lambda part: part.move).course,
        mean.columns,
        evidence=OF_PHASES if MADE_OF_PHASES[mean.channel] == "sum" else None,
    )


def _course(column: FreeColumn, proposal: Proposal) -> Course | None:
    """Return the course in the channel's unit; of a resistance the temperature of its copper."""
    course = column.course
    if course is None or proposal.channel != "winding_resistance_ohm":
        return course and course.read_as(proposal)
    B = COEFFICIENTS_degC["copper"]
    return course.converted((B + COLD_DEGC) / course.low, -B) if course.low > 0.0 else None


@dataclass(frozen=True)
class _Verdict:
    """What values say."""

    # 0 where they speak for the channel, 1 where they allow it, 2 where they speak against it, 3
    # where they say nothing.
    grade: int
    order: float = 0.0  # Among columns of one grade, the smaller first.
    words: str = ""  # Why.
    praise: str = ""  # Why, if it is the first.


def ranked(channel: str, found: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates with a note on each, the likely ones first, each line once.

    - Winding: copper is heated by its own loss and has little heat capacity, so its temperature
      moves the most of all; what stays while others move is none. A mean of three phases goes
      before each.
    - Ambient: every body of the machine becomes warmer than the room, so the room is the column
      whose highest value is the lowest; what moves nearly as far as the warmest body is none.
    - Phase current: an rms value is never negative; the one that moves the most with the load.
    - Losses: positive in the mean. Time: never falls.

    A name that speaks for the channel goes before values, unless they contradict it, as a power
    that is torque·omega and a little more contradicts its name of losses. Columns that stay at one
    number come last, except for the ambient, which may be one.
    """
    moves = [one.move for one in found if not _is_outside(WINDING_RANGE, one)]
    largest = max(moves, default=0.0)
    judged = [(one, _verdict(channel, one, largest)) for one in found]
    judged.sort(key=_place)
    by_line: dict[str, Candidate] = {}
    for one, said in judged:
        words = [one.shown]
        if len(judged) > 1 and not by_line:
            words += ["by its name"] if one.score >= LIKELY and not one.is_mean else []
            words.append(said.praise or said.words)
        elif len(judged) > 1 or said.grade > 1:
            words.append(said.words)
        words.append(one.evidence.words if one.evidence and one.evidence.speaks else "")
        note = "; ".join(filter(None, words))
        by_line.setdefault(one.line, replace(one, note=note, is_open=said.grade != 2))
    return list(by_line.values())


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
        return _ambient(one, course.high, largest)
    if channel == "winding_degC":
        return _winding(one, largest)
    if channel == "time_s" and not course.is_growing:
        return _Verdict(2, words="does not grow throughout")
    if course.low == course.high and channel in REQUIRED:
        return _Verdict(3)
    if channel == "phase_current_A":
        if course.low < -OFFSET_SHARE * abs(course.high):
            return _Verdict(2, -one.move, "negative at times, which an rms value never is")
        return _Verdict(0, -one.move, praise="never negative, varies the most")
    if channel == "losses_W" and course.mean < 0.0:
        return _Verdict(2, words="negative in the mean")
    return _Verdict(0)


def _winding(one: Candidate, largest: float) -> _Verdict:
    if _is_outside(WINDING_RANGE, one):
        return _Verdict(2, words=_outside(WINDING_RANGE, "windings"))
    if largest < LEAST_MOVE_K:
        return _Verdict(0, -one.move)
    if one.move < STAYS_SHARE * largest:
        return _Verdict(2, -one.move, f"stays within {_kelvin(one.move)}")
    moves = f"moves by {_kelvin(one.move)}"
    return _Verdict(0, -one.move, moves, f"{moves}, the most" if one.move == largest else moves)


def _ambient(one: Candidate, highest: float, largest: float) -> _Verdict:
    if _is_outside(ROOM_RANGE, one):
        return _Verdict(2, highest, _outside(ROOM_RANGE, "rooms"))
    if largest < LEAST_MOVE_K:
        return _Verdict(0, highest)
    if one.move > DRIFTS_SHARE * largest:
        is_following = one.move > FOLLOWS_SHARE * largest
        return _Verdict(2 if is_following else 1, highest, f"moves by {_kelvin(one.move)}")
    if one.move == 0.0:
        return _Verdict(1, highest)
    stays = f"stays within {_kelvin(one.move)}"
    return _Verdict(0, highest, stays, f"{stays} and is the coldest")


def _is_outside(limits: tuple[float, float], one: Candidate) -> bool:
    low, high = limits
    return one.course is not None and not low <= one.course.low <= one.course.high <= high


def _outside(limits: tuple[float, float], of: str) -> str:
    return f"outside of the {limits[0]:g} … {limits[1]:g} °C of {of}"


def _kelvin(move: float) -> str:
    return f"{move:.2g} K" if move < 10.0 else f"{move:.0f} K"


def is_room(degC: float) -> bool:
    """Return whether a room in which motors are tested may have a temperature [°C]."""
    return ROOM_RANGE[0] <= degC <= ROOM_RANGE[1]
