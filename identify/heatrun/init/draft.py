"""The text of a motor file for tests that nobody has described yet: what `heatrun init` writes.

What is recognised, proposed or missing stands in at most `MOST_LINES` lines. Nothing that was not
read from the files is set: a line holds once a person has removed the # in front of it, or, with
`is_accepted`, at once, marked to be checked. All keys are explained on the page of the motor file.
"""

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import islice, zip_longest
from pathlib import Path

from ..io.quantities import printable, printed_unit
from ..motor.keys import WINDING
from ..record.channels import CHANNEL, REQUIRED
from ..version import __version__
from .free_columns import FreeColumn, as_assumed, flat
from .gaps import LONGEST_LINE, Gap, found_resistance, gaps, is_cooled_by_liquid, stated_resistance
from .survey import Survey

NONE = "none"
"""Right-hand side that leaves a channel out."""


@dataclass(frozen=True)
class Choice:
    """A channel, and what of the files it may be."""

    channel: str  # Canonical name.
    # Right-hand sides of `[columns]` with what each holds, the proposed one first.
    sides: Mapping[str, str]
    is_proposed: bool  # The first one holds unless a person says otherwise.


def choices(surveys: Sequence[Survey]) -> tuple[Choice, ...]:
    """Return the channels that are read, missing or likely, those of a calibration first."""
    missing = {gap.channel: gap for gap in gaps(surveys) if gap.channel}
    free = {column.name: column for one in surveys for column in one.free if not column.text}
    recognised = [each for one in surveys for each in one.recognised if each.column]
    found = []
    for name in dict.fromkeys((*REQUIRED, *CHANNEL)):
        gap = missing.get(name)
        read = {
            e.column: f"read in {printed_unit(e.unit)}" for e in recognised if e.channel == name
        }
        alike = {
            e.column: f"read as {e.channel}"
            for e in recognised
            if e.channel != name and CHANNEL[e.channel].quantity == CHANNEL[name].quantity
        }
        offered = dict(gap.candidates) if gap else {}
        best = {side: offered.get(side, "") for side in gap.best} if gap else {}
        lines = {_choice_line(name, column): column.shown() for column in free.values()}
        likely = {p.line: column.shown() for column in free.values() for p in column.proposals
                  if p.channel == name and p.is_likely}  # fmt: skip
        if gap or read or likely:
            sides = {**best, **read, **offered, **likely, **lines} | offered
            sides.pop("", None)
            if alike and not sides:  # what is read as another channel may be that in error alone
                sides = {NONE: "no other column"}
            sides = sides | {side: held for side, held in alike.items() if side not in sides}
            found += [Choice(name, sides, bool(best or read))] if sides else []
    return tuple(found)


def _choice_line(channel: str, column: FreeColumn) -> str:
    """Return how a column would be the channel; empty where unit or name say that it is not."""
    own = column.read_as(channel)
    if own is None and (column.unit or any(p.is_likely for p in column.proposals)):
        return ""
    line = own.line if own else as_assumed(column.name, channel, CHANNEL[channel].unit)
    return line if len(line) <= LONGEST_LINE else ""


def as_chosen(found: Sequence[Gap], columns: Mapping[str, str]) -> tuple[Gap, ...]:
    """Return the gaps of tests as a person has filled them, by a right-hand side of any channel."""
    known = {gap.channel: gap for gap in found}
    return (
        *(_filled(gap, columns.get(gap.channel)) for gap in found),
        *(_filled(Gap(name, "", ""), side) for name, side in columns.items() if name not in known),
    )


def _filled(gap: Gap, side: str | None) -> Gap:
    if side is None:
        return gap
    others = {line: note for line, note in gap.candidates if line != side}
    note = dict(gap.candidates).get(side) or "chosen by hand"
    if side == NONE and gap.sentence:  # nothing is read for it anyway
        return replace(gap, best=())
    candidates = ((side, note), *others.items())
    return replace(gap, candidates=candidates, best=(side,), of_tests={}, is_of_some=False)


MOST_LINES = 40
WIDTH = 160
"""Characters of a line of comment; longer ones are cut, `heatrun init` prints them whole."""

MOST_OPEN = 3
"""Questions and lines on what is recognised, of each kind."""

LEAST_FREE = 4
"""Lines that candidates leave to columns that no channel claims."""

PLEASE_CHECK = "please check"
INSULATION = '# insulation_class = "F"    # with it: continuous current and time to the limit'


def draft(
    name: str,
    surveys: Sequence[Survey],
    *,
    is_accepted: bool = False,
    numbers: Mapping[str, float] | None = None,
    columns: Mapping[str, str] | None = None,
) -> str:
    """Return the text of a commented motor file that loads as it is.

    A blank name becomes "motor". If it is accepted, the best candidates hold. A person may have
    said numbers, by key or channel (of `time_s` the rate [Hz]), and chosen right-hand sides of
    `[columns]` by channel.
    """
    numbers = numbers or {}
    missing = as_chosen(gaps(surveys), columns or {})
    mark = "" if is_accepted else "# "
    unsaid = [gap for gap in missing if (gap.channel or gap.key) not in numbers]
    head = _head(surveys, [gap for gap in unsaid if not (is_accepted and gap.is_answered)])
    motor = ["", "[motor]", f"name = {toml_text(name.strip() or 'motor')}", INSULATION]
    direct = [column for one in surveys for column, _ in one.under_direct_current]
    if direct:
        words = f"'{flat(direct[0].name)}' is that of one winding under direct current"
        motor.append(_value("phases", "1", words, mark))
    said = {*numbers, *(columns or {})}
    if is_cooled_by_liquid(surveys) and "ambient_degC" not in said:
        motor.append(_value("sink", '"coolant"', "no column is the room's", mark))
    winding = ["", "[winding]", *_winding(surveys, missing, mark)]
    constants = ["", "[constants]", *_constants(missing, mark)]
    recognised = ["", "[columns]", *_remarks(surveys)]
    overrides = _overrides(missing, mark)
    fixed = (*head, *motor, *winding, *recognised, *constants, *overrides)
    shown = {side for gap in missing for side, _ in gap.candidates}
    free = _free(surveys, {gap.channel for gap in missing}, shown, mark)
    left = MOST_LINES - len(fixed)
    offered = _offered(missing, mark, left - min(len(free), LEAST_FREE))
    left -= len(offered)
    if len(free) > left:
        rest = f"#   … and {len(free) - left + 1} more columns: heatrun check lists them"
        free = [*free[: left - 1], rest] if left else []
    lines = (*head, *motor, *winding, *recognised, *offered, *free, *constants, *overrides)
    text = printable("\n".join(lines) + "\n")  # names out of files stand in comments too
    for name, number in numbers.items():  # into the line that waits for it
        pattern, line = rf"^# {name} = .*$", f"{name} = {number!r}"
        if name == "time_s":
            pattern, line = r"^\[columns\]$", f'[columns]\ntime_s = "rate {number:g} Hz"'
        text = re.sub(pattern, line, text, count=1, flags=re.MULTILINE)
    return text


def toml_text(text: str) -> str:
    """Return a text as a TOML string on one line."""
    escaped = {'"': '\\"', "\\": "\\\\"}
    return f'"{"".join(escaped.get(c, c if c.isprintable() else _code(c)) for c in text)}"'


def _code(character: str) -> str:
    code = ord(character)
    if 0xD800 <= code < 0xE000:  # half of a pair: TOML has no way to write it
        return "?"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _head(surveys: Sequence[Survey], missing: Sequence[Gap]) -> list[str]:
    files = ", ".join(Path(one.path).name for one in surveys)
    lines = [
        _comment(f"Motor file for {files}, drafted by heatrun init (heatrun {__version__})."),
        "# A line holds once its # is removed. All keys: docs/motor_file.md of heatrun.",
    ]
    if missing:
        lines.append("# Missing:")
        lines += [_comment(f"{number}. {gap.place}: {_first(gap.sentence)}")
                  for number, gap in enumerate(missing, 1)]  # fmt: skip
    else:
        lines.append("# All channels that a calibration needs are there.")
    questions = [question for one in surveys for question in one.questions]
    return lines + [_comment(f"Open: {question}") for question in questions[:MOST_OPEN]]


def _first(sentences: str) -> str:
    """Return so many sentences, one at least, as have room on a line."""
    kept, *others = re.split(r"(?<=\.) (?=[A-Z])", sentences)
    for one in others:
        if len(kept) + len(one) > WIDTH - 40:
            break
        kept = f"{kept} {one}"
    return kept


def _winding(surveys: Sequence[Survey], missing: Sequence[Gap], mark: str) -> Iterator[str]:
    known = found_resistance(surveys)
    stated = stated_resistance(surveys)
    for gap in missing:
        yield from gap.lines[:MOST_OPEN]
    for key in WINDING.keys:
        if key.name in known:
            yield f"{key.name} = {known[key.name]}"
        elif stated.get(key.name):
            for place, (value, where) in enumerate(stated[key.name].items()):
                if place < MOST_OPEN:
                    yield _value(key.name, repr(value), f"from {where}", "# " if place else mark)
        elif any(gap.key == key.name for gap in missing):
            yield _blank(key.name, key.example)
        elif key.name == "reference_temperature_degC":
            yield f"# {key.name} = {key.example}"


def _value(name: str, value: str, note: str, mark: str) -> str:
    note = note if mark else f"{PLEASE_CHECK}: {note}"
    return f"{mark}{name} = {value}  # {note}"


def _blank(name: str, example: str) -> str:
    """Return a line that no file loads with before a number was put in: an example is none."""
    return f"# {name} =    # put in the number, such as {example}"


def _remarks(surveys: Sequence[Survey]) -> Iterator[str]:
    """Yield what was recognised: with a line to confirm where the unit is assumed."""
    for one in surveys[:MOST_OPEN]:
        where = Path(one.path).name
        known = [f"{each.channel} = {each.column}" for each in one.recognised]
        known += [f"{channel} = {formula}" for channel, formula in one.derived.items()]
        if known:
            yield _listed(f"Recognised in {where}: ", known)
        assumed = [each for each in one.recognised if each.unit_from == "assumed"]
        for each in assumed[:MOST_OPEN]:
            how = f"unit {each.unit} ASSUMED: remove the # to state it; {each.found_by}"
            yield _line(each.channel, toml_text(f"{each.column} [{each.unit}]"), how, "# ")
        for silent in one.silent[:MOST_OPEN]:
            yield _comment(
                f"  {silent.channel} from column '{flat(silent.column)}' of {where}: "
                f"{silent.held}. Name another column if this one was not recorded."
            )


def _offered(missing: Sequence[Gap], mark: str, most: int) -> list[str]:
    """Return lines of candidates: the best of each channel, then the others in turn."""
    rows = []
    for gap in missing:
        lines = []
        if gap.best and gap.is_of_some and gap.channel:
            side = f"[{', '.join(map(toml_text, gap.best))}]"
            own = dict(gap.candidates).get(gap.best[0], "")
            note = own if len(gap.best) == 1 else "of each logger its own"
            lines.append(_line(gap.channel, side, note, mark))
        for side, note in gap.candidates:
            if not gap.is_of_some or side not in gap.best:
                is_best = gap.best[:1] == (side,)
                lines.append(_line(gap.channel, toml_text(side), note, mark if is_best else "# "))
        rows.append(lines)
    in_turn = (line for row in zip_longest(*rows) for line in row if line is not None)
    turn = [*islice(in_turn, max(most, 0))]
    return [line for lines in rows for line in lines if line in turn]


def _free(surveys: Sequence[Survey], missing: Set[str], shown: Set[str], mark: str) -> list[str]:
    """Return the columns that no channel claims, with a line for what each may be.

    Candidates of the missing channels stand above, with the right-hand sides that are shown. The
    mark stands before a line that holds: that of the speed, by which a fan cools.
    """
    lines = []
    settled = {channel for one in surveys for channel in one.channels} | missing
    for one in surveys:
        for column in one.free:
            if shown & {column.name, *(p.line for p in column.proposals)}:
                continue
            likely = [p for p in column.proposals if p.is_likely and p.channel not in settled]
            if likely and not column.is_silent and len(likely[0].line) <= LONGEST_LINE:
                best = likely[0]
                side = toml_text(best.line) if len(surveys) == 1 else f"[{toml_text(best.line)}]"
                is_speed = best.channel == "speed_rpm"
                settled |= {best.channel} if is_speed else set()
                own_mark = mark if is_speed else "# "
                lines.append(_line(best.channel, side, column.shown(), own_mark))
            else:
                lines.append(_comment(f"  {flat(column.name)}: {column.shown()}"))
    return lines and ["# No channel claims:", *lines]


def _constants(missing: Sequence[Gap], mark: str) -> list[str]:
    lines = []
    for gap in missing:
        lines += gap.constants[:MOST_OPEN]
        is_blank = gap.channel not in ("", "time_s") and not gap.constants
        if gap.number and is_blank and (mark or not gap.best):
            lines.append(_blank(gap.channel, gap.number))
        if gap.constants and not gap.best and not mark:
            accepted = gap.constants[0].removeprefix("# ")
            lines[-len(gap.constants[:MOST_OPEN])] = accepted.replace(
                "  # ", f"  # {PLEASE_CHECK}: ", 1
            )
    return lines or ["# CHANNEL = NUMBER, of what was not recorded because it does not change"]


def _overrides(missing: Sequence[Gap], mark: str) -> list[str]:
    """Return `[tests.NAME.columns]` of files in which a line of `[columns]` is another channel."""
    of_tests: dict[str, list[str]] = {}
    for gap in missing:
        for test, side in gap.of_tests.items():
            note = "in this file another column is called so"
            of_tests.setdefault(test, []).append(_line(gap.channel, toml_text(side), note, mark))
    return [line for test, lines in of_tests.items()
            for line in ("", f"{mark}[tests.{toml_text(test)}.columns]", *lines)]  # fmt: skip


def _line(channel: str, side: str, note: str, mark: str) -> str:
    note = flat(note)
    return f"{mark}{channel} = {side}  # {note if mark else f'{PLEASE_CHECK}: {note}'}"


def _listed(head: str, parts: Sequence[str]) -> str:
    """Return a comment with as many parts as a line has room for, and how many more there are."""
    lines = [head + ", ".join(parts)]
    lines += [f"{head}{', '.join(parts[:num])}, and {len(parts) - num} more"
              for num in range(len(parts) - 1, 0, -1)]  # fmt: skip
    return _comment(next((line for line in lines if len(line) + 2 <= WIDTH), lines[-1]))


def _comment(text: str) -> str:
    """Return a text as one line of comment; it may hold names out of a file."""
    line = f"# {text.replace(chr(10), ' ')}"
    return line if len(line) <= WIDTH else f"{line[: WIDTH - 1]}…"
