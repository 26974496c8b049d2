"""What tests do not say and a calibration needs: why it matters, and where it may come from.

Columns are offered in an order (`ranked`), a resistance as the head or scalars of a file state it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..io.quantities import printable
from ..readers.likely_names import LIKELY, SURE, read_name
from ..readers.read import name_of_test
from ..record.by_resistance import QUOTIENTS, tells_winding
from ..record.channels import CHANNEL, REQUIRED
from ..record.derive import DERIVATIONS, ELECTRICAL, Derivation
from ..record.motor import COEFFICIENTS_degC
from ..record.units import find_unit
from .free_columns import Course, Evidence, FreeColumn, Proposal, flat
from .phase_means import PhaseMean
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
        found.setdefault(one.line, Ranked(one, note, said.grade != 2))
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


NUMBER = r"[+-]?[0-9]{1,6}(?:[.,][0-9]+)?(?:[eE][+-]?[0-9]{1,2})?(?![\w.,]*[0-9])"
OHM = r"(?P<{0}>(?-i:[mMµμuk]?)(?:ohms?|[Ω\u2126])(?![a-z]))"
DEGREES = r"(?:°\s?C|deg\s?C|℃|C\b)"

SYMBOL = (
    r"R_?s(?:0|_?20|_?25)?|R_?ph(?:ase)?(?:_?20|_?25)?|R_?str(?:ang)?(?:_?20|_?25)?|R_?(?:20|25)"
)
WORDS = (
    r"phase resistance|resistance per phase|stator resistance|phasenwiderstand|strangwiderstand"
    r"|statorwiderstand|st[äa]nderwiderstand|resistenza (?:di|per) fase"
    r"|resistenza (?:di statore|statorica)|r[ée]sistance (?:de|par) phase"
    r"|r[ée]sistance statorique|resistencia de fase"
)
AT = rf"(?:bei|at|a|à|@)\s*{NUMBER}\s*{DEGREES}"
STATED = re.compile(
    rf"(?<![\w.])(?P<name>(?:(?:{WORDS})\s*)?(?:{SYMBOL})|{WORDS})(?!\w)"
    rf"(?P<between>(?:\s*(?:\([^()]*\)|\[[^\[\]]*\]|{AT}))*)"
    rf"[\s:=;,|]*(?P<number>{NUMBER})[\s;,|]*(?:{OHM.format('unit')})?",
    re.IGNORECASE,
)
"""Name, what stands between it and the number in brackets or as "at 20 °C", number and unit."""

OTHER = re.compile(
    r"terminal|klemme|line.?to.?line|line.?line|verkettet|concatenat|insulat|isol|shunt|between"
    r"|zwischen|morsett|bornes",
    re.IGNORECASE,
)
IN_BRACKET = re.compile(OHM.format("unit"), re.IGNORECASE)
AT_DEGREES = re.compile(rf"({NUMBER})\s*{DEGREES}", re.IGNORECASE)
BEHIND = re.compile(rf"\s*(?:bei|at|a|à|@|\()\s*({NUMBER})\s*{DEGREES}", re.IGNORECASE)
IN_NAME = re.compile(r"(20|25)$")
REFERENCE = re.compile(
    r"(?<![\w.])(?:Ts|T_?ref|T_?rif|reference temp(?:erature)?|Bezugstemperatur"
    rf"|Referenztemperatur|temperatura di riferimento)[\s:=;,|]*({NUMBER})[\s;,|]*{DEGREES}",
    re.IGNORECASE,
)
"""The temperature in a line of its own; `Ts` is that of `Rs` on the worksheet of the thesis."""

SCALAR = re.compile(rf"{SYMBOL}|phase_resistance(?:_ohm)?", re.IGNORECASE)
SCALAR_REFERENCE = re.compile(r"T_?ref|T_?rif|reference_temperature(?:_degC)?", re.IGNORECASE)

FACTORS = {"m": 1e-3, "µ": 1e-6, "μ": 1e-6, "u": 1e-6, "k": 1e3, "M": 1e6}
LEAST_OHM, MOST_OHM = 1e-6, 1e3
"""Phases of the largest generators and of the smallest motors [Ω]."""

COLDEST, HOTTEST = -60.0, 250.0
"""Temperatures at which a resistance may have been measured [°C]."""

Stated = tuple[float, str]
"""A value and where it stands."""


def stated_resistance(surveys: Sequence[Survey]) -> dict[str, dict[float, str]]:
    """Return values of `[winding]` by their key, with where each stands; none without a resistance.

    Heads are written by hand: `Rs: 0.0062 ohm`, `Phasenwiderstand R20 = 6,2 mΩ`. A resistance
    between terminals, of the insulation or of a shunt is none of the phase.

    Args:
        surveys: What the files hold.
    """
    found: dict[str, dict[float, str]] = {
        "phase_resistance_ohm": {},
        "reference_temperature_degC": {},
    }
    ohms, degrees = found.values()
    for one in surveys:
        for (value, where), temperature in (*_in_head(one.preamble), *_in_scalars(one)):
            ohms.setdefault(value, where)
            if temperature is not None:
                degrees.setdefault(temperature, where)
    for one in () if ohms else surveys:
        for column, evidence in under_direct_current(one):
            if evidence.cold:
                ohm, degC = (float(f"{value:.5g}") for value in evidence.cold)
                began = f"the start, '{flat(column.name)}' over the current"
                ohms.setdefault(ohm, began)
                degrees.setdefault(degC, "the start, if the winding was as cold as the room")
    if not ohms:
        return {}
    for one in surveys:
        for value, where in _references(one):
            degrees.setdefault(value, where)
    return found


def under_direct_current(one: Survey) -> Iterator[tuple[FreeColumn, Evidence]]:
    """Yield the columns of a file that are the voltage of a winding under direct current."""
    for column in one.free:
        evidence = column.evidence.get("winding_voltage_V")
        if evidence is not None and evidence.speaks:
            yield column, evidence


def stated_ohms(surveys: Sequence[Survey]) -> list[float]:
    """Return the phase resistances that the tests state [Ω]."""
    return list(stated_resistance(surveys).get("phase_resistance_ohm", ()))


def _in_head(lines: Sequence[str]) -> Iterator[tuple[Stated, float | None]]:
    """Yield each resistance [Ω] and its temperature [°C] where the line has one."""
    for line in lines:
        if OTHER.search(line):
            continue
        for found in STATED.finditer(line):
            in_bracket = IN_BRACKET.search(found["between"])
            unit = found["unit"] or (in_bracket["unit"] if in_bracket else "")
            # to 12 digits: 6.2 mΩ are 0.0062 Ω, and not the double next to it
            value = float(f"{_number(found['number']) * FACTORS.get(unit[:1], 1.0):.12g}")
            doubt = "" if unit else ", no unit given"
            if LEAST_OHM <= value <= MOST_OHM:
                yield (value, f"{_quoted(line)}{doubt}"), _temperature(found, line)


def _temperature(found: re.Match[str], line: str) -> float | None:
    inside = AT_DEGREES.search(found["between"])
    stated = inside or BEHIND.match(line, found.end()) or IN_NAME.search(found["name"])
    return next(_temperatures([stated[1]] if stated else []), None)


def _in_scalars(one: Survey) -> Iterator[tuple[Stated, float | None]]:
    for name, value in (one.constants or {}).items():
        if SCALAR.fullmatch(name) and LEAST_OHM <= value <= MOST_OHM:
            where = f"scalar '{printable(flat(name))}' of {_file(one)}, no unit given"
            yield (value, where), None


def _references(one: Survey) -> Iterator[Stated]:
    """Yield each reference temperature [°C] that stands apart from its resistance."""
    for line in one.preamble:
        for value in _temperatures(REFERENCE.findall(line)):
            yield value, _quoted(line)
    for name, value in (one.constants or {}).items():
        if SCALAR_REFERENCE.fullmatch(name) and COLDEST < value < HOTTEST:
            yield value, f"scalar '{printable(flat(name))}' of {_file(one)}"


def _temperatures(texts: Sequence[str]) -> Iterator[float]:
    values = (_number(text) for text in texts)
    return (value for value in values if COLDEST < value < HOTTEST)


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _quoted(line: str) -> str:
    return f"the line '{printable(flat(line))[:80]}'"


def _file(one: Survey) -> str:
    return printable(flat(Path(one.path).name))


WHY = {
    "time_s": "no sample has a time. Name the column of times, or the sampling rate: "
    'time_s = "rate 10 Hz".',
    "phase_current_A": "the copper loss, which heats the winding itself, follows from the current.",
    "losses_W": "the heat that the temperatures answer to: a column of them, or the power that "
    "goes in ({}) less the shaft's (mechanical_power_W, or torque_Nm and speed_rpm; where it "
    "stands, speed_rpm = 0 under [constants]).",
    "ambient_degC": "heat flows by the difference to it. Name its column, or write its mean under "
    '[constants]; a liquid-cooled machine takes sink = "coolant" under [motor].',
    "winding_degC": "it is what the network is fitted to. The winding's resistance in ohm will do.",
}
"""Why a channel that a calibration needs matters."""

ANY_NUMBER = re.compile(r"(?<![\w.,])[+-]?[0-9]{1,4}(?:[.,][0-9]+)?(?![\w.,]*[0-9])")
AT_REST = frozenset(("mechanical_power_W", "torque_Nm", "speed_rpm"))
ZERO = {**dict.fromkeys(AT_REST, "where the rotor stands"),
        "i_d_A": "where the field is not weakened"}  # fmt: skip
"""Channels that nobody records where they are 0, with when they are."""

NEAR_THE_WINDING = frozenset(("winding_degC", "winding_resistance_ohm", "end_winding_degC",
                              "stator_degC", "tooth_degC", "yoke_degC"))  # fmt: skip
"""Bodies whose sensor may stand for the winding's where there is no other."""

NUMBERS = {"time_s": "10", "ambient_degC": "22.0"}
"""Channels that a number may take the place of, with an example [Hz, °C]."""

COLD_DEGC = 20.0
"""What a winding is taken to have where its resistance is least, to judge a column of ohms [°C]."""

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
        candidates: Right-hand sides of `[columns]` with a note on each, the best first; of several
            loggers the best of each before the others.
        constants: Lines of `[constants]`, commented.
        lines: Further lines of comment at the key.
        best: Right-hand sides of which the tests need one each, in the order of the tests; empty
            where what speaks for the first candidate is contradicted.
        of_tests: By file those for which the first of `best` that it has is another channel.
        is_zero: A column that is read for it holds 0 throughout, which may have been measured.
        is_of_some: Other tests have the channel, or another of `best`.
        number: Example of a number that takes the place of a column, or empty.
    """

    channel: str
    key: str
    sentence: str
    candidates: tuple[tuple[str, str], ...] = ()
    constants: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()
    best: tuple[str, ...] = ()
    of_tests: Mapping[str, str] = field(default_factory=dict)
    is_zero: bool = False
    is_of_some: bool = False
    number: str = ""

    @property
    def place(self) -> str:
        """Where it is to be written."""
        is_column = self.candidates or not self.number or self.channel == "time_s"
        section = "columns" if is_column else "constants"
        return f"[{section}] {self.channel}" if self.channel else f"[winding] {self.key}"

    @property
    def is_answered(self) -> bool:
        """The tests themselves say what may stand there, for a person to check."""
        return bool(self.best or self.constants or self.is_zero)


def gaps(surveys: Sequence[Survey]) -> tuple[Gap, ...]:
    """Return what tests leave out, in the order of the motor file.

    A channel is missing if a test has it neither as a column nor by a formula. Where a formula of
    columns that are there says more than the best column, its channels are the missing ones.

    Args:
        surveys: What the files hold; those of one test bear its name.
    """
    tests: dict[str, list[Survey]] = {}
    for one in surveys:
        tests.setdefault(one.test or one.path, []).append(one)
    silent = {each.channel for one in surveys for each in one.silent}
    somewhere = frozenset().union(*(one.channels for one in surveys))
    wanted: dict[str, dict[str, str]] = {}
    for test, files in tests.items():
        have = frozenset().union(*(one.channels for one in files))
        # zeros of a test beside one that has the channel were measured
        have |= {name for name in silent if name in somewhere}
        have |= {"winding_degC"} if tells_winding(have) else set()
        for name in REQUIRED:
            for need, formula in _needed(name, files, have) if name not in have else ():
                wanted.setdefault(need, {})[test] = formula
    found = [] if found_resistance(surveys) else [_resistance(surveys)]
    if "phase_current_A" in _zeros(surveys) - somewhere:  # no copper loss
        found = [replace(gap, is_zero=True) for gap in found]
    order = [*REQUIRED, *(name for name in CHANNEL if name not in REQUIRED)]
    return (*found, *(_channel(name, wanted[name], tests) for name in order if name in wanted))


def _zeros(surveys: Sequence[Survey]) -> set[str]:
    return {each.channel for one in surveys for each in one.silent if not each.is_empty}


def _needed(name: str, files: Sequence[Survey], have: Set[str]) -> list[tuple[str, str]]:
    """Return the channels that lead to one that is missing, each with the formula, or itself."""
    direct = _best(name, files)
    score = direct.candidate.score if direct else 0
    if score >= (LIKELY if name in ("losses_W", "winding_degC") else SURE):
        return [(name, "")]
    if name == "winding_degC":
        is_moved = direct is not None and direct.candidate.move >= LEAST_MOVE_K
        known = () if is_moved else QUOTIENTS
    else:
        known = [way for way in DERIVATIONS if way.channel == name and way.is_general]
    ways = [_way(way, files, have) for way in known]
    # what needs the fewest numbers of a person, then the fewest columns
    told = sorted((way for way in ways if way), key=lambda way: (way[0], len(way[1])))
    return told[0][1] if told else [(name, "")]


def _way(
    way: Derivation, files: Sequence[Survey], have: Set[str]
) -> tuple[int, list[tuple[str, str]]] | None:
    """Return how many numbers a formula asks for, and its missing channels; None if it is none."""
    found: dict[str, Ranked] = {}
    at_rest = 0
    for need in (need for need in way.needs if need not in have):
        one = _best(need, files)
        is_told = one is not None and (one.candidate.is_likely or _is_only(need, files))
        is_taken = one is not None and one.candidate.columns in (
            other.candidate.columns for other in found.values()
        )
        if one is not None and is_told and not is_taken:
            found[need] = one
        elif need in ZERO:
            at_rest += 1  # without a shaft recorded, the rotor may have stood
        else:
            return None
    is_turning = bool(AT_REST & (have | found.keys()))
    is_sure = all(one.candidate.is_likely for one in found.values())
    is_fed = bool(found or {*way.needs} & have - ZERO.keys())
    if not is_fed or (at_rest and (is_turning or not is_sure)):
        return None
    return at_rest, [(need, way.formula) for need in way.needs if need not in have]


def _is_only(name: str, files: Sequence[Survey]) -> bool:
    return sum(1 for one in files for _ in _candidates(name, one)) == 1


def _best(name: str, files: Sequence[Survey]) -> Ranked | None:
    """Return the best candidate of a test if nothing speaks against it."""
    found = ranked(name, [each for one in files for each in _candidates(name, one)])
    return found[0] if found and found[0].is_open else None


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
        f"# A resistance in {Path(one.path).name}: column '{flat(column.name)}' holds "
        f"{column.low:.6g} … {column.high:.6g}."
        for one in surveys
        for column in one.free
        if (column.unit or "").casefold() in ("ohm", "ω", "mohm", "mω") and column.low is not None
    )
    stated = [f"{ohm:g}" for ohm in stated_ohms(surveys)]
    offered = " or ".join(f"{ohm} Ω" for ohm in stated)
    return Gap(
        "",
        "phase_resistance_ohm",
        "the copper loss 3 I² R(T) follows from it. Without it only --model first can be "
        "calibrated. It is measured at the terminals of the cold machine (half of what a star "
        "shows between two of them), or stands on its data sheet."
        + (f" The tests state {offered}: confirm it in [winding]." if offered else ""),
        lines=notes,
        best=tuple(stated[:1]),
        number="0.0062",
    )


def _channel(name: str, wanted: Mapping[str, str], tests: Mapping[str, Sequence[Survey]]) -> Gap:
    """Return the gap of a channel.

    Args:
        name: Canonical name.
        wanted: The tests that lack it, with the formula that it is needed for, or nothing.
        tests: The files of each test.
    """
    surveys = [one for test in wanted for one in tests[test]]
    formula = next((one for one in wanted.values() if one), "")
    ways = (*DERIVATIONS, *QUOTIENTS)
    target = next((way.channel for way in ways if way.formula == formula), "")
    sentence = WHY.get(name, "") if not formula else f"{target} is {formula}."
    if name == "losses_W":
        fed = (" and ".join(way.needs) for way in ELECTRICAL if way.needs[-1] != "phase_current_A")
        sentence = sentence.format(", ".join(fed))
    each = {test: ranked(name, [one for file in tests[test] for one in _candidates(name, file)
                                if len(one.line) <= LONGEST_LINE])
            for test in wanted}  # fmt: skip
    firsts = [found[0] for found in each.values() if found]
    others = [one for found in each.values() for one in found[1:]]
    candidates: dict[str, str] = {}
    for one in (*firsts, *others):
        candidates.setdefault(one.candidate.line, one.note)
    constants = _constants(name, surveys)
    silent = [sentence for one in surveys for sentence in _silent(name, one)]
    if silent:  # the cause goes first
        sentence = " ".join((*silent, sentence[:1].upper() + sentence[1:]))
    number = NUMBERS.get(name, "")
    if name == "phase_current_A" and not candidates and not silent:
        direct = [each.column for one in surveys for each in one.recognised
                  if each.channel == "dc_current_A"]  # fmt: skip
        direct += [each.columns[0] for one in surveys for each in _candidates("dc_current_A", one)]
        number = "" if direct else "0.0"
        sentence += (
            f" Where the direct current in '{flat(direct[0])}' heats the coil itself, write that "
            "column here in place of dc_current_A, and phases = 1 under [motor]."
            if direct
            else " Write 0 where no current heats, and calibrate --model first."
        )
    if not any(one.candidate.is_likely for one in firsts) and name in ZERO and formula:
        number, candidates, each = "0.0", {}, {}
        sentence += f" No column holds it: 0 {ZERO[name]}."
    elif not candidates and not constants and not silent and name != "time_s":
        sentence += " No column has a unit or a name that speaks for it."
    best = {test: found[0] for test, found in each.items() if found and found[0].is_open}
    return Gap(
        name,
        "",
        sentence,
        tuple(candidates.items())[:MOST_CANDIDATES],
        constants,
        best=tuple(dict.fromkeys(one.candidate.line for one in best.values())),
        of_tests=_of_tests(name, best, tests),
        is_zero=name in _zeros(surveys),
        is_of_some=len(best) < len(tests) or len({one.candidate.line for one in best.values()}) > 1,
        number=number,
    )


def _of_tests(
    name: str, best: Mapping[str, Ranked], tests: Mapping[str, Sequence[Survey]]
) -> dict[str, str]:
    """Return the right-hand sides of files that have a better one's columns for another channel."""
    columns = {one.candidate.line: {*one.candidate.columns} for one in best.values()}
    found = {}
    for test, files in tests.items():
        names = {each.name for one in files for each in one.free}
        names |= {each.column for one in files for each in one.recognised}
        read = next((line for line, needed in columns.items() if needed <= names), None)
        own = (
            best[test].candidate.line
            if test in best
            else next(
                (each.column for one in files for each in one.recognised if each.channel == name),
                None,
            )
        )
        if read is not None and own is not None and read != own:
            found |= {name_of_test(Path(one.path)): own for one in files}
    return found


def _candidates(name: str, one: Survey) -> Iterator[Candidate]:
    """Yield the columns of a file that may be a channel, and the means of three of them."""
    held: dict[str, Candidate] = {}
    for column in one.free:
        proposal = _proposal(name, column)
        # a speed of 0 may have been measured, a current of 0 is none
        is_held = bool(column.num_values) if name in ZERO else not column.is_silent
        if proposal is not None and is_held:
            held[column.name] = Candidate(
                proposal.line,
                _note(column),
                proposal.score,
                proposal.unit_from == "assumed",
                _in_unit_of(name, proposal, column),
                (column.name,),
                column.evidence.get(name),
            )
    yield from (_mean(mean, held) for mean in one.means if mean.channel == name)
    yield from held.values()
    for each in one.recognised if name == "winding_degC" else ():
        if each.channel == "end_winding_degC":
            note = "recognised as end_winding_degC, a part of the winding"
            yield Candidate(each.column, note, LIKELY, False, None, (each.column,))


def _proposal(name: str, column: FreeColumn) -> Proposal | None:
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


def _mean(mean: PhaseMean, held: Mapping[str, Candidate]) -> Candidate:
    parts = [held[name] for name in mean.columns]
    return Candidate(
        mean.line,
        "three columns that move together",
        max(part.score for part in parts),
        any(part.is_assumed for part in parts),
        max(parts, key=lambda part: part.move).course,
        mean.columns,
    )


def _in_unit_of(name: str, proposal: Proposal, column: FreeColumn) -> Course | None:
    if proposal.channel == "winding_resistance_ohm":
        if column.course is None or column.course.low <= 0.0:
            return None
        B = COEFFICIENTS_degC["copper"]
        return column.course.converted((B + COLD_DEGC) / column.course.low, -B)
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
    """Return lines of `[constants]` for a room that was not recorded, or a shaft that stands."""
    if name in AT_REST and all(any(under_direct_current(one)) for one in surveys):
        return (f"# {name} = 0.0  # direct current turns no shaft",)
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
                lines.append(f"# {name} = {value!r}  # {what} column '{flat(column.name)}'")
        for line in one.preamble:
            numbers = ANY_NUMBER.findall(line) if "ambient" in read_name(line).meanings else []
            values = [float(number.replace(",", ".")) for number in numbers]
            lines += [f"# {name} = {value!r}  # from the line '{printable(flat(line))[:80]}'"
                      for value in values if _is_room(value)]  # fmt: skip
    return tuple(dict.fromkeys(lines))


def _is_room(value: float) -> bool:
    coldest, hottest = ROOM_RANGE
    return coldest <= value <= hottest
