"""Rows that vanish, repeat, summarise or change their meaning."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from .case import Case, Truth
from .table import Layout, Sheet, sheet
from .units import FIVE

ROWS, FILES = "rows", "more than one table"
LOST = frozenset({"nan_block", "time_gap"})
LINES = r"missing|no text|gap|closes? up|\btime (column|base|axis|goes|shift)|back|rate"
TWICE = "twice|both|duplicate|several|2 columns|more than one"
BYTES = r"0x|byte|character|no number|no text"
PLACES = [30, 31, 32, 90, 150, 151]


def without(truth: dict[str, np.ndarray], places: list[int]) -> dict[str, np.ndarray]:
    """Return the truth with these samples missing; their time goes on."""
    lost = {}
    for channel, values in truth.items():
        values = values.astype(float).copy()
        if channel != "time_s":
            values[places] = np.nan
        lost[channel] = values
    return lost


def replaced(text: Callable[[str], str], places: list[int]) -> Callable[[list[str]], list[str]]:
    """Return a change of some lines."""
    return lambda lines: [text(line) if i in places else line for i, line in enumerate(lines)]


def added(text: Callable[[str], str], places: list[int]) -> Callable[[list[str]], list[str]]:
    """Return a change that puts a line behind some lines."""
    return lambda lines: [
        piece for i, line in enumerate(lines)
        for piece in ((line, text(line)) if i in places else (line,))
    ]  # fmt: skip


RATE = {"time_s": "rate 1 Hz"}
"""`[columns]` of a file without a time column."""


def timeless(number: int) -> Sheet:
    """Return a heat run without a time column, at a rate of 1 Hz."""
    made = sheet(number, rows=200, step_s=1.0)
    columns = tuple(c for c in made.columns if c.channel != "time_s")
    return replace(made, columns=columns, tolerance={**made.tolerance, "time_s": 1e-6})


def asked(name: str, made: Sheet, layout: Layout, lost: list[int], **more) -> Case:
    """Return the case of a file that has lost some samples, which the reader must say."""
    more = {"true_faults": LOST, "subject": LINES, **more}
    return made.case(ROWS, name, Truth.ASK, layout, channels=without(made.truth, lost), **more)


def lost_rows() -> Iterator[Case]:
    """Rows without values, with and without a time column."""
    kinds: tuple[tuple[str, Callable[[str, str], str]], ...] = (
        ("empty cells", lambda line, d: d * line.count(d)),
        ("blank lines", lambda line, d: ""),
        ("lines of spaces", lambda line, d: "   "),
        ("short lines", lambda line, d: d.join(line.split(d)[:2])),
        ("long lines", lambda line, d: line + d + "7" + d + "8"),
        ("words", lambda line, d: "--- pause ---"),
        ("a word in every cell", lambda line, d: d.join(["lost"] * (line.count(d) + 1))),
        ("NaN in every cell", lambda line, d: d.join(["NaN"] * (line.count(d) + 1))),
        ("dashes in every cell", lambda line, d: d.join(["-"] * (line.count(d) + 1))),
        ("a comment", lambda line, d: "# lost"),
        ("one cell", lambda line, d: line.split(d)[0]),
        ("an open quote", lambda line, d: '"' + line),
        ("quoted emptiness", lambda line, d: d.join(['""'] * (line.count(d) + 1))),
        ("one delimiter", lambda line, d: d),
        ("NUL bytes", lambda line, d: "\0" * 12),
    )
    for number, (name, text) in enumerate(kinds):
        for delimiter in ";,":
            # A comment between two samples is no sample itself.
            if name == "a comment" or (delimiter == "," and number > 6):
                continue
            made = timeless(number)
            change = replaced(lambda line, text=text, d=delimiter: text(line, d), PLACES)
            # In place, each is a sample that is missing; the time never closes up.
            yield asked(f"{name}, {delimiter!r}, without a time column", made,
                        Layout(delimiter, rows=change), PLACES, columns=RATE,
                        held=made.truth)  # fmt: skip
        made = sheet(number, rows=200, step_s=1.0)
        change = replaced(lambda line, text=text: text(line, ";"), PLACES)
        yield asked(f"{name}, with a time column", made, Layout(";", rows=change), PLACES,
                    held=made.truth)  # fmt: skip
    for number, (name, text) in enumerate((
        ("empty cells", ";;;"), ("blank lines", ""), ("spaces", "  "),
    )):  # fmt: skip
        fifteenth = list(range(15, 200, 15))
        for label, made, places, more in (
            (" at every fifteenth sample", timeless(number), fifteenth, {"columns": RATE}),
            (", rate behind the file name", timeless(number + 4), PLACES, {"at": "@1Hz"}),
        ):
            layout = Layout(";", rows=replaced(lambda line, text=text: text, places))
            yield asked(f"{name}{label}", made, layout, places, **more)
    # Lines that never were samples.
    for number, text in enumerate(("", "# event: load step", ";;;;")):
        made = sheet(number, rows=200, step_s=1.0)
        change = added(lambda line, text=text: text, PLACES)
        yield made.case(
            ROWS, f"{text!r} between samples with a time column", Truth.READ,
            Layout(delimiter=";", rows=change),
        )  # fmt: skip
    made = sheet(3, rows=200, step_s=1.0)
    double_spaced = Layout(newline="\n\n")
    yield made.case(ROWS, "a blank line behind every line", Truth.READ, double_spaced)
    for name, layout in (
        ("a blank line behind every line", double_spaced), ("CR CR LF", Layout(newline="\r\r\n")),
    ):  # fmt: skip
        yield timeless(4).case(ROWS, f"{name}, without a time column", Truth.ASK, layout,
                               columns=RATE, subject=LINES)  # fmt: skip


def ends() -> Iterator[Case]:
    """Bytes that end a file early, and lines that summarise it."""
    for number, (name, text) in enumerate((
        ("0x1A in a cell", "\x1a"), ("0x1A behind a number", "5\x1a"), ("0x04 in a cell", "\x04"),
        ("NUL in a cell", "\0"), ("form feed in a cell", "\f"), ("0x85 in a cell", "\x85"),
        ("line separator in a cell", "\u2028"), ("vertical tab in a cell", "\v"),
        ("0x1C in a cell", "\x1c"),
    )):  # fmt: skip
        made = sheet(number, rows=200)
        places = [80]
        change = replaced(lambda line, text=text: line.rpartition(",")[0] + "," + text, places)
        lost = without(made.truth, [])
        lost["winding_degC"][places] = np.nan
        yield made.case(
            ROWS, name, Truth.ASK, Layout(rows=change), channels=lost,
            true_faults=frozenset({"nan_block"}), subject=BYTES, held=made.truth,
        )  # fmt: skip
        if number > 2:
            continue
        change = replaced(lambda line, text=text: f"{text}{line}", places)
        yield asked(f"{name}, in front of a line", made, Layout(rows=change), places,
                    subject=BYTES, held=made.truth)  # fmt: skip
    made = sheet(0, rows=200)
    yield made.case(ROWS, "0x1A at the end, as DOS wrote it", Truth.READ, made.text() + b"\x1a")
    for number, lines in enumerate((
        ("Mean,{i},{p},{a},{w}",), ("Max,{i},{p},{a},{w}",),
        ("Min,{i},{p},{a},{w}", "Max,{i},{p},{a},{w}", "Mean,{i},{p},{a},{w}"),
        (",{i},{p},{a},{w}",), ("Average:,{i},{p},{a},{w}",), ("", "Mean,{i},{p},{a},{w}"),
        ("Mittelwert,{i},{p},{a},{w}",), ("End of file",), ("*** END ***", "", ""),
        ("0,{i},{p},{a},{w}",), ("Total samples,200,,,",), ("Std. dev.,{i},{p},{a},{w}",),
    )):  # fmt: skip
        made = sheet(number, rows=200)
        means = {key: f"{np.mean(made.truth[channel]):.3f}" for key, channel in zip(
            "ipaw", FIVE[1:], strict=True)}  # fmt: skip
        after = tuple(line.format(**means) for line in lines)
        yield made.case(
            ROWS, f"at the end: {' / '.join(lines)}", Truth.ASK, Layout(after=after),
            true_faults=LOST, subject=LINES + "|end|summary|last line",
        )  # fmt: skip
        if lines[0].startswith(("Max", "Average", "Std")):
            text = lines[0].format(**means)
            for name, last in (("a word in front", text), ("no word", text.partition(",")[2])):
                yield timeless(number).case(
                    ROWS, f"at the end, no time, {name}: {lines[0]}", Truth.ASK,
                    Layout(after=("", last)), columns=RATE,
                    subject=LINES + "|end|summary|last line",
                )  # fmt: skip


def tables() -> Iterator[Case]:
    """Repeated names, changed units and second tables in one file."""
    header = ",".join(FIVE)
    for number, lines in enumerate(([header], ["", header], [header, "s,A,W,degC,degC"])):
        made = sheet(number, rows=200, step_s=1.0)
        change = added(lambda line, lines=lines: "\n".join(lines), [99])
        yield made.case(
            FILES, f"names again in the middle: {' / '.join(lines)}", Truth.ASK,
            Layout(rows=change), subject=LINES + "|names|table|header",
        )  # fmt: skip
    for number, (channel, second, unit) in enumerate((
        ("losses_W", "losses [kW]", "kW"), ("winding_degC", "winding [K]", "K"),
        ("phase_current_A", "phase_current [mA]", "mA"), ("winding_degC", "winding [°F]", "degF"),
    )):  # fmt: skip
        one = sheet(number, rows=200, step_s=1.0)
        two = sheet(number, rows=200, step_s=1.0, units={channel: unit}, headers={channel: second})
        first = one.text().decode().splitlines()
        rest = two.text().decode().splitlines()
        for gap in ([], [""]):
            text = "\n".join([*first[:101], *gap, rest[0], *rest[101:]]) + "\n"
            yield one.case(
                FILES, f"unit changes to {unit} in the middle, blank lines {len(gap)}", Truth.ASK,
                text.encode(), subject="unit|names|header|second table",
            )  # fmt: skip
        text = "\n".join([*first[:101], f"# {second}", *rest[101:]]) + "\n"
        yield one.case(
            FILES, f"a comment changes the unit to {unit}", Truth.ASK, text.encode(),
            subject="unit|comment",
        )  # fmt: skip
    for number, gap in enumerate(("\n", "\n\n", "\nTest 2\n", "\n\nTable 2\n\n")):
        one, two = sheet(number, rows=150), sheet(number + 1, rows=150)
        content = one.text() + gap.encode() + two.text()
        yield one.case(
            FILES, f"two tests in one file, {gap!r} between", Truth.ASK, content,
            subject="time|table|test|names|header",
        )  # fmt: skip
    one = sheet(2, rows=150)
    content = one.text() + b"\nFFT\nfrequency,amplitude\n" + b"".join(
        b"%d,%d\n" % (i, 50 - i) for i in range(40)
    )  # fmt: skip
    yield one.case(FILES, "a table of something else below", Truth.ASK, content,
                   true_faults=LOST, subject="table|row|line|time")  # fmt: skip
    # Duplicate names: which one is meant?
    for number, channel in enumerate(("winding_degC", "losses_W", "time_s", "phase_current_A")):
        made = sheet(
            number, rows=200, channels=(*FIVE, "stator_degC"), headers={"stator_degC": channel}
        )
        truth = {name: made.truth[name] for name in FIVE}
        yield made.case(FILES, f"two columns {channel}", Truth.CONFLICT, channels=truth,
                        subject=TWICE)  # fmt: skip
        is_time = channel == "time_s"
        headers = {channel: "X [ms]" if is_time else "X", "stator_degC": "X"}
        made = sheet(number, rows=200, units={channel: "ms"} if is_time else {},
                     channels=(*FIVE, "stator_degC"), headers=headers)  # fmt: skip
        yield made.case(FILES, f"two columns X, one of them as {channel}", Truth.CONFLICT,
                        channels=truth, columns={channel: "X"}, subject=TWICE)  # fmt: skip
    made = sheet(
        1, rows=200, channels=(*FIVE, "stator_degC"), headers={"stator_degC": "winding [K]"}
    )
    yield made.case(
        FILES, "winding_degC beside winding [K]", Truth.ASK,
        channels={name: made.truth[name] for name in FIVE},
        subject="twice|two|duplicate|several|same|unit|both|either",
    )  # fmt: skip
