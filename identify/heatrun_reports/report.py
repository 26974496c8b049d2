"""The bench's test types, and what every report of one is made of.

Each type has a card: what it is called, needs and shows. A report is a table, more tables by part
or signal, figures and findings.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from heatrun.model.network_form import NetworkForm
from heatrun.record.channels import CHANNEL, CHANNELS
from heatrun.record.record import Finding, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Kind = Literal["general", "thermal", "energy", "virtual", "real", "prototypes"]
"""Test type, as `heatrun report --type` takes it."""


@dataclass(frozen=True)
class BenchTestType:
    """The card of a test type."""

    title: str  # As it stands in the bench's menu.
    stem: str  # Beginning of the report's file name.
    heading: str  # Heading of the main table.
    sentence: str  # What the report answers.
    optional: tuple[str, ...]  # Canonical channels shown where they were recorded.
    needed: str = ""  # What the record must hold, in words; empty for nothing.
    # Sets of canonical channels; one of them must be there as a whole.
    any_of: tuple[tuple[str, ...], ...] = ()
    needs_reference: bool = False  # Whether a second record is compared.

    @property
    def channels(self) -> tuple[str, ...]:
        """Every canonical channel that the report can show, in the order of the schema."""
        named = {*self.optional, *(c for names in self.any_of for c in names)}
        return tuple(channel.name for channel in CHANNELS if channel.name in named)

    def lacks(self, channels: Container[str]) -> str:
        """Return what channels lack for this report, in words; empty for nothing."""
        is_met = any(all(c in channels for c in names) for names in self.any_of)
        return "" if is_met else self.needed


NOT_OF_THE_MACHINE = ("ambient_degC", "coolant_degC", "coolant_out_degC", "controller_degC")
"""Temperatures of which no rise over the sink is judged."""

_ALL = tuple(channel.name for channel in CHANNELS if channel.name != "time_s")

TEST_TYPES: dict[Kind, BenchTestType] = {
    "general": BenchTestType(
        "General Test",
        "GeneralInformationTest",
        "General Information",
        "Every recorded signal over time, and the General Information table of energy, distance "
        "and consumption.",
        _ALL,
    ),
    "thermal": BenchTestType(
        "Thermal Behaviour Analysis",
        "ThermalBehaviourAnalysis",
        "Thermal behaviour",
        "Temperatures, split of the losses, thermal equilibrium, and the network of a run beside "
        "the measured winding.",
        (*NOT_OF_THE_MACHINE, "phase_current_A", "losses_W", "speed_rpm", "torque_Nm",
         "coolant_flow_L_per_min", "fan"),
        "temperature of the machine",
        tuple((c.name,) for c in CHANNELS
              if c.unit == "degC" and c.name not in NOT_OF_THE_MACHINE),
    ),
    "energy": BenchTestType(
        "Energy Consumption",
        "EnergyConsumption",
        "Energy and consumption",
        "Energy drawn, fed back and at the shaft, power and efficiency by load; of a vehicle also "
        "distance and consumption.",
        ("vehicle_speed_km_per_h", "speed_rpm", "torque_Nm", "mechanical_power_W"),
        "electrical power",
        (("dc_voltage_V", "dc_current_A"), ("dc_power_W",), ("electrical_power_W",),
         ("u_d_V", "u_q_V", "i_d_A", "i_q_A")),
    ),
    "virtual": BenchTestType(
        "Semi-real against Virtual Model Validation",
        "SemiRealVsVirtualModelValidation",
        "Alignment and outcome",
        "The bench beside a simulation of the same manoeuvre, signal by signal with a verdict.",
        _ALL,
        needs_reference=True,
    ),
    "real": BenchTestType(
        "Semi-real against Real Prototype Validation",
        "SemiRealVsRealPrototypeValidation",
        "Alignment and outcome",
        "The bench beside the road vehicle on the same manoeuvre, signal by signal with a verdict.",
        _ALL,
        needs_reference=True,
    ),
}  # fmt: skip
"""The test types by their word on the command line, in the order of the bench's menu."""

CARDS: dict[Kind, BenchTestType] = {
    **TEST_TYPES,
    "prototypes": BenchTestType(
        "Comparison of prototypes",
        "PrototypesComparison",
        "Outcome",
        "Any number of prototypes on one manoeuvre, each signal of each pair with a verdict.",
        _ALL,
    ),
}
"""Every kind of report; that of prototypes takes several records and is not in the bench's menu."""


def flow_words(form: NetworkForm) -> dict[tuple[str, str], tuple[str, str]]:
    """Return symbol and words of the heat flow of each link of a network.

    P_ws and P_se are the two flows of the thesis: from winding to stator, and from the machine to
    the sink that T0 stands for. Of two sinks, that one is named.
    """
    sink = f"the {form.sink}" if form.second_sink else "the sink"
    body = "stator" if "stator" in form.nodes else "winding"
    known = {
        ("winding", "stator"): ("P_ws", "winding to stator"),
        (body, form.sink): ("P_se", f"{body if body == 'stator' else 'machine'} to {sink}"),
    }
    return {link: known.get(link, unnamed(link)) for link, _ in form.resistance}


def unnamed(link: tuple[str, str]) -> tuple[str, str]:
    """Return what stands for symbol and words of a flow that has no symbol of its own."""
    return " to ".join(link), "heat flow"


def unit(channel: str, *, is_difference: bool = False) -> str:
    """Return the unit of a channel as it is printed."""
    symbol = CHANNEL[channel].unit
    if symbol == "degC":
        return "K" if is_difference else "°C"
    return "N m" if symbol == "Nm" else symbol


Cell = float | str | None
"""A number, a word, or None where undefined."""


@dataclass(frozen=True)
class Row:
    """One figure of the main table."""

    name: str  # Stable name with the unit at its end, for JSON.
    label: str  # As printed; likewise the unit, empty for words.
    value: Cell  # None where undefined; the note then says why.
    unit: str
    note: str = ""
    # Decimal places as printed, negative for tens; None for five digits. JSON and CSV hold every
    # digit.
    places: int | None = None


@dataclass(frozen=True)
class Column:
    """A column of a further table, with the unit of its cells; None where each line has its own."""

    label: str
    unit: str | None = None


@dataclass(frozen=True)
class Line:
    """A line of a further table."""

    name: str  # What it is about, such as a channel.
    unit: str  # Unit of the cells whose column has none.
    cells: tuple[Cell, ...]  # As many as columns.
    note: str = ""  # Below the table.
    # Decimal places of each cell as printed; None, or no such tuple, for four digits.
    places: tuple[int | None, ...] = ()


@dataclass(frozen=True)
class Table:
    """A further table, one line for each signal or part of the machine, with a note below it."""

    title: str
    columns: tuple[Column, ...]
    lines: tuple[Line, ...]
    note: str = ""

    def cells(self, line: Line) -> Iterator[tuple[str, Cell, str]]:
        """Give quantity, value and unit of each cell of a line."""
        for column, cell in zip(self.columns, line.cells, strict=True):
            yield column.label, cell, line.unit if column.unit is None else column.unit


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn when it is asked for, with the sentence below it."""

    caption: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Report:
    """A report of one test, before it is typeset."""

    kind: Kind
    test: str  # Name of the test; likewise `motor`.
    motor: str
    summary: str  # What came out, in one or two sentences.
    rows: tuple[Row, ...]  # The main table.
    tables: tuple[Table, ...]
    drawings: tuple[Drawing, ...]
    findings: tuple[Finding, ...]
    definitions: tuple[tuple[str, str], ...]  # What the figures mean, by name.
    channels: tuple[str, ...]  # Canonical channels that the report shows.
    sources: tuple[Source, ...]
    result: Any  # What the rows were taken from.

    @property
    def title(self) -> str:
        """As printed."""
        return CARDS[self.kind].title
