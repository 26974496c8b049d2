"""The bench's test types, and what every report of one is made of.

Each type has a card: what it is called, needs and shows. A report is a table, more tables by part
or signal, figures and findings.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from heatrun.model.network_form import NetworkForm
from heatrun.record.channels import CHANNELS
from heatrun.record.record import Finding, Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .analysis.equilibrium import ThermalBehaviour
    from .analysis.general_information import GeneralInformation
    from .analysis.validation import Validation
    from .prototypes import Confrontation

Kind = Literal["general", "thermal", "energy", "virtual", "real", "prototypes"]
"""Test type, as `heatrun report --type` takes it."""


@dataclass(frozen=True)
class Requirement:
    """Something that a report cannot be made without.

    Attributes:
        meaning: What it is, in words.
        any_of: Sets of canonical channels; one of them must be there as a whole.
    """

    meaning: str
    any_of: tuple[tuple[str, ...], ...]

    def is_met(self, channels: Container[str]) -> bool:
        """Return whether channels hold one of the sets."""
        return any(all(channel in channels for channel in names) for names in self.any_of)


@dataclass(frozen=True)
class BenchTestType:
    """The card of a test type.

    Attributes:
        kind: As `heatrun report --type` takes it.
        title: As it stands in the bench's menu.
        stem: Beginning of the report's file name.
        heading: Heading of the main table.
        sentence: What the report answers.
        required: What the record must hold.
        optional: Canonical channels shown where they were recorded.
        needs_reference: Whether a second record is compared.
    """

    kind: Kind
    title: str
    stem: str
    heading: str
    sentence: str
    required: tuple[Requirement, ...]
    optional: tuple[str, ...]
    needs_reference: bool = False

    @property
    def channels(self) -> tuple[str, ...]:
        """Every canonical channel that the report can show, in the order of the schema."""
        named = {c for need in self.required for names in need.any_of for c in names}
        named |= set(self.optional)
        return tuple(channel.name for channel in CHANNELS if channel.name in named)

    def missing(self, channels: Container[str]) -> tuple[Requirement, ...]:
        """Return what channels lack for this report."""
        return tuple(need for need in self.required if not need.is_met(channels))


NOT_OF_THE_MACHINE = ("ambient_degC", "coolant_degC", "coolant_out_degC", "controller_degC")
"""Temperatures of which no rise over the sink is judged."""

POWER = Requirement(
    "electrical power",
    (
        ("dc_voltage_V", "dc_current_A"),
        ("dc_power_W",),
        ("electrical_power_W",),
        ("u_d_V", "u_q_V", "i_d_A", "i_q_A"),
    ),
)
_TEMPERATURES = tuple(c.name for c in CHANNELS if c.unit == "degC")
TEMPERATURE = Requirement(
    "temperature of the machine",
    tuple((name,) for name in _TEMPERATURES if name not in NOT_OF_THE_MACHINE),
)
_ALL = tuple(channel.name for channel in CHANNELS if channel.name != "time_s")

_CARDS = (
    BenchTestType(
        "general",
        "General Test",
        "GeneralInformationTest",
        "General Information",
        "Every recorded signal over time, and the General Information table of energy, distance "
        "and consumption.",
        (),
        _ALL,
    ),
    BenchTestType(
        "thermal",
        "Thermal Behaviour Analysis",
        "ThermalBehaviourAnalysis",
        "Thermal behaviour",
        "Temperatures, split of the losses, thermal equilibrium, and the network of a run beside "
        "the measured winding.",
        (TEMPERATURE,),
        (*NOT_OF_THE_MACHINE, "phase_current_A", "losses_W", "speed_rpm", "torque_Nm",
         "coolant_flow_L_per_min", "fan"),
    ),
    BenchTestType(
        "energy",
        "Energy Consumption",
        "EnergyConsumption",
        "Energy and consumption",
        "Energy drawn, fed back and at the shaft, power and efficiency by load; of a vehicle also "
        "distance and consumption.",
        (POWER,),
        ("vehicle_speed_km_per_h", "speed_rpm", "torque_Nm", "mechanical_power_W"),
    ),
    BenchTestType(
        "virtual",
        "Semi-real against Virtual Model Validation",
        "SemiRealVsVirtualModelValidation",
        "Alignment and outcome",
        "The bench beside a simulation of the same manoeuvre, signal by signal with a verdict.",
        (),
        _ALL,
        needs_reference=True,
    ),
    BenchTestType(
        "real",
        "Semi-real against Real Prototype Validation",
        "SemiRealVsRealPrototypeValidation",
        "Alignment and outcome",
        "The bench beside the road vehicle on the same manoeuvre, signal by signal with a verdict.",
        (),
        _ALL,
        needs_reference=True,
    ),
)  # fmt: skip

TEST_TYPES: Mapping[Kind, BenchTestType] = MappingProxyType({card.kind: card for card in _CARDS})
"""The test types by their word on the command line, in the order of the bench's menu."""

PROTOTYPES = BenchTestType(
    "prototypes",
    "Comparison of prototypes",
    "PrototypesComparison",
    "Outcome",
    "Any number of prototypes on one manoeuvre, each signal of each pair with a verdict.",
    (),
    _ALL,
)
"""The report that takes several records at once; not in the menu of the bench."""

CARDS: Mapping[Kind, BenchTestType] = MappingProxyType({**TEST_TYPES, "prototypes": PROTOTYPES})
"""Every kind of report, by its word on the command line."""


WITHIN = ("winding", "stator")


def flow_words(form: NetworkForm) -> dict[tuple[str, str], tuple[str, str]]:
    """Return symbol and words of the heat flow of each link of a network.

    P_ws and P_se are the two flows of the thesis: from winding to stator, and from the machine to
    the sink that T0 stands for. Of two sinks, that one is named.

    Args:
        form: The network.
    """
    sink = f"the {form.sink}" if form.second_sink else "the sink"
    body = "stator" if "stator" in form.nodes else "winding"
    known = {
        WITHIN: ("P_ws", "winding to stator"),
        (body, form.sink): ("P_se", f"{body if body == 'stator' else 'machine'} to {sink}"),
    }
    return {link: known.get(link, unnamed(link)) for link, _ in form.resistance}


def unnamed(link: tuple[str, str]) -> tuple[str, str]:
    """Return what stands for symbol and words of a flow that has no symbol of its own."""
    return " to ".join(link), "heat flow"


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
