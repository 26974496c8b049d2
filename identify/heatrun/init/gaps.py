"""What tests do not say and a calibration needs: why it matters, and where it may come from.

The resistance of a phase and its temperature may stand in the head or among the scalars of a file.
"""

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field
from pathlib import Path

from ..io.quantities import printable
from ..readers.likely_names import LIKELY, SURE, read_name
from ..readers.read import name_of_test
from ..record.by_resistance import QUOTIENTS, tells_winding
from ..record.channels import CHANNEL, REQUIRED
from ..record.derive import DERIVATIONS, ELECTRICAL, Derivation
from ..record.units import find_unit
from .candidates import (
    AT_REST,
    LEAST_MOVE_K,
    ZERO,
    Candidate,
    candidates,
    is_room,
    proposal_of,
    ranked,
)
from .free_columns import flat
from .survey import Survey

WHY = {
    "time_s": "no sample has a time. Name the column of times, or the sampling rate: "
    'time_s = "rate 10 Hz".',
    "phase_current_A": "the copper loss, which heats the winding itself, follows from the current.",
    "losses_W": "the heat that the temperatures answer to: a column of them, or the power that "
    "goes in ({}) less the shaft's (mechanical_power_W, or torque_Nm and speed_rpm, or "
    "efficiency; where it stands, speed_rpm = 0 under [constants]).",
    "ambient_degC": "heat flows by the difference to it. Name its column, or write its mean under "
    '[constants]; a liquid-cooled machine takes sink = "coolant" under [motor].',
    "coolant_degC": "no column is the room's, so that the coolant is what the heat flows to: "
    'sink = "coolant" under [motor].',
    "winding_degC": "it is what the network is fitted to. The winding's resistance in ohm will do.",
}
"""Why a channel that a calibration needs matters."""

ANY_NUMBER = re.compile(r"(?<![\w.,])[+-]?[0-9]{1,4}(?:[.,][0-9]+)?(?![\w.,]*[0-9])")
NUMBERS = {"time_s": "10", "ambient_degC": "22.0"}
"""Channels that a number may take the place of, with an example [Hz, °C]."""

UNLOADED = ("phase_current_A", "losses_W")
"""What is 0 while a winding only cools."""

MOST_CANDIDATES = 12
LONGEST_LINE = 450
"""Characters; the motor file takes 500 on a right-hand side."""


@dataclass(frozen=True)
class Gap:
    """Something that is missing."""

    channel: str  # Canonical name, empty for a key.
    key: str  # Key of the motor file, empty for a channel.
    sentence: str  # Why it matters and what to do.
    # Right-hand sides of `[columns]` with a note on each, the best first; of several loggers the
    # best of each before the others.
    candidates: tuple[tuple[str, str], ...] = ()
    constants: tuple[str, ...] = ()  # Lines of `[constants]`, commented.
    lines: tuple[str, ...] = ()  # Further lines of comment at the key.
    # Right-hand sides of which the tests need one each, in the order of the tests; empty where what
    # speaks for the first candidate is contradicted.
    best: tuple[str, ...] = ()
    # By file those for which the first of `best` that it has is another channel.
    of_tests: Mapping[str, str] = field(default_factory=dict)
    # A column that is read for it holds 0 throughout, which may have been measured.
    is_zero: bool = False
    is_of_some: bool = False  # Other tests have the channel, or another of `best`.
    number: str = ""  # Example of a number that takes the place of a column, or empty.

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
        have |= silent & somewhere
        have |= {"winding_degC"} if tells_winding(have) else set()
        for name in REQUIRED:
            for need, formula in _needed(name, files, have) if name not in have else ():
                wanted.setdefault(need, {})[test] = formula
    if is_cooled_by_liquid(surveys):
        lacking = wanted.pop("ambient_degC", {})
        lacking = {test: "" for test in lacking if not _has("coolant_degC", tests[test])}
        wanted |= {"coolant_degC": lacking} if lacking else {}
    has_no_copper_loss = "phase_current_A" in _zeros(surveys) - somewhere
    has_no_copper_loss |= all(one.only_cools for one in surveys)
    is_told = bool(found_resistance(surveys))
    keys = () if is_told else (_resistance(surveys, is_zero=has_no_copper_loss),)
    order = dict.fromkeys((*REQUIRED, *CHANNEL))
    return (*keys, *(_channel(name, wanted[name], tests) for name in order if name in wanted))


def _has(name: str, files: Sequence[Survey]) -> bool:
    return any(name in one.channels for one in files)


def is_cooled_by_liquid(surveys: Sequence[Survey]) -> bool:
    """Return whether the sink is a coolant: each file of a test may tell it, and none the room."""
    found = [one for one in candidates("coolant_degC", surveys) if one.is_likely]
    is_told = bool(found) or _has("coolant_degC", surveys)
    room = _best("ambient_degC", surveys) or _constants("ambient_degC", surveys)
    return is_told and not room and not _has("ambient_degC", surveys)


def _zeros(surveys: Sequence[Survey]) -> set[str]:
    return {each.channel for one in surveys for each in one.silent if not each.is_empty}


def _needed(name: str, files: Sequence[Survey], have: Set[str]) -> list[tuple[str, str]]:
    """Return the channels that lead to one that is missing, each with the formula, or itself."""
    direct = _best(name, files)
    score = direct.score if direct else 0
    if score >= (LIKELY if name in ("losses_W", "winding_degC") else SURE):
        return [(name, "")]
    if name == "winding_degC":
        is_moved = direct is not None and direct.move >= LEAST_MOVE_K
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
    found: dict[str, Candidate] = {}
    at_rest = 0
    for need in (need for need in way.needs if need not in have):
        one = _best(need, files)
        is_told = one and (one.is_likely or len(candidates(need, files)) == 1)
        if one and is_told and all(one.columns != other.columns for other in found.values()):
            found[need] = one
        elif need in ZERO:
            at_rest += 1  # without a shaft recorded, the rotor may have stood
        else:
            return None
    is_turning = bool(AT_REST & (have | found.keys()))
    is_sure = all(one.is_likely for one in found.values())
    is_fed = bool(found or {*way.needs} & have - ZERO.keys())
    if not is_fed or (at_rest and (is_turning or not is_sure)):
        return None
    return at_rest, [(need, way.formula) for need in way.needs if need not in have]


def _best(name: str, files: Sequence[Survey]) -> Candidate | None:
    """Return the best candidate of a test if nothing speaks against it."""
    found = ranked(name, candidates(name, files))
    return found[0] if found and found[0].is_open else None


def _resistance(surveys: Sequence[Survey], *, is_zero: bool) -> Gap:
    notes = tuple(
        f"# A resistance in {Path(one.path).name}: column '{flat(column.name)}' holds "
        f"{column.low:.6g} … {column.high:.6g}."
        for one in surveys
        for column in one.free
        if (column.unit or "").casefold() in ("ohm", "ω", "mohm", "mω") and column.low is not None
    )
    stated = [f"{ohm:g}" for ohm in stated_resistance(surveys).get("phase_resistance_ohm", ())]
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
        is_zero=is_zero,
        number="0.0062",
    )


def _channel(name: str, wanted: Mapping[str, str], tests: Mapping[str, Sequence[Survey]]) -> Gap:
    """Return the gap of a channel; the tests that want it lack it, for a formula or by itself."""
    surveys = [one for test in wanted for one in tests[test]]
    formula = next(filter(None, wanted.values()), "")
    each = {test: ranked(name, [one for one in candidates(name, tests[test])
                                if len(one.line) <= LONGEST_LINE])
            for test in wanted}  # fmt: skip
    firsts = [found[0] for found in each.values() if found]
    others = [one for found in each.values() for one in found[1:]]
    lines: dict[str, str] = {}
    for one in (*firsts, *others):
        lines.setdefault(one.line, one.note)
    constants = _constants(name, surveys)
    silent = [sentence for one in surveys for sentence in _silent(name, one)]
    sentence, number = _why(name, formula), NUMBERS.get(name, "")
    if silent:  # the cause goes first
        sentence = " ".join((*silent, sentence[:1].upper() + sentence[1:]))
    if name == "phase_current_A" and not lines and not silent:
        further, number = _without_current(surveys)
        sentence += further
    if not any(one.is_likely for one in firsts) and name in ZERO and formula:
        lines = {line: note for line, note in lines.items() if name in AT_REST}
        number, each = "0.0", {}
        names = " or ".join(f"'{flat(line)}'" for line in lines)
        told = (*_refused(name, surveys), *([f"Perhaps it is {names}."] if names else []))
        rest = f"Write 0 only {ZERO[name]}." if told else f"No column holds it: 0 {ZERO[name]}."
        sentence = " ".join((sentence, *told, rest))
    elif not lines and not constants and not silent and name != "time_s":
        sentence += " No column has a unit or a name that speaks for it."
    best = {test: found[0] for test, found in each.items() if found and found[0].is_open}
    clocks = next(filter(None, map(_clocks, surveys if name == "time_s" else ())), "")
    if clocks:
        sentence, number, best = clocks, "", {}
    sides = tuple(dict.fromkeys(one.line for one in best.values()))
    return Gap(
        name,
        "",
        sentence,
        tuple(lines.items())[:MOST_CANDIDATES],
        constants,
        best=sides,
        of_tests=_of_tests(name, best, tests),
        is_zero=name in _zeros(surveys),
        is_of_some=len(best) < len(tests) or len(sides) > 1,
        number=number,
    )


NUMBERED = re.compile(r" #[0-9]+$")
"""What tells columns of one name apart."""

OTHER_SPAN = 0.01
"""Times of one clock last equally long, to this share of it [1]."""


def _clocks(one: Survey) -> str:
    """Return what to do where columns of a file have clocks of their own, else an empty text."""
    found = [each for each in ranked("time_s", candidates("time_s", [one]))
             if each.is_open and each.is_likely and each.course]  # fmt: skip
    for other in found[1:]:
        first, second = (NUMBERED.sub("", each.columns[0]) for each in (found[0], other))
        if first == second or abs(other.move - found[0].move) > OTHER_SPAN * found[0].move:
            names = f"'{flat(found[0].columns[0])}' and '{flat(other.columns[0])}'"
            return printable(
                f"{one.file} has two clocks that differ, {names}: save the columns of each as a "
                "file of its own and join them, heatrun check motor.toml "
                f"TEMPERATURES.csv+DRIVE.csv; if one is that of all columns: time_s = "
                f'"{flat(found[0].line)}".'
            )
    return ""


def _why(name: str, formula: str) -> str:
    """Return why a channel is needed: by itself, or for a formula."""
    if formula:
        ways = (way for way in (*DERIVATIONS, *QUOTIENTS) if way.formula == formula)
        return f"{next(ways).channel} is {formula}."
    fed = (" and ".join(way.needs) for way in ELECTRICAL if way.needs[-1] != "phase_current_A")
    return WHY.get(name, "").format(", ".join(fed))


def _without_current(surveys: Sequence[Survey]) -> tuple[str, str]:
    """Return what to do where no column may be the current, and the number to put in, if any."""
    direct = [each.column for one in surveys for each in one.recognised
              if each.channel == "dc_current_A"]  # fmt: skip
    direct += [one.columns[0] for one in candidates("dc_current_A", surveys)]
    if not direct:
        return " Write 0 where no current heats, and calibrate --model first.", "0.0"
    return (
        f" Where the direct current in '{flat(direct[0])}' heats the coil itself, write that "
        "column here in place of dc_current_A, and phases = 1 under [motor]."
    ), ""


def _of_tests(
    name: str, best: Mapping[str, Candidate], tests: Mapping[str, Sequence[Survey]]
) -> dict[str, str]:
    """Return the right-hand sides of files that have a better one's columns for another channel."""
    columns = {one.line: {*one.columns} for one in best.values()}
    found = {}
    for test, files in tests.items():
        names = {each.name for one in files for each in one.free}
        names |= {each.column for one in files for each in one.recognised}
        read = next((line for line, needed in columns.items() if needed <= names), None)
        owns = (each.column for one in files for each in one.recognised if each.channel == name)
        own = best[test].line if test in best else next(owns, None)
        if read is not None and own is not None and read != own:
            found |= {name_of_test(Path(one.path)): own for one in files}
    return found


def _refused(name: str, surveys: Sequence[Survey]) -> Iterator[str]:
    """Yield a sentence for each column that speaks of the channel in a unit that is not read."""
    for one in (column for each in surveys for column in each.free):
        if one.remark.startswith(f"{name} ") and not one.is_silent:
            yield f"Column '{flat(one.name)}' would be it, but {one.remark}: convert it first."


def _silent(name: str, one: Survey) -> Iterator[str]:
    """Yield a sentence for each column that would be the channel and holds nothing."""
    for column in one.silent:
        if column.channel == name:
            yield (
                f"Column '{printable(flat(column.column))}' of {one.file} is read for it and holds "
                f"{column.held}.{'' if column.is_empty else ' If that was measured, it may stay.'}"
            )
    for free in one.free:
        proposal = proposal_of(name, free)
        if proposal is not None and proposal.is_likely and free.is_silent:
            held = "0 throughout" if free.num_values else "no values"
            line = f' If that was measured: {name} = "{printable(flat(proposal.line))}".'
            yield (
                f"Column '{printable(flat(free.name))}' of {one.file} holds {held}."
                f"{line if free.num_values else ''}"
            )


def _constants(name: str, surveys: Sequence[Survey]) -> tuple[str, ...]:
    """Return lines of `[constants]` for a room, a shaft that stands, a winding that only cools."""
    if name in AT_REST and all(one.under_direct_current for one in surveys):
        return (f"# {name} = 0.0  # direct current turns no shaft",)
    if name in UNLOADED and all(one.only_cools for one in surveys):
        return (f"# {name} = 0.0  # the winding cools from the first sample on: no load",)
    if name != "ambient_degC":
        return ()
    lines = []
    for one in surveys:
        for column in one.free:
            is_temperature = find_unit(column.unit or "", "temperature") is not None
            value = column.low
            is_steady = value == column.high and not column.is_silent
            if is_temperature and value is not None and is_steady and is_room(value):
                what = "the one value of" if column.num_values == 1 else "throughout in"
                lines.append(f"# {name} = {value!r}  # {what} column '{flat(column.name)}'")
        for line in one.preamble:
            if "ambient" in read_name(line).meanings:
                values = map(number_in, ANY_NUMBER.findall(line))
                lines += [f"# {name} = {value!r}  # from {quoted(line)}"
                          for value in values if is_room(value)]  # fmt: skip
    return tuple(dict.fromkeys(lines))


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


def stated_resistance(surveys: Sequence[Survey]) -> dict[str, dict[float, str]]:
    """Return values of `[winding]` by their key, with where each stands; none without a resistance.

    Heads are written by hand: `Rs: 0.0062 ohm`, `Phasenwiderstand R20 = 6,2 mΩ`. A resistance
    between terminals, of the insulation or of a shunt is none of the phase.
    """
    ohms: dict[float, str] = {}
    degrees: dict[float, str] = {}
    for one in surveys:
        for value, where, temperature in _resistances(one):
            ohms.setdefault(value, where)
            if temperature is not None:
                degrees.setdefault(temperature, where)
    for one in () if ohms else surveys:
        for column, evidence in one.under_direct_current:
            if evidence.cold:
                ohm, degC = (float(f"{value:.5g}") for value in evidence.cold)
                began = f"the start, '{flat(column.name)}' over the current"
                ohms.setdefault(ohm, began)
                degrees.setdefault(degC, "the start, if the winding was as cold as the room")
    if not ohms:
        return {}
    for one in surveys:
        for line in one.preamble:
            for value in _temperatures(REFERENCE.findall(line)):
                degrees.setdefault(value, quoted(line))
        for value, where in _scalars(one, SCALAR_REFERENCE):
            if COLDEST < value < HOTTEST:
                degrees.setdefault(value, where)
    return {"phase_resistance_ohm": ohms, "reference_temperature_degC": degrees}


def found_resistance(surveys: Sequence[Survey]) -> dict[str, str]:
    """Return the resistance and its temperature where a file states both as `Rrif` and `Trif`."""
    for one in surveys:
        held = one.constants or {}
        if held.get("Rrif", 0.0) > 0.0 and COLDEST < held.get("Trif", HOTTEST) < HOTTEST:
            return {
                "phase_resistance_ohm": f"{held['Rrif'] / 3.0:.9g}  # Rrif/3 of the file",
                "reference_temperature_degC": f"{held['Trif']:.9g}  # Trif of the file",
            }
    return {}


def _resistances(one: Survey) -> Iterator[tuple[float, str, float | None]]:
    """Yield each resistance [Ω], where it stands, and its temperature [°C] if that line has one."""
    for line in one.preamble:
        for found in STATED.finditer(line) if not OTHER.search(line) else ():
            in_bracket = IN_BRACKET.search(found["between"])
            unit = found["unit"] or (in_bracket["unit"] if in_bracket else "")
            # to 12 digits: 6.2 mΩ are 0.0062 Ω, and not the double next to it
            value = float(f"{number_in(found['number']) * FACTORS.get(unit[:1], 1.0):.12g}")
            doubt = "" if unit else ", no unit given"
            if LEAST_OHM <= value <= MOST_OHM:
                yield value, f"{quoted(line)}{doubt}", _temperature(found, line)
    for value, where in _scalars(one, SCALAR):
        if LEAST_OHM <= value <= MOST_OHM:
            yield value, f"{where}, no unit given", None


def _temperature(found: re.Match[str], line: str) -> float | None:
    inside = AT_DEGREES.search(found["between"])
    stated = inside or BEHIND.match(line, found.end()) or IN_NAME.search(found["name"])
    return next(_temperatures([stated[1]] if stated else []), None)


def _scalars(one: Survey, called: re.Pattern[str]) -> Iterator[tuple[float, str]]:
    for name, value in (one.constants or {}).items():
        if called.fullmatch(name):
            yield value, f"scalar '{printable(flat(name))}' of {one.file}"


def _temperatures(texts: Sequence[str]) -> Iterator[float]:
    values = (number_in(text) for text in texts)
    return (value for value in values if COLDEST < value < HOTTEST)


def number_in(text: str) -> float:
    """Return the number that a text is, with a decimal point or comma."""
    return float(text.replace(",", "."))


def quoted(line: str) -> str:
    """Return a line of a file, in words."""
    return f"the line '{printable(flat(line))[:80]}'"
