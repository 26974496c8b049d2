"""The types of `discovery.json`: effects and their fate, errors before and after, and the whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from .model import Localisation, Missing
from .values import Interval, NonNegative, Probability, Role, known

Status = Literal["accepted", "tied", "rejected", "screened", "not identifiable", "not available"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutErrors:
    """Errors on one held-out test.

    Attributes:
        rmse_without_K: Root mean square error without the effect [K].
        rmse_with_K: And with it [K].
    """

    rmse_without_K: float
    rmse_with_K: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateFate:
    """An effect of the library and what became of it; what was not looked at is unset.

    Attributes:
        id: Its name in the catalogue.
        family: What kind of effect it is.
        test: Test of an event; null for all other effects.
        status: What became of it.
        reason: Why; empty if it was accepted.
        visibility: What a refit would leave of it at its typical size [standard deviations].
        visible_K: The same [K].
        screening_log_bayes: Log Bayes factor of the screening [nat].
        separating_test: Test that would separate it from others, in words.
        delta_log_evidence: Of the refit, over the model without it [nat]; null if it failed.
        rmse_K: Of the calibration tests with it [K]; null likewise.
        left_out_K: Root mean square error on parts left out [K]; null likewise.
        parameters: Its parameters [their units].
        held_out: Errors on each held-out test.
    """

    id: str
    family: str | UnsetType = UNSET
    test: str | UnsetType | None = UNSET
    status: Status
    reason: str
    visibility: NonNegative | UnsetType = UNSET
    visible_K: NonNegative | UnsetType = UNSET
    screening_log_bayes: float | UnsetType = UNSET
    separating_test: str | UnsetType = UNSET
    delta_log_evidence: float | UnsetType | None = UNSET
    rmse_K: NonNegative | UnsetType | None = UNSET
    left_out_K: NonNegative | UnsetType | None = UNSET
    parameters: dict[str, float | None] | UnsetType = UNSET
    held_out: tuple[HeldOutErrors, ...] | UnsetType = UNSET

    @property
    def log_evidence(self) -> float | None:
        """Of the refit, or of the screening where there was none [nat]; None if of neither."""
        is_refitted = self.delta_log_evidence is not UNSET
        return known(self.delta_log_evidence if is_refitted else self.screening_log_bayes)


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParameter:
    """A parameter of an accepted effect.

    Attributes:
        value: Of the machine that is stated, in the middle of the posterior [unit].
        unit: Its unit.
        interval_95: 95 % interval [unit].
    """

    value: float
    unit: str
    interval_95: Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectEvidence:
    """What speaks for an accepted effect.

    Attributes:
        delta_log_evidence: Over the final model without it [nat].
        familywise_p: Probability that a clean record reaches its score [1].
    """

    delta_log_evidence: float
    familywise_p: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """Errors on parts of the tests that were left out of the fit.

    Attributes:
        rmse_before_K: Root mean square error without the effect [K].
        rmse_after_K: And with it [K].
    """

    rmse_before_K: NonNegative
    rmse_after_K: NonNegative


@dataclass(frozen=True, slots=True, kw_only=True)
class RivalEffect:
    """Another effect in the place of an accepted one.

    Attributes:
        id: Its name in the catalogue.
        delta_log_evidence: Over the accepted effect [nat].
        share_of_gap: Share of the gap that it closes, the accepted one closing all [1].
        parameters: Its parameters [their units].
        reason: Why it is rejected, or that it is not distinguishable.
        probability: Among the effects that the model is averaged over [1]; unset for others.
    """

    id: str
    delta_log_evidence: float | None
    share_of_gap: float | None
    parameters: dict[str, float | None]
    reason: str
    probability: Probability | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundEffect:
    """An effect that was accepted.

    Attributes:
        id: Its name in the catalogue.
        family: What kind of effect it is.
        law: Its law in words.
        test: Test of an event; null for all other effects.
        probability: Among itself, its rivals and nothing; where the model is averaged over it and
            its equivalents, among these [1].
        equivalents: Effects that these tests cannot separate from it.
        parameters: By name.
        evidence: What speaks for it.
        left_out: Errors on parts left out.
        rivals: Effects in its place, the best first.
    """

    id: str
    family: str
    law: str
    test: str | None
    probability: Probability
    equivalents: tuple[str, ...]
    parameters: Annotated[dict[str, EffectParameter], Meta(min_length=1)]
    evidence: EffectEvidence
    left_out: LeftOut
    rivals: tuple[RivalEffect, ...]

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
    """An effect that the evidence asks for, too small or too uncertain to be in the model.

    Attributes:
        id: Its name in the catalogue.
        equivalents: Effects that explain the same as well.
        closes_K: What it closes of the gap [K].
        delta_log_evidence: Over the final model [nat].
    """

    id: str
    equivalents: tuple[str, ...]
    closes_K: NonNegative
    delta_log_evidence: float


Trace = Annotated[TraceOfEffect, Meta(extra_json_schema={"unevaluatedProperties": False})]
"""In a list of traces, which has no other fields within this version of the schema."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """Errors over the calibration tests, with the base network and with the final model.

    Attributes:
        noise_floor_K: What noise alone would leave [K].
        rmse_before_K: Root mean square error before [K].
        max_before_K: Maximum absolute error before [K].
        coverage_95_before: Share of the readings inside the 95 % band before [1].
        rmse_after_K: Root mean square error after [K].
        max_after_K: Maximum absolute error after [K].
        coverage_95_after: Share of the readings inside the 95 % band after [1].
    """

    noise_floor_K: NonNegative
    rmse_before_K: NonNegative
    max_before_K: NonNegative
    coverage_95_before: Probability
    rmse_after_K: NonNegative
    max_after_K: NonNegative
    coverage_95_after: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutGap:
    """Errors over the held-out tests, and whether these decided about an effect.

    Attributes:
        noise_floor_K: As `Gap`.
        rmse_before_K: As `Gap`.
        max_before_K: As `Gap`.
        coverage_95_before: As `Gap`.
        rmse_after_K: As `Gap`.
        max_after_K: As `Gap`.
        coverage_95_after: As `Gap`.
        took_part_in_selection: Whether an effect was judged by its error on held-out tests: never.
        sentence: What this means.
    """

    noise_floor_K: NonNegative
    rmse_before_K: NonNegative
    max_before_K: NonNegative
    coverage_95_before: Probability
    rmse_after_K: NonNegative
    max_after_K: NonNegative
    coverage_95_after: Probability
    took_part_in_selection: bool
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsOnTest:
    """Errors on one test.

    Attributes:
        rmse_K: Root mean square error [K].
        max_K: Maximum absolute error [K].
        end_K: Mean error over the last blocks, measured minus predicted [K].
        coverage_95: Share of the readings inside the 95 % band [1].
    """

    rmse_K: NonNegative
    max_K: NonNegative
    end_K: float
    coverage_95: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorsBeforeAfter:
    """A test before and after the discovery.

    Attributes:
        name: The test.
        role: Whether it was fitted or only predicted.
        before: With the base network.
        after: With the final model.
    """

    name: str
    role: Role
    before: ErrorsOnTest
    after: ErrorsOnTest


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueWithInterval:
    """A value with its interval.

    Attributes:
        value: Of the machine that is stated, in the middle of the posterior [unit].
        interval_95: 95 % interval [unit].
    """

    value: float
    interval_95: Interval


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterBeforeAfter:
    """A parameter of the network before and after the discovery.

    Attributes:
        before: In the base network.
        after: In the final model.
        unit: Its unit.
        wrong_by: Value before over value after, minus 1 [1]; null if the latter is 0.
    """

    before: ValueWithInterval
    after: ValueWithInterval
    unit: str
    wrong_by: float | None


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
        traces: Effects that the evidence asks for, too small or too uncertain to be in the model;
            empty unless the verdict is adequate.
        where: Significant spans of what the base network misses.
        where_left: Significant spans of what the final model misses.
        localisation: Where something is missing.
        candidates: Every effect of the library and what became of it.
        adequacy: What is left, against noise.
        calibration: Errors over the calibration tests; null where none could be predicted.
        holdout: Errors over the held-out tests; null if there are none, or none could be predicted.
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
    calibration: Gap | None
    holdout: HeldOutGap | None
    tests: tuple[ErrorsBeforeAfter, ...]
    parameters: Annotated[dict[str, ParameterBeforeAfter], Meta(min_length=1)]
    noise: NoiseLevels
    posterior: PosteriorWords
    next_test: ProposedTest | None
    seconds: dict[str, float | None]
