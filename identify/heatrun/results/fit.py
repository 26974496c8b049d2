"""The result of a calibration: the whole of `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from ..bench.record import Finding
from .comparison import Comparison, NetworkVerdict
from .model import FittedModel
from .tested import DescribedTest
from .values import Count

FIT_FORMAT = "heatrun-fit/1"
"""The number rises with what a reader must know."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedMotor:
    """What the motor file said of the machine.

    Attributes:
        name: The machine.
        phases: Number of phases [1].
        losses: Whether `losses_W` is the measured total or the other losses alone.
        sink: Channel that the stator loses its heat to.
        insulation_class: IEC 60085 class letter, or null.
        phase_resistance_ohm: At the reference temperature [ohm], or null.
        reference_temperature_degC: Temperature that the resistance holds for [degC].
        resistance_coefficient_degC: B of R(T) = R (B + T)/(B + Tref) [degC].
        rated_speed_rpm: Speed that effects are scaled with [rpm], or null.
        path: The motor file as the user gave it; empty if made in memory.
        sha256: Its digest; empty likewise.
    """

    name: str
    phases: Count
    losses: Literal["balance", "map"]
    sink: Literal["ambient", "coolant"]
    insulation_class: str | None
    phase_resistance_ohm: float | None
    reference_temperature_degC: float
    resistance_coefficient_degC: float
    rated_speed_rpm: float | None = None
    path: str
    sha256: str


@dataclass(frozen=True, slots=True)
class UseVerdict:
    """Whether the parameters can be used: the one verdict, which every page prints.

    Attributes:
        use: In a word.
        sentence: What it means here.
        reasons: What decides it first, then what else it rests on, in sentences.
    """

    use: Literal["usable", "restricted", "not usable"]
    sentence: str
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """The result of a calibration, or of the final model of a discovery.

    Attributes:
        format: Of this file.
        heatrun_version: That wrote it.
        command: As it was given.
        seed: Random seed.
        motor: The machine.
        tests: Calibration first.
        findings: About records, fits and sampling.
        verdict: Which network the data favour.
        models: The fitted networks by name, the one with fewer nodes first.
        comparison: Of two networks; null if there are not two.
        effects: Ids of the effects that the tests asked for; unset in runs of earlier versions.
        use: Whether the parameters can be used; unset in runs of earlier versions.
    """

    format: Literal["heatrun-fit/1"]
    heatrun_version: str
    command: str
    seed: int
    motor: FittedMotor
    tests: Annotated[tuple[DescribedTest, ...], Meta(min_length=1)]
    findings: tuple[Finding, ...]
    verdict: NetworkVerdict
    models: Annotated[dict[str, FittedModel], Meta(min_length=1)]
    comparison: Comparison | None
    effects: tuple[str, ...] | UnsetType = UNSET
    use: UseVerdict | UnsetType = UNSET
