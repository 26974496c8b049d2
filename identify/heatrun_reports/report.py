"""What every report is made of: a table, more tables by part or signal, figures, findings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from heatrun.record.record import Finding, Source

from .analysis.equilibrium import ThermalBehaviour
from .analysis.general_information import GeneralInformation
from .analysis.validation import Validation
from .bench_test_types import Kind
from .prototypes import Confrontation

Cell = float | str | None
"""A number, a word, or None where undefined."""


@dataclass(frozen=True)
class Row:
    """One figure of the main table.

    Attributes:
        name: Stable name with the unit at its end, for JSON.
        label: As printed.
        value: None where undefined; the note then says why.
        unit: As printed, empty for words.
        note: Where it comes from, or why it is undefined; may be empty.
        places: Decimal places as printed, negative for tens; None for five digits. JSON and CSV
            hold every digit.
    """

    name: str
    label: str
    value: Cell
    unit: str
    note: str = ""
    places: int | None = None


@dataclass(frozen=True)
class Column:
    """A column of a further table.

    Attributes:
        label: As printed.
        unit: Unit of its cells; None where each line has its own.
    """

    label: str
    unit: str | None = None


@dataclass(frozen=True)
class Line:
    """A line of a further table.

    Attributes:
        name: What it is about, such as a channel.
        unit: Unit of the cells whose column has none.
        cells: As many as columns.
        note: May be empty.
        places: Decimal places of each cell as printed; None, or no such tuple, for four digits.
    """

    name: str
    unit: str
    cells: tuple[Cell, ...]
    note: str = ""
    places: tuple[int | None, ...] = ()


@dataclass(frozen=True)
class Table:
    """A further table: one line for each signal or part of the machine.

    Attributes:
        title: Heading.
        columns: Of the cells.
        lines: From top to bottom.
        note: A sentence below it; may be empty.
    """

    title: str
    columns: tuple[Column, ...]
    lines: tuple[Line, ...]
    note: str = ""


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn when it is asked for.

    Attributes:
        name: For file names, such as `"courses"`.
        caption: A sentence below it.
        draw: Returns the figure.
    """

    name: str
    caption: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Report:
    """A report of one test, before it is typeset.

    Attributes:
        kind: Test type.
        title: As printed.
        test: Name of the test.
        motor: Name of the motor.
        summary: What came out, in one or two sentences.
        rows: The main table.
        tables: Further tables.
        drawings: Figures in their order.
        findings: What is doubtful or missing.
        definitions: What the figures mean, by name.
        channels: Canonical channels that the report shows.
        sources: The files behind it.
        result: What the rows were taken from, for views that draw for themselves.
    """

    kind: Kind
    title: str
    test: str
    motor: str
    summary: str
    rows: tuple[Row, ...]
    tables: tuple[Table, ...]
    drawings: tuple[Drawing, ...]
    findings: tuple[Finding, ...]
    definitions: tuple[tuple[str, str], ...]
    channels: tuple[str, ...]
    sources: tuple[Source, ...]
    result: GeneralInformation | ThermalBehaviour | Validation | Confrontation
