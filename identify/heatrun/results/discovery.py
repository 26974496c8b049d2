"""The result of a discovery: the whole of `discovery.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from .candidate import CandidateFate
from .found_effect import FoundEffect, Trace
from .gap import ErrorsBeforeAfter, Gap, HeldOutGap, ParameterBeforeAfter
from .missing import Localisation, Missing
from .values import NonNegative

DISCOVERY_FORMAT = "heatrun-discovery/2"
"""The number rises with what a reader must know."""

VerdictWord = Literal["adequate", "named", "ambiguous", "unexplained", "not_identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorName:
    """The machine.

    Attributes:
        name: As it stands in the motor file.
    """

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftByModel:
    """What a model leaves, against noise.

    Attributes:
        is_adequate: Whether only noise is left, or nothing that matters.
        low_frequency_excess: Variance of slow residuals over that of noise [1].
        correlation_s: Correlation time of the residuals [s].
        slow_misfit_K: Root mean square of what is slow, less what noise would leave [K].
        noise_K: Standard deviation of the noise of a block mean [K].
        rmse_K: Root mean square of all residuals of the same fit, slow and fast [K]; unset in
            files of earlier versions.
        channel: Of the sensor whose slow misfit is largest, to which the figures in kelvin belong;
            unset in files of earlier versions.
    """

    is_adequate: bool
    low_frequency_excess: float
    correlation_s: NonNegative
    slow_misfit_K: NonNegative
    noise_K: NonNegative
    rmse_K: NonNegative | UnsetType = UNSET
    channel: str | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class AdequacyBeforeAfter:
    """What is left by two models.

    Attributes:
        before: By the base network.
        after: By the final model.
    """

    before: LeftByModel
    after: LeftByModel


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevels:
    """The noise with the final model.

    Attributes:
        sd_K: Standard deviation of its slow part [K].
        time_s: Correlation time of the slow part [s].
        white_K: Standard deviation of the white part [K].
    """

    sd_K: NonNegative
    time_s: NonNegative
    white_K: NonNegative


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorWords:
    """How far the posteriors can be trusted.

    Attributes:
        before: That of the base network, in words.
        after: That of the final model, in words.
        is_sound: Whether the draws of the latter can be trusted.
    """

    before: str
    after: str
    is_sound: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadStep:
    """A step of a proposed test.

    Attributes:
        minutes: Its length [min].
        current_A: Phase current, rms [A].
        speed_rpm: Speed [rpm].
    """

    minutes: NonNegative
    current_A: float
    speed_rpm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposedTest:
    """The test that would separate what these tests cannot.

    Attributes:
        separates: Ids of the effects.
        what: The test in words.
        start: State of the machine at its start.
        profile: Its load steps.
        expected_log_bayes_factor: Between the effects, after it [nat].
    """

    separates: tuple[str, ...]
    what: str
    start: str
    profile: tuple[LoadStep, ...]
    expected_log_bayes_factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscoveryResult:
    """The result of a discovery.

    Attributes:
        format: Of this file.
        heatrun_version: That wrote it.
        command: As it was given.
        seed: Random seed.
        motor: The machine.
        verdict: The verdict in a word.
        sentence: What the verdict means here.
        effects: Accepted effects in the order of acceptance.
        dropped: Effects that were accepted and are not needed beside those found later.
        traces: Effects with strong evidence that are too small to matter; empty unless the
            verdict is adequate.
        where: Significant spans of what the base network misses.
        where_left: Significant spans of what the final model misses.
        localisation: Where something is missing.
        candidates: Every effect of the library and what became of it.
        adequacy: What is left, against noise.
        calibration: Errors over the calibration tests.
        holdout: Errors over the held-out tests; null if there are none.
        tests: Errors by test.
        parameters: Of the network, by name.
        noise: With the final model.
        posterior: How far the draws can be trusted.
        next_test: The test that would separate what these tests cannot; null if none is needed.
        seconds: Time that each stage took [s].
    """

    format: Literal["heatrun-discovery/2"]
    heatrun_version: str
    command: str
    seed: int
    motor: MotorName
    verdict: VerdictWord
    sentence: str
    effects: tuple[FoundEffect, ...]
    dropped: tuple[str, ...]
    traces: tuple[Trace, ...]
    where: tuple[Missing, ...]
    where_left: tuple[Missing, ...]
    localisation: Localisation
    candidates: Annotated[tuple[CandidateFate, ...], Meta(min_length=1)]
    adequacy: AdequacyBeforeAfter
    calibration: Gap
    holdout: HeldOutGap | None
    tests: Annotated[tuple[ErrorsBeforeAfter, ...], Meta(min_length=1)]
    parameters: Annotated[dict[str, ParameterBeforeAfter], Meta(min_length=1)]
    noise: NoiseLevels
    posterior: PosteriorWords
    next_test: ProposedTest | None
    seconds: dict[str, float | None]
