"""The types of `discovery.json`: effects and their fate, errors before and after, and the whole."""

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from .model import Localisation, Missing
from .values import Interval, NonNegative, Probability, Role, known

Status = Literal["accepted", "tied", "rejected", "screened", "not identifiable", "not available"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutErrors:
    """Errors on one held-out test."""

    rmse_without_K: float  # Root mean square error without the effect [K].
    rmse_with_K: float  # And with it [K].


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateFate:
    """An effect of the library and what became of it; what was not looked at is unset."""

    id: str  # Its name in the catalogue.
    family: str | UnsetType = UNSET  # What kind of effect it is.
    test: str | UnsetType | None = UNSET  # Test of an event; null for all other effects.
    status: Status  # What became of it.
    reason: str  # Why; empty if it was accepted.
    # What a refit would leave of it at its typical size [standard deviations].
    visibility: NonNegative | UnsetType = UNSET
    visible_K: NonNegative | UnsetType = UNSET  # The same [K].
    screening_log_bayes: float | UnsetType = UNSET  # Log Bayes factor of the screening [nat].
    separating_test: str | UnsetType = UNSET  # Test that would separate it from others, in words.
    # Of the refit, over the model without it [nat]; null if it failed.
    delta_log_evidence: float | UnsetType | None = UNSET
    # Of the calibration tests with it [K]; null likewise.
    rmse_K: NonNegative | UnsetType | None = UNSET
    # Root mean square error on parts left out [K]; null likewise.
    left_out_K: NonNegative | UnsetType | None = UNSET
    parameters: dict[str, float | None] | UnsetType = UNSET  # Its parameters [their units].
    held_out: tuple[HeldOutErrors, ...] | UnsetType = UNSET  # Errors on each held-out test.

    @property
    def log_evidence(self) -> float | None:
        """Of the refit, or of the screening where there was none [nat]; None if of neither."""
        is_refitted = self.delta_log_evidence is not UNSET
        return known(self.delta_log_evidence if is_refitted else self.screening_log_bayes)


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParameter:
    """A parameter of an accepted effect."""

    value: float  # Of the machine that is stated, in the middle of the posterior [unit].
    unit: str  # Its unit.
    interval_95: Interval  # 95 % interval [unit].


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectEvidence:
    """What speaks for an accepted effect."""

    delta_log_evidence: float  # Over the final model without it [nat].
    familywise_p: Probability  # Probability that a clean record reaches its score [1].


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Errors on parts of the tests that were left out of the fit."""

    rmse_before_K: NonNegative  # Root mean square error without the effect [K].
    rmse_after_K: NonNegative  # And with it [K].


@dataclass(frozen=True, slots=True, kw_only=True)
class RivalEffect:
    """Another effect in the place of an accepted one."""

    id: str  # Its name in the catalogue.
    delta_log_evidence: float | None  # Over the accepted effect [nat].
    share_of_gap: float | None  # Share of the gap that it closes, the accepted one closing all [1].
    parameters: dict[str, float | None]  # Its parameters [their units].
    reason: str  # Why it is rejected, or that it is not distinguishable.
    # Among the effects that the model is averaged over [1]; unset for others.
    probability: Probability | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundEffect:
    """An effect that was accepted."""

    id: str  # Its name in the catalogue.
    family: str  # What kind of effect it is.
    law: str  # Its law in words.
    test: str | None  # Test of an event; null for all other effects.
    # Among itself, its rivals and nothing; where the model is averaged over it and its equivalents,
    # among these [1].
    probability: Probability
    equivalents: tuple[str, ...]  # Effects that these tests cannot separate from it.
    parameters: Annotated[dict[str, EffectParameter], Meta(min_length=1)]  # By name.
    evidence: EffectEvidence  # What speaks for it.
    left_out: LeftOut  # Errors on parts left out.
    rivals: tuple[RivalEffect, ...]  # Effects in its place, the best first.

    def equivalents_in_words(self) -> str:
        """Return the effects that the tests do not separate from it, averaged ones with their
        probability; empty without any.
        """
        share = {r.id: r.probability for r in self.rivals if r.probability is not UNSET}
        return ", ".join(
            f"{name} ({100.0 * share[name]:.0f} %)" if name in share else name
            for name in self.equivalents
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceOfEffect:
    """An effect that the evidence asks for, too small or too uncertain to be in the model."""

    id: str  # Its name in the catalogue.
    equivalents: tuple[str, ...]  # Effects that explain the same as well.
    closes_K: NonNegative  # What it closes of the gap [K].
    delta_log_evidence: float  # Over the final model [nat].


Trace = Annotated[TraceOfEffect, Meta(extra_json_schema={"unevaluatedProperties": False})]
"""In a list of traces, which has no other fields within this version of the schema."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """Errors over the calibration tests, with the base network and with the final model."""

    noise_floor_K: NonNegative  # What noise alone would leave [K].
    rmse_before_K: NonNegative  # Root mean square error before [K].
    max_before_K: NonNegative  # Maximum absolute error before [K].
    coverage_95_before: Probability  # Share of the readings inside the 95 % band before [1].
    rmse_after_K: NonNegative  # Root mean square error after [K].
    max_after_K: NonNegative  # Maximum absolute error after [K].
    coverage_95_after: Probability  # Share of the readings inside the 95 % band after [1].


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutGap(Gap):
    """Errors over the held-out tests, and whether these decided about an effect."""

    # Whether an effect was judged by its error on held-out tests: never.
    took_part_in_selection: bool
    sentence: str  # What this means.


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsOnTest:
    """Errors on one test."""

    rmse_K: NonNegative  # Root mean square error [K].
    max_K: NonNegative  # Maximum absolute error [K].
    end_K: float  # Mean error over the last blocks, measured minus predicted [K].
    coverage_95: Probability  # Share of the readings inside the 95 % band [1].


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsBeforeAfter:
    """A test before and after the discovery."""

    name: str  # The test.
    role: Role  # Whether it was fitted or only predicted.
    before: ErrorsOnTest  # With the base network.
    after: ErrorsOnTest  # With the final model.


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueWithInterval:
    """A value with its interval."""

    value: float  # Of the machine that is stated, in the middle of the posterior [unit].
    interval_95: Interval  # 95 % interval [unit].


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterBeforeAfter:
    """A parameter of the network before and after the discovery."""

    before: ValueWithInterval  # In the base network.
    after: ValueWithInterval  # In the final model.
    unit: str  # Its unit.
    wrong_by: float | None  # Value before over value after, minus 1 [1]; null if the latter is 0.


DISCOVERY_FORMAT = "heatrun-discovery/2"
"""The number rises with what a reader must know."""

VerdictWord = Literal["adequate", "named", "ambiguous", "unexplained", "not_identifiable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorName:
    """The machine."""

    name: str  # As it stands in the motor file.


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftByModel:
    """What a model leaves, against noise."""

    is_adequate: bool  # Whether only noise is left, or nothing that matters.
    low_frequency_excess: float  # Variance of slow residuals over that of noise [1].
    correlation_s: NonNegative  # Correlation time of the residuals [s].
    slow_misfit_K: NonNegative  # Root mean square of what is slow, less what noise would leave [K].
    noise_K: NonNegative  # Standard deviation of the noise of a block mean [K].
    # Root mean square of all residuals of the same fit, slow and fast [K]; unset in files of
    # earlier versions.
    rmse_K: NonNegative | UnsetType = UNSET
    # Of the sensor whose slow misfit is largest, to which the figures in kelvin belong; unset in
    # files of earlier versions.
    channel: str | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class AdequacyBeforeAfter:
    """What is left by two models."""

    before: LeftByModel  # By the base network.
    after: LeftByModel  # By the final model.


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseLevels:
    """The noise with the final model."""

    sd_K: NonNegative  # Standard deviation of its slow part [K].
    time_s: NonNegative  # Correlation time of the slow part [s].
    white_K: NonNegative  # Standard deviation of the white part [K].


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorWords:
    """How far the posteriors can be trusted."""

    before: str  # That of the base network, in words.
    after: str  # That of the final model, in words.
    is_sound: bool  # Whether the draws of the latter can be trusted.


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadStep:
    """A step of a proposed test."""

    minutes: NonNegative  # Its length [min].
    current_A: float  # Phase current, rms [A].
    speed_rpm: float  # Speed [rpm].


@dataclass(frozen=True, slots=True, kw_only=True)
class ProposedTest:
    """The test that would separate what these tests cannot."""

    separates: tuple[str, ...]  # Ids of the effects.
    what: str  # The test in words.
    start: str  # State of the machine at its start.
    profile: tuple[LoadStep, ...]  # Its load steps.
    expected_log_bayes_factor: float  # Between the effects, after it [nat].


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscoveryResult:
    """The result of a discovery."""

    format: Literal["heatrun-discovery/2"]  # Of this file.
    heatrun_version: str  # That wrote it.
    command: str  # As it was given.
    seed: int  # Random seed.
    motor: MotorName  # The machine.
    verdict: VerdictWord  # The verdict in a word.
    sentence: str  # What the verdict means here.
    effects: tuple[FoundEffect, ...]  # Accepted effects in the order of acceptance.
    # Effects that were accepted and are not needed beside those found later.
    dropped: tuple[str, ...]
    # Effects that the evidence asks for, too small or too uncertain to be in the model; empty
    # unless the verdict is adequate.
    traces: tuple[Trace, ...]
    where: tuple[Missing, ...]  # Significant spans of what the base network misses.
    where_left: tuple[Missing, ...]  # Significant spans of what the final model misses.
    localisation: Localisation  # Where something is missing.
    # Every effect of the library and what became of it.
    candidates: Annotated[tuple[CandidateFate, ...], Meta(min_length=1)]
    adequacy: AdequacyBeforeAfter  # What is left, against noise.
    # Errors over the calibration tests; null where none could be predicted.
    calibration: Gap | None
    # Errors over the held-out tests; null if there are none, or none could be predicted.
    holdout: HeldOutGap | None
    tests: tuple[ErrorsBeforeAfter, ...]  # Errors by test.
    # Of the network, by name.
    parameters: Annotated[dict[str, ParameterBeforeAfter], Meta(min_length=1)]
    noise: NoiseLevels  # With the final model.
    posterior: PosteriorWords  # How far the draws can be trusted.
    # The test that would separate what these tests cannot; null if none is needed.
    next_test: ProposedTest | None
    seconds: dict[str, float | None]  # Time that each stage took [s].
