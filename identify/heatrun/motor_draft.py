"""The text of a motor file for tests that nobody has described yet: what `heatrun init` writes.

What is recognised, proposed or missing stands in comments, and nothing that was not read from the
files is set: a line holds once a person has removed the # in front of it.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence, Set
from pathlib import Path

from .bench.channels.schema import CHANNEL
from .bench.free_columns import flat
from .bench.survey import Survey
from .io.printable import printable
from .motor_gaps import LONGEST_LINE, Gap, found_resistance, gaps
from .motor_keys import (
    COLUMNS,
    CONSTANTS,
    INSTRUMENTS,
    PARAMETERS,
    SECTIONS,
    SENSORS,
    TESTS,
    WINDING,
    Key,
    Section,
)
from .motor_stated import stated_resistance
from .version import __version__

WIDTH = 96


def draft(name: str, surveys: Sequence[Survey]) -> str:
    """Return the text of a commented motor file that loads as it is.

    Args:
        name: Of the machine; a blank one becomes "motor".
        surveys: What the files hold, from `heatrun.bench.survey.survey`.
    """
    missing = gaps(surveys)
    lines = [*_head(surveys, missing), ""]
    for section in SECTIONS:
        lines += _section(section, name, surveys, missing)
        lines.append("")
    return "\n".join(lines).rstrip("\n") + "\n"


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
        *_comment(f"Motor file for {files}, drafted by heatrun init (heatrun {__version__})."),
        *_comment(
            "What stands behind a # is a comment. To set something, remove the # in front of its "
            "line and put in your value."
        ),
        "#",
    ]
    if not missing:
        lines += _comment("All channels that a calibration needs are recognised.")
    else:
        lines += _comment("Missing, and why it matters:")
        for number, gap in enumerate(missing, 1):
            lines += _comment(f"{number}. {gap.place}: {gap.sentence}", indent="   ")
    for one in surveys:
        for question in one.questions:
            lines += _comment(f"Open: {question}")
    return lines


def _section(
    section: Section, name: str, surveys: Sequence[Survey], missing: Sequence[Gap]
) -> list[str]:
    lines = _comment(section.meaning)
    # each of these stands once for each of several things
    example = {PARAMETERS: "Ceq_w", TESTS: "NAME", INSTRUMENTS: ""}.get(section)
    if example is not None:
        lines.append(f"# {section.heading.replace('NAME', example)}")
        for key in section.keys:
            lines += _comment(f"{key.meaning} Default: {key.default}.")
            lines.append(f"# {key.name} = {key.example}")
        return lines
    lines.append(section.heading)
    if section is COLUMNS:
        return lines + _columns(surveys, missing)
    if section is CONSTANTS:
        return lines + _constants(missing)
    if section is SENSORS:
        return [*lines, '# tooth_degC = "stator"', '# stator_degC = "none"']
    known = {"name": toml_text(name.strip() or "motor")} | found_resistance(surveys)
    stated = stated_resistance(surveys) if section is WINDING else {}
    for key in section.keys:
        gap = next((gap for gap in missing if gap.key == key.name), None)
        lines += _comment(f"{key.meaning} Default: {key.default}.")
        lines += gap.lines if gap else ()
        if key.name not in known and stated.get(key.name):
            lines += [
                f"# {key.name} = {value!r}  # from {where}"
                for value, where in stated[key.name].items()
            ]
        else:
            lines.append(_key(key, known.get(key.name), is_missing=gap is not None))
    return lines


def _key(key: Key, value: str | None, *, is_missing: bool) -> str:
    if value:
        return f"{key.name} = {value}"
    return _blank(key.name, key.example) if is_missing else f"# {key.name} = {key.example}"


def _blank(name: str, example: str) -> str:
    """Return a line that no file loads with before a number was put in: an example is none."""
    return f"# {name} =    # put in the number, such as {example}"


def _columns(surveys: Sequence[Survey], missing: Sequence[Gap]) -> list[str]:
    lines = []
    for one in surveys:
        if one.recognised or one.derived:
            lines += ["#", *_comment(f"Recognised in {Path(one.path).name} (nothing to do):")]
        for reading in one.recognised:
            is_assumed = reading.unit_from == "assumed"
            side = f"{reading.column} [{reading.unit}]" if is_assumed else reading.column
            how = f"unit {reading.unit} ASSUMED: " if is_assumed else ""
            more = "remove the # to state it; " if is_assumed else ""
            lines.append(_line(reading.channel, side, f"{how}{more}{reading.found_by}"))
        lines += [f"#   {channel} = {formula}" for channel, formula in one.derived.items()]
        for silent in one.silent:
            column = printable(flat(silent.column))
            lines += _comment(
                f"  {silent.channel} from column '{column}' of {Path(one.path).name}: "
                f"{silent.held}. Name another column if this one was not recorded.",
                indent="    ",
            )
    for gap in missing:
        if gap.channel in CHANNEL and gap.candidates:
            title = f"Candidates for {gap.channel} ({CHANNEL[gap.channel].meaning}), likely first:"
            lines += ["#", *_comment(title)]
            lines += [_line(gap.channel, side, note) for side, note in gap.candidates]
    settled = {channel for one in surveys for channel in one.channels}
    settled |= {gap.channel for gap in missing}
    shown = {side for gap in missing for side, _ in gap.candidates}
    for one in surveys:
        lines += _free(one, settled, shown)
    return lines


def _free(one: Survey, settled: Set[str], shown: Set[str]) -> list[str]:
    """Return the columns that no channel claims, with a line for what each may be.

    Args:
        one: What a file holds.
        settled: Channels that are recognised, or whose candidates stand above.
        shown: Right-hand sides that stand above.
    """
    free = [c for c in one.free if not shown & {c.name, *(p.line for p in c.proposals)}]
    if not free:
        return []
    lines = ["#", *_comment(f"Columns of {Path(one.path).name} that no channel claims:")]
    for column in free:
        likely = [p for p in column.proposals if p.is_likely and p.channel not in settled]
        if likely and not column.is_silent and len(likely[0].line) <= LONGEST_LINE:
            lines.append(_line(likely[0].channel, likely[0].line, column.shown()))
        else:
            lines.append(f"#   {printable(flat(column.name))}: {column.shown()}")
    return lines


def _constants(missing: Sequence[Gap]) -> list[str]:
    lines = [line for gap in missing for line in gap.constants]
    if not any(line.startswith("# ambient_degC") for line in lines):
        is_missing = any(gap.channel == "ambient_degC" for gap in missing)
        lines.append(_blank("ambient_degC", "22.0") if is_missing else "# ambient_degC = 22.0")
    return lines


def _line(channel: str, side: str, note: str) -> str:
    return f"# {channel} = {toml_text(side)}  # {printable(flat(note))}"


def _comment(text: str, indent: str = "") -> list[str]:
    """Return a text as lines of comment; it may hold names out of a file."""
    wrapped = textwrap.wrap(
        printable(flat(text)),
        WIDTH - 2,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [f"# {line}" for line in wrapped]
