"""What the motor file says of the machine under test, and a certificate of its laboratory.

The certificate's part (who, what, when, with which instruments) stands in `[certificate]` or in a
file of its own (`--meta`). All of it may be left out; what is not given is a blank line on the
certificate.

What stands in the motor file under the name of a field is explained in `heatrun.motor.keys`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from .channels import Columns
    from .stretch import Stretch

PLACES = ("laboratory", "customer", "laboratoryBranch", "customerBranch", "other")
"""Where a test can have been made, by the words of the Digital Calibration Certificate."""

INSTRUMENT_KEYS = ("quantity", "instrument", "class", "calibration", "valid_until")


@dataclass(frozen=True)
class Instrument:
    """A measuring instrument."""

    quantity: str = ""
    instrument: str = ""
    accuracy_class: str = ""
    calibration: str = ""
    valid_until: str = ""


@dataclass(frozen=True)
class Certificate:
    """What `[certificate]` says; what is not given is empty. Days are ISO 8601."""

    number: str = ""
    laboratory: str = ""
    laboratory_address: str = ""
    customer: str = ""
    customer_address: str = ""
    machine_type: str = ""
    manufacturer: str = ""
    serial_number: str = ""
    condition: str = ""
    operator: str = ""
    approved_by: str = ""
    bench: str = ""
    remarks: str = ""
    received: str = ""
    test_from: str = ""
    test_until: str = ""
    issue_date: str = ""
    performed_at: str = ""
    country: str = ""
    language: str = ""
    instruments: tuple[Instrument, ...] = ()

    def beneath(self, other: Certificate) -> Certificate:
        """Return this one with whatever another one says in the place of its own."""
        names = [field.name for field in fields(self)]
        given = {name: value for name in names if (value := getattr(other, name))}
        return replace(self, **given)

    def lost_to(self, other: Certificate) -> dict[str, tuple[Any, Any]]:
        """Return what this one says and another one does not: by key, here and there."""
        names = [field.name for field in fields(self) if field.name != "language"]
        pairs = {name: (getattr(self, name), getattr(other, name)) for name in names}
        return {name: pair for name, pair in pairs.items() if pair[0] and pair[0] != pair[1]}

    def as_section(self) -> dict[str, Any]:
        """Return what the section would hold; it reads back to the same."""
        content = {key: value for key, value in asdict(self).items() if value}
        if self.instruments:
            said = (
                zip(INSTRUMENT_KEYS, asdict(one).values(), strict=True) for one in self.instruments
            )
            content["instruments"] = [{key: value for key, value in one if value} for one in said]
        return content


@dataclass(frozen=True)
class ParameterOverride:
    """What `[parameters.NAME]` in the motor file says; unset fields keep the default."""

    fixed: float | None = None
    value: float | None = None
    relative_sd: float | None = None
    sd: float | None = None
    per_test: bool | None = None


COEFFICIENTS_degC = {"copper": 234.5, "aluminium": 225.0}
"""B of R(T) = R (B + T)/(B + Tref): copper by IEEE 112 and NEMA MG 1 (IEC 60034-1 uses 235 for
copper), aluminium by IEC 60034-1."""

LIMIT_DEGC = {"A": 105.0, "E": 120.0, "B": 130.0, "F": 155.0, "H": 180.0, "N": 200.0, "R": 220.0}
"""Temperature of the insulation classes [degC]; IEC 60085, table 1."""

PERMITTED_RISE_K = {"A": 60.0, "E": 75.0, "B": 80.0, "F": 105.0, "H": 125.0}
"""Rise by resistance that a class permits over air of up to 40 °C [K]: IEC 60034-1:2004, 8.10 and
table 7, windings of AC machines from 600 W to below 5 MW. B, F and H as makers of machines quote
the standard; clause, table and range from memory, and A and E from that of editions before; to be
compared with the edition in force. Smaller, larger and encapsulated machines have other rows."""

WARMEST_AIR_DEGC = 40.0
"""Air up to which the whole rise is permitted [degC]; above, so much less as it is warmer."""


class Criterion(NamedTuple):
    """When a temperature rise counts as steady."""

    change_K: float  # It changes by at most so much [K],
    over_s: float  # over so long [s].
    num_intervals: int  # In so many successive intervals; two may be shorter, the gradient counts.
    source: str  # Where it stands.

    @property
    def K_per_h(self) -> float:
        """The largest gradient [K/h]."""
        return self.change_K / self.over_s * 3600.0


EQUILIBRIA = {
    "IEC 60034-1:2010": Criterion(2.0, 3600.0, 2, "definition of thermal equilibrium"),
    "IEC 60034-1, 1 K in 30 min": Criterion(1.0, 1800.0, 1, "from memory"),
    "IEEE 112": Criterion(1.0, 1800.0, 1, "from memory"),
    "MIL-DTL-17060G": Criterion(0.5, 1800.0, 1, "4.6.16.1: three readings 15 min apart without an "
                                "increase; 0.5 K, half a digit of 1 K, are ours"),
}  # fmt: skip
"""Criteria of thermal equilibrium by standard, the usual one first; those from memory are to be
compared with the edition that binds the test."""

HEAT_LIMITS = (1e-5, 0.05)
"""Smallest and largest share of the mean loss that heat outside the network may have [1]."""


@dataclass(frozen=True)
class Adequacy:
    """How far a network of a few nodes is trusted: the prior of the heat that it misses."""

    unmodelled_heat: float = 0.0015
    heat_time_s: float = 1200.0


@dataclass(frozen=True)
class Scales:
    """What the laws of effects divide by: one figure for all tests of a machine, also for those
    that are predicted. A parameter such as `stray_load_loss.k` holds there.
    """

    speed_rpm: float | None = None
    current_A: float | None = None
    flow_L_per_min: float | None = None


@dataclass(frozen=True)
class ShutDown:
    """What `[shutdown]` says of the readings after switch-off; standard deviations are k = 1."""

    cold_resistance_sd: float = 0.002
    cold_temperature_sd_K: float = 1.0
    coefficient_sd_degC: float = 1.0
    lead_sd: float = 0.2
    reading_sd_K: float | None = None
    sensor_sd_K: float = 1.0
    sensor_lag_s: float = 0.0
    sink_sd_K: float = 1.0
    moment_sd_s: float = 0.5
    run_down_s: float | None = None
    losses_after: float = 0.0
    losses_after_sd: float = 0.0
    current_after: float = 0.0
    rated_output_kW: float | None = None
    utilisation_class: str | None = None


GapLoad = Literal["held", "zero", "unknown"]


@dataclass(frozen=True)
class PartsOfTest:
    """What `[tests.NAME]` says: which parts of a record count."""

    # Stretches that are used, each as a test of its own; none for the whole record.
    use: tuple[Stretch, ...] = ()
    # Windows whose readings are not compared, first and last time [s].
    mask: tuple[tuple[float, float], ...] = ()
    bridge: tuple[tuple[float, float], ...] = ()  # Windows whose loads are interpolated, likewise.
    # The load in gaps of the logger; None where the record is to tell.
    gap_load: GapLoad | None = None
    # Its own `[columns]`, before those of the motor file.
    columns: Columns = field(default_factory=dict)
    # What is added to the clock of the load to give that of the temperatures [s]; None where
    # nothing is known of it.
    load_offset_s: float | None = None


@dataclass(frozen=True)
class Motor:
    """The machine under test and how its bench measures it."""

    name: str  # As it stands on the sheet.
    phases: int = 3
    # `"balance"`: the channel `losses_W` is the measured total Pd, electrical in minus mechanical
    # out. `"map"`: it is the other losses Pol alone, from a map or a model.
    losses: Literal["balance", "map"] = "balance"
    # Which channel is the temperature T0 that the stator loses its heat to.
    sink: Literal["ambient", "coolant"] = "ambient"
    insulation_class: str | None = None
    equilibrium: str = next(iter(EQUILIBRIA))  # Which of `EQUILIBRIA` its tests are judged by.
    rated_speed_rpm: float | None = None
    rated_current_A: float | None = None
    mass_kg: float | None = None
    conductor_mass_kg: float | None = None
    resistance_coefficient_degC: float = 234.5  # B of R(T) = R (B + T)/(B + Tref) [degC].
    # Rs0 at the reference temperature [ohm], or None if not known.
    phase_resistance_ohm: float | None = None
    reference_temperature_degC: float = 25.0  # Temperature that Rs0 holds for [degC].
    # Of the circuit whose resistance tells the winding temperature, with leads, at the reference
    # temperature [ohm], or None.
    measured_resistance_ohm: float | None = None
    lead_resistance_ohm: float = 0.0  # Of the leads in it [ohm].
    gear_ratio: float | None = None
    wheel_radius_m: float | None = None
    # Canonical channel to `"column in the file [unit]"`, or to several of which the first counts
    # whose column a file has.
    columns: Columns = field(default_factory=dict)
    # Value of a channel that holds for a whole test, in the channel's unit, for records that do not
    # have it.
    constants: Mapping[str, float] = field(default_factory=dict)
    # Overrides of prior or value by parameter name.
    parameters: Mapping[str, ParameterOverride] = field(default_factory=dict)
    # Node that a measured body is fitted as, by its channel; `"none"`: it is held against the model
    # and not fitted. Where nothing is said, the network decides.
    sensors: Mapping[str, str] = field(default_factory=dict)
    # Which parts of a test count, by its name.
    tests: Mapping[str, PartsOfTest] = field(default_factory=dict)
    effects: tuple[str, ...] = ()  # Ids of known effects that every model of this machine has.
    # What effects are scaled with, where tests have told it already.
    scales: Scales = field(default_factory=Scales)
    adequacy: Adequacy = field(default_factory=Adequacy)  # How far its networks are trusted.
    # What is known of readings after switch-off.
    shutdown: ShutDown = field(default_factory=ShutDown)
    # What a certificate of its tests says beside the results.
    certificate: Certificate = field(default_factory=Certificate)
    raster_s: float | None = None
    # Decimal sign of the bench's text tables, `"."` or `","`; the other one then separates
    # thousands. None finds it out of each file, and asks where it cannot.
    decimal: Literal[".", ","] | None = None
    sha256: str = ""  # Digest of the motor file, empty if made in memory.
    path: str = ""  # The motor file, empty if made in memory.

    def permitted_rise(self, sink_degC: float) -> tuple[str, float] | None:
        """Return the class whose rise is permitted over air of so many [degC], and that rise by
        resistance [K]; None where no class is given that has one, or the sink is not the air.
        """
        letter = self.shutdown.utilisation_class or self.insulation_class
        if letter not in PERMITTED_RISE_K or self.sink != "ambient":
            return None
        return letter, PERMITTED_RISE_K[letter] - max(0.0, sink_degC - WARMEST_AIR_DEGC)

    def columns_of(self, test: str) -> Columns:
        """Return the `[columns]` of a test by its name: its own before those of the machine."""
        parts = self.tests.get(test)
        return self.columns if parts is None else {**self.columns, **parts.columns}

    def resistance_ratio(self, winding_degC: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
        """Return R(T)/Rs0 = (B + T)/(B + Tref) at winding temperatures [1]."""
        B = self.resistance_coefficient_degC
        return (B + winding_degC) / (B + self.reference_temperature_degC)

    def copper_loss_W(
        self, current_A: Float[np.ndarray, "..."], winding_degC: Float[np.ndarray, "..."]
    ) -> Float[np.ndarray, "..."]:
        """Return the copper loss of all phases [W] by rms current and the winding's temperature.

        Raises:
            ValueError: If the phase resistance is not known.
        """
        if self.phase_resistance_ohm is None:
            raise ValueError("copper_loss_W needs phase_resistance_ohm")
        ohm = self.phase_resistance_ohm * self.resistance_ratio(winding_degC)
        return self.phases * ohm * current_A**2
