"""The test types of the bench: what each is called, needs and shows, and words of heat flows."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from heatrun.model.network_form import NetworkForm
from heatrun.record.channels import CHANNELS

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
