"""How numbers are written: commas, thousands, exponents, units in cells, marks for no value."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from .case import Case, Truth
from .table import Layout, Sheet, sheet
from .units import FIVE, SEVEN

MARKS, WRITTEN = "marks for no value", "writing of numbers"
NBSP, THIN = "\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}"
GAPS = frozenset({"nan_block"})
SEMICOLON = Layout(delimiter=";")


def comma(cell: str) -> str:
    """Return a number with a decimal comma."""
    return cell.replace(".", ",")


def grouped(mark: str, point: str = ".") -> Callable[[str], str]:
    """Return a function that groups thousands."""

    def change(cell: str) -> str:
        whole, _, rest = cell.partition(".")
        text = f"{int(whole):,}".replace(",", mark)
        return text + point + rest if rest else text

    return change


def milliwatts(number: int, decimals: int = 0, channels: tuple[str, ...] = FIVE) -> Sheet:
    """Return a heat run whose losses are large numbers, in mW, with a stated unit."""
    return sheet(
        number, rows=240, channels=channels, units={"losses_W": "mW"},
        decimals={"losses_W": decimals, "time_s": 1},
    )  # fmt: skip


def whole(number: int, mark: str, **more) -> Sheet:
    """Return a heat run in integers, of which the losses are grouped by thousands."""
    integers = dict.fromkeys(FIVE, 0)
    made = sheet(number, rows=240, step_s=2, decimals=integers, **more)
    return made.with_cells("losses_W", grouped(mark))


def writings() -> Iterator[Case]:
    """Decimal commas, thousands, exponents and units in cells."""
    cause, READ, ASK = WRITTEN, Truth.READ, Truth.ASK
    for number, (name, layout) in enumerate((
        ("semicolons", SEMICOLON), ("tabs", Layout(delimiter="\t")),
        ("bars", Layout(delimiter="|")), ("spaces", Layout(delimiter="  ")),
        ("semicolon and space", Layout(delimiter="; ")),
    )):  # fmt: skip
        made = sheet(number, rows=240).with_cells("*", comma)
        yield made.case(cause, f"decimal comma, {name}", READ, layout)
    made = sheet(5, rows=240).with_cells("*", lambda cell: f'"{comma(cell)}"')
    yield made.case(cause, "decimal comma, quoted among commas", READ)
    made = sheet(6, rows=240, decimals={"time_s": 0}).with_cells("losses_W", comma)
    yield made.case(cause, "decimal comma in one column, point in the others", ASK, SEMICOLON,
                    subject="comma|decimal|thousand|point")  # fmt: skip
    # Thousands that the other columns settle.
    for number, (name, mark, point, layout) in enumerate((
        ("point and decimal comma", ".", ",", SEMICOLON),
        ("no-break space and decimal comma", NBSP, ",", SEMICOLON),
        ("narrow no-break space and decimal comma", THIN, ",", SEMICOLON),
        ("space and decimal comma", " ", ",", SEMICOLON),
        ("apostrophe and point", "'", ".", SEMICOLON),
        ("curly apostrophe and point", "\N{RIGHT SINGLE QUOTATION MARK}", ".", SEMICOLON),
        ("comma and point", ",", ".", SEMICOLON),
        ("underscore and point", "_", ".", SEMICOLON),
    )):  # fmt: skip
        for decimals in (0, 1):
            made = milliwatts(number, decimals).with_cells("losses_W", grouped(mark, point))
            for channel in FIVE:
                if channel != "losses_W" and point == ",":
                    made = made.with_cells(channel, comma)
            yield made.case(
                cause, f"thousands: {name}, {decimals} decimals", READ, layout,
                subject="thousand|comma|point|number|digit",
            )  # fmt: skip
    made = milliwatts(3, 1).with_cells("losses_W", lambda cell: f'"{grouped(",")(cell)}"')
    yield made.case(cause, "thousands with commas, quoted among commas", READ)
    # Integers alone: 4.500 may be four and a half.
    for number, mark in enumerate(".,"):
        for unit in ("W", "kW", "mW"):
            if unit == "kW":
                made = sheet(number, rows=240, units={"losses_W": "kW"},
                             decimals={**dict.fromkeys(FIVE, 0), "losses_W": 3})  # fmt: skip
                made = made.with_cells("losses_W", lambda cell, mark=mark: cell.replace(".", mark))
            else:
                made = whole(3 if unit == "W" else number, mark, units={"losses_W": unit})
            said, doubt = f"integers beside 4{mark}500", "thousand|decimal|comma|point|digits"
            yield made.case(cause, f"{said}, truth in {unit}", ASK, SEMICOLON, subject=doubt)
            yield made.headed({"losses_W": "losses"}).case(
                cause, f"{said}, no unit, truth in {unit}", ASK, SEMICOLON,
                subject=f"{doubt}|unit|factor",
            )  # fmt: skip
    made = whole(3, ".", units={"losses_W": "mW"}).with_cells("winding_degC", lambda c: c + ",0")
    yield made.case(cause, "4.500 beside a decimal comma in one other column", READ, SEMICOLON)
    made = whole(3, ",", units={"losses_W": "mW"}).with_cells("winding_degC", lambda c: c + ".0")
    yield made.case(cause, "4,500 beside a decimal point in one other column", READ, SEMICOLON)
    for number, (name, change) in enumerate((
        ("exponent", lambda cell: f"{float(cell):.9e}"),
        ("exponent, upper case", lambda cell: f"{float(cell):.9E}"),
        ("exponent, three digits",
         lambda cell: f"{float(cell):.9E}".replace("E+", "E+0").replace("E-", "E-0")),
        ("exponent of Fortran", lambda cell: f"{float(cell):.9E}".replace("E", "D")),
        ("plus signs", lambda cell: f"+{cell}"), ("padded in front", lambda cell: f"{cell:>14}"),
        ("padded behind", lambda cell: f"{cell:<14}"),
        ("no-break space in front", lambda cell: NBSP + cell),
        ("leading zeros", lambda cell: f"{float(cell):015.6f}"),
        ("no zero in front of the point", lambda cell: cell.removeprefix("0") or "0"),
        ("point at the end", lambda cell: cell if "." in cell else cell + "."),
        ("quoted", lambda cell: f'"{cell}"'), ("quoted and padded", lambda cell: f'" {cell} "'),
        ("Excel text formula", lambda cell: f'="{cell}"'),
        ("apostrophe in front", lambda cell: f"'{cell}"),
    )):  # fmt: skip
        made = sheet(number, rows=240).with_cells("*", change)
        odd = name in ("exponent of Fortran", "Excel text formula", "apostrophe in front")
        yield made.case(cause, name, ASK if odd else READ, subject="number|value|column")
    made = sheet(1, rows=240).with_cells("*", lambda cell: comma(f"{float(cell):.9E}"))
    yield made.case(cause, "exponent with decimal comma", READ, SEMICOLON)
    cold = sheet(2, rows=240, channels=SEVEN)
    shift = replace(cold, truth={**cold.truth, "ambient_degC": cold.truth["ambient_degC"] - 30})
    for name, mark, truth in (("hyphen", "-", READ), ("minus sign", "\N{MINUS SIGN}", READ),
                              ("en dash", "\N{EN DASH}", ASK)):  # fmt: skip
        made = shift.with_cells(
            "ambient_degC", lambda cell, mark=mark: f"{float(cell) - 30:.4f}".replace("-", mark)
        )
        yield made.case(cause, f"below zero with a {name}", truth, subject="ambient|number|minus")
    # Units in the cells.
    for number, (name, channel, unit, change) in enumerate((
        ("1.2 kW", "losses_W", "kW", lambda cell: f"{cell} kW"),
        ("1.2kW", "losses_W", "kW", lambda cell: f"{cell}kW"),
        ("350 W", "losses_W", "W", lambda cell: f"{cell} W"),
        ("23.5 °C", "winding_degC", "degC", lambda cell: f"{cell} °C"),
        ("296.1 K", "winding_degC", "K", lambda cell: f"{cell} K"),
        ("74.1 °F", "winding_degC", "degF", lambda cell: f"{cell}°F"),
        ("5 min", "time_s", "min", lambda cell: f"{cell} min"),
        ("200 mA", "phase_current_A", "mA", lambda cell: f"{cell} mA"),
    )):  # fmt: skip
        stem = {"losses_W": "losses", "winding_degC": "winding", "time_s": "time",
                "phase_current_A": "phase_current"}[channel]  # fmt: skip
        made = sheet(number, rows=240, units={channel: unit}, headers={channel: stem})
        made = made.with_cells(channel, change)
        yield made.case(cause, f"unit in the cells: {name}", ASK, subject=f"{stem}|unit|number")
    made = sheet(0, rows=240, headers={"losses_W": "losses"})
    turn = iter(range(10**6))

    def mixed(cell: str) -> str:
        return f"{float(cell) / 1000:.7f} kW" if next(turn) % 2 else f"{cell} W"

    yield made.with_cells("losses_W", mixed).case(
        cause, "unit in the cells, mixed", ASK, subject="losses|unit|number"
    )


def marked(made: Sheet, channel: str, text: str, where: slice | list[int]) -> Sheet:
    """Return the same with some cells of a channel replaced by a mark, and NaN in the truth."""
    truth = made.truth[channel].copy()
    truth[where] = np.nan
    cells = np.array(next(c.cells for c in made.columns if c.channel == channel), dtype=object)
    cells[where] = text
    columns = tuple(
        replace(c, cells=tuple(cells)) if c.channel == channel else c for c in made.columns
    )
    return replace(made, columns=columns, truth={**made.truth, channel: truth})


def marks() -> Iterator[Case]:
    """Words and numbers that stand for no value."""
    places = [40, 41, 42, 150, 151, 207]
    for number, text in enumerate((
        "", " ", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "#NV", "null", "NULL", "None",
        "-", "--", "---", "?", "*", "*****", "1.#QNAN", "-1.#IND", "OL", "OVER", "Overload",
        "BURNOUT", "Open", "#DIV/0!", "invalid", "ERR", "Error 17", '""', "-nan(ind)", ".",
    )):  # fmt: skip
        made = marked(sheet(number, rows=240), "winding_degC", text, places)
        known = text.strip().lower() in ("", "nan", "na", "n/a", "#n/a", "null", "-", "--", "---")
        truth = Truth.READ if known else Truth.ASK
        yield made.case(
            MARKS, repr(text), truth, true_faults=GAPS, subject="missing|no number|not numbers"
        )
    for number, text in enumerate((
        "9.9E+37", "9.90000000E+37", "1E+99", "-9999", "-999.9", "32767", "6553.5", "850", "inf",
        "Infinity", "-273.15", "1e308",
    )):  # fmt: skip
        made = marked(sheet(number, rows=240), "winding_degC", text, places)
        yield made.case(MARKS, f"number {text}", Truth.ASK, subject="winding")
    made = marked(sheet(1, rows=240, headers={"losses_W": "losses [W]"}), "losses_W", "NaN", places)
    yield made.case(MARKS, "NaN in the losses", Truth.READ, true_faults=GAPS)
    whole = sheet(2, rows=240)  # a channel of half the rate is joined by straight lines
    made = marked(whole, "ambient_degC", "", slice(1, -1, 2))
    yield made.case(MARKS, "ambient at every second sample", Truth.READ, channels=whole.truth)
