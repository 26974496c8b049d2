"""The types of `fit.json`: figures, parameters, tests, misfit, comparison, and the whole."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType

from ..io.quantities import effects_in_words, quantity, rounded
from ..record.record import ColumnReading, Finding
from .values import BudgetRow, Count, Interval, NonNegative, Probability, Role, known, number

LOADED, AT_REST = "_loaded", "_at_rest"
"""What the name of a resistance ends with at the load of the tests, and at standstill."""

NEEDED = ("value", "unit", "sd", "interval_95", "condition")


@dataclass(frozen=True, slots=True, kw_only=True)
class DerivedFigure:
    """A figure with its interval and the condition it holds under; or only why it is refused.

    Attributes:
        value: Median [unit]; null where it is not finite.
        unit: Its unit.
        sd: Standard deviation [unit]; null where too many draws are not finite.
        interval_95: 95 % interval [unit]; null for a limit that is not finite.
        condition: What it holds under.
        refused: Why there is no figure; all other fields are unset then.
        budget: Where its uncertainty comes from, of a resistance at stated conditions; unset for
            other figures and in files of earlier versions.
    """

    value: float | UnsetType | None = UNSET
    unit: str | UnsetType = UNSET
    sd: NonNegative | UnsetType | None = UNSET
    interval_95: tuple[float | None, float | None] | UnsetType = UNSET
    condition: str | UnsetType = UNSET
    refused: str | UnsetType = UNSET
    budget: tuple[BudgetRow, ...] | UnsetType = UNSET

    def __post_init__(self) -> None:
        is_there = [getattr(self, name) is not UNSET for name in NEEDED]
        if not (all(is_there) if self.refused is UNSET else not any(is_there)):
            raise ValueError(f"expected {', '.join(NEEDED)}, or `refused` alone")

    @property
    def median(self) -> float:
        """The value [unit]; NaN where it is refused or not finite."""
        return number(known(self.value))

    @property
    def ends(self) -> tuple[float, float]:
        """Both ends of the 95 % interval; NaN where it is refused or not finite."""
        low, high = known(self.interval_95) or (None, None)
        return number(low), number(high)


Derived = Annotated[
    DerivedFigure,
    Meta(extra_json_schema={"oneOf": [{"required": [*NEEDED]}, {"required": ["refused"]}]}),
]


Identifiability = Literal["identified", "weak", "not identifiable", "fixed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter:
    """What the tests say of a parameter.

    Attributes:
        value: Of the machine that is stated, in the middle of the posterior [unit].
        unit: Its unit.
        sd: Standard uncertainty [unit].
        sd_type_a: What remains of it with exact instruments [unit].
        sd_type_b: What the stated uncertainties of the instruments add [unit].
        interval_95: 95 % interval [unit].
        relative_sd: Standard uncertainty over the value [1]; null where the value is 0.
        prior_95: 95 % interval of the prior [unit].
        prior_basis: Where the prior comes from.
        meaning: What the parameter is.
        fixed: Whether it was held at its value.
        identifiability: How well the tests determine it; unset for nuisance parameters.
        why: What this rests on; unset likewise.
        budget: Where its uncertainty comes from; unset likewise, for a fixed parameter and in files
            of earlier versions.
    """

    value: float
    unit: str
    sd: NonNegative
    sd_type_a: NonNegative | None
    sd_type_b: NonNegative | None
    interval_95: Interval
    relative_sd: NonNegative | None
    prior_95: Interval
    prior_basis: str
    meaning: str
    fixed: bool
    identifiability: Identifiability | UnsetType = UNSET
    why: str | UnsetType = UNSET
    budget: tuple[BudgetRow, ...] | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualRow:
    """Error figures of one prediction, over the block means that were measured.

    Attributes:
        test: Name of the test.
        role: Whether it was fitted or only predicted.
        rmse_K: Root mean square error [K].
        mae_K: Mean absolute error [K].
        max_K: Maximum absolute error [K].
        end_K: Mean error over the last blocks, measured minus predicted [K].
        whiteness_p: Probability of such residuals if they were white [1], by Ljung and Box.
        coverage_95: Share of the readings inside the 95 % band [1].
        log_score: Mean log predictive density of a block [nat].
        log_score_se: Its standard error, which allows for neighbouring blocks that err alike
            [nat]; null for less than ten blocks, unset in files of earlier versions.
    """

    test: str
    role: Role
    rmse_K: NonNegative
    mae_K: NonNegative
    max_K: NonNegative
    end_K: float
    whiteness_p: Probability | None
    coverage_95: Probability
    log_score: float | None
    log_score_se: NonNegative | UnsetType | None = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyRow:
    """Error figures of one measured body beside the winding in one test.

    Attributes:
        test: Name of the test.
        role: Whether the test was fitted or only predicted.
        body: Channel of the body.
        node: The node that it is compared with.
        fitted: Whether the readings of this body took part in the fit, with the errors of their
            sensor; if not, they are held against the node's temperature.
        rmse_K: Root mean square error [K].
        mean_K: Mean error, measured minus predicted [K].
        max_K: Maximum absolute error [K].
        coverage_95: Share of the readings inside the 95 % band [1].
    """

    test: str
    role: Role
    body: str
    node: str
    fitted: bool
    rmse_K: NonNegative
    mean_K: float
    max_K: NonNegative
    coverage_95: Probability


@dataclass(frozen=True, slots=True, kw_only=True)
class WindingAtEnd:
    """Whether the winding had settled under the last load that was held.

    Attributes:
        is_reached: Whether thermal equilibrium was reached; null where the readings leave it open.
        gradient_K_per_h: Of its rise over the sink in the last interval [K/h].
        gradient_se_K_per_h: Its standard error [K/h].
        from_s: Begin of the stretch [s].
        to_s: Its end [s].
        continued_K: Steady rise of the readings alone, by one exponential [K]; null where it was
            reached, or the readings show no end.
        continued_95_K: Its 95 % interval [K]; null likewise.
        criterion: Standard whose criterion of equilibrium it is; unset in earlier versions.
        network_K: Steady rise of the network under the load of the last third of the stretch [K];
            null where it was reached, or the network has none.
        network_95_K: Its 95 % interval [K]; null likewise.
    """

    is_reached: bool | None
    gradient_K_per_h: float
    gradient_se_K_per_h: NonNegative
    from_s: float
    to_s: float
    continued_K: float | None = None
    continued_95_K: Interval | None = None
    criterion: str | UnsetType = UNSET
    network_K: float | None = None
    network_95_K: Interval | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedTest:
    """What is said of a test.

    Attributes:
        name: Its name in the run.
        role: Whether it was fitted or only predicted.
        path: Its first file as the user gave it; empty for a record that was made in memory.
        sha256: Digest of that file; empty likewise.
        reader: Which reader read it.
        stretch: The part of the files that was used, as it is written behind a file; unset
            for all.
        notes: What was converted, derived and reduced, in sentences.
        mapping: How each channel came about.
        duration_s: Its length [s].
        num_samples: Samples of the record.
        sample_s: Interval of the samples [s].
        step_s: Step of the simulation [s].
        block_s: Length of a block [s].
        rounding_K: Resolution of the winding's readings [K]; 0 if none is seen.
        start_degC: Mean of the winding's first readings [degC].
        current_A: Smallest and largest rms current [A]; null if not recorded.
        losses_W: Smallest and largest losses [W]; null if not recorded.
        speed_rpm: Smallest and largest speed [rpm]; null if not recorded.
        winding_degC: Lowest and highest winding temperature [degC]; null if not recorded.
        sink_degC: Lowest and highest temperature of the sink [degC]; null if not recorded.
        reduction_error_K: Error of reducing the record to blocks [K].
        start: Day on which it began by the clock or the header of the record, ISO 8601; unset where
            that has no date.
        equilibrium: Of the winding; unset where no load was held for half an hour.
    """

    name: str
    role: Role
    path: str
    sha256: str
    reader: str = ""
    stretch: str | UnsetType = UNSET
    notes: tuple[str, ...] = ()
    mapping: tuple[ColumnReading, ...] = ()
    duration_s: NonNegative
    num_samples: Count
    sample_s: float | None
    step_s: float | None
    block_s: float | None
    rounding_K: float | None = None
    start_degC: float | None = None
    current_A: Interval | None
    losses_W: Interval | None
    speed_rpm: Interval | None
    winding_degC: Interval | None
    sink_degC: Interval | None
    reduction_error_K: float | None = None
    start: str | UnsetType = UNSET
    equilibrium: WindingAtEnd | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingSpan:
    """A stretch of time in which something is missing.

    Attributes:
        test: Name of the test.
        from_s: Its begin [s].
        to_s: Its end [s].
        node: Node, or `"sensor"`.
        missing_W: Mean missing heat [W]; unset for the sensor.
        missing_K: Mean error of the reading [K]; unset for a node.
        interval_95: 95 % interval of the one that is set [W or K].
    """

    test: str
    from_s: float
    to_s: float
    node: str
    missing_W: float | UnsetType = UNSET
    missing_K: float | UnsetType = UNSET
    interval_95: Interval

    def __post_init__(self) -> None:
        if (self.missing_W is UNSET) == (self.missing_K is UNSET):
            raise ValueError("expected one of missing_W and missing_K")

    @property
    def missing(self) -> tuple[float, Literal["W", "K"]]:
        """What is missing, and its unit."""
        if self.missing_K is not UNSET:
            return self.missing_K, "K"
        assert self.missing_W is not UNSET
        return self.missing_W, "W"


Missing = Annotated[
    MissingSpan,
    Meta(extra_json_schema={"oneOf": [{"required": ["missing_W"]}, {"required": ["missing_K"]}]}),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingCourse:
    """What is missing at one node over one test.

    Attributes:
        test: Index of the calibration test, from 0.
        node: Node, or `"sensor"`.
        unit: W, or K for the sensor.
        time_s: Times of the knots [s].
        mean: What is missing at each knot [unit].
        sd: Its standard deviation [unit].
    """

    test: Count
    node: str
    unit: str
    time_s: tuple[float, ...]
    mean: tuple[float, ...]
    sd: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalisedMisfit:
    """Where a model lacks heat or reads wrongly.

    Attributes:
        nodes: Nodes that the evidence puts it at; empty if nothing is missing.
        log_evidence: Of each set of nodes, relative to none [nat].
        dependence: Correlation of what is missing with what drives it, by node and driver [1].
        courses: By test and node.
    """

    nodes: tuple[str, ...]
    log_evidence: dict[str, float | None]
    dependence: dict[str, dict[str, float | None]]
    courses: tuple[MissingCourse, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Localisation:
    """Where something is missing, before and after.

    Attributes:
        before: With the base network.
        after: With the final model.
    """

    before: LocalisedMisfit
    after: LocalisedMisfit


TOLD = 0.1
"""Probability from which on an effect that may be missing is told [1], that which each has before
the tests have spoken."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectInModel:
    """An effect that a model has.

    Attributes:
        id: Its name in the catalogue.
        law: Its law in words.
        parameters: Names of its parameters among those of the model.
        is_allowed_for: True where the tests ask for it, though not beyond doubt; else unset.
    """

    id: str
    law: str
    parameters: tuple[str, ...]
    is_allowed_for: bool | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class MaybeMissing:
    """An effect that the network may miss; the posterior is averaged over these.

    Attributes:
        id: Its name in the catalogue.
        test: The test that it happens in; null if it acts in all.
        probability: That it is missing [1].
        with_effect: Parameters of network and effect by name at the amplitude that counts as 1.
        without: Parameters of the network alone that it is told from.
    """

    id: str
    test: str | None = None
    probability: Probability
    with_effect: dict[str, float]
    without: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation of the free parameters over the draws.

    Attributes:
        names: The parameters.
        matrix: Their correlation [1]; null where a parameter does not vary.
    """

    names: tuple[str, ...]
    matrix: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggerNoise:
    """The noise of one of several loggers.

    Attributes:
        sample_s: Sampling period [s].
        resolution_K: Resolution of the readings [K]; 0 if none is seen.
        sensor: Column of the file that holds the readings; empty where it is not known.
        scale: Its noise over that of the first one [1].
        tests: The fitted tests that were recorded with it.
    """

    sample_s: NonNegative
    resolution_K: NonNegative
    sensor: str
    scale: NonNegative
    tests: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedNoise:
    """The noise of the residuals.

    Attributes:
        sd_K: Standard deviation of its slow part [K].
        time_s: Correlation time of the slow part [s].
        white_K: Standard deviation of the white part in a 20 s mean [K].
        unmodelled_heat: Standard deviation of the heat that the network misses over the mean loss
            [1].
        kind: Correlated; earlier versions could count residuals as white.
        loggers: Noise of each logger, where the tests were recorded with several; the figures above
            are those of the first.
        temper: 1; earlier versions could divide the evidence of the residuals by more.
        prior: 95 % intervals of the priors by parameter of the noise.
    """

    sd_K: NonNegative
    time_s: NonNegative
    white_K: NonNegative
    unmodelled_heat: NonNegative | UnsetType = UNSET
    loggers: tuple[LoggerNoise, ...] | UnsetType = UNSET
    kind: Literal["correlated", "white"] = "correlated"
    temper: NonNegative = 1.0
    prior: dict[str, Interval]


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorQuality:
    """How the posterior was drawn and whether it can be trusted.

    Attributes:
        method: How it was drawn.
        draws: Number of draws.
        ess_min: Smallest effective sample size.
        autocorrelation_max: Longest autocorrelation time [steps]; null for importance sampling.
        rhat_max: Largest R-hat [1]; null likewise.
        pareto_k: Shape of the Pareto fit to the largest importance weights [1].
        verdict: The judgement in words.
        is_sound: Whether the draws can be trusted.
        ess_tail_min: Smallest effective sample size of the share of draws in a tail of 5 %; unset
            for importance sampling.
        agreement_p: Probability of differences between the ensembles and their halves as large as
            they are, in means and tails, had all been drawn from one law [1]; unset likewise.
    """

    method: str
    draws: Count
    ess_min: float | None
    autocorrelation_max: float | None
    rhat_max: float | None
    pareto_k: float | None
    verdict: str
    is_sound: bool
    ess_tail_min: float | UnsetType = UNSET
    agreement_p: float | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Figures that networks are compared by.

    Attributes:
        log_evidence: Laplace approximation of the marginal likelihood [nat].
        aic: Akaike's information criterion.
        bic: Bayesian information criterion.
        num_parameters: Free parameters, with those of the noise.
        num_blocks: Block means that were fitted.
    """

    log_evidence: float | None
    aic: float | None = None
    bic: float | None = None
    num_parameters: Count
    num_blocks: Count


@dataclass(frozen=True, slots=True, kw_only=True)
class Replica:
    """The plain network that behaves most like a model with effects over its fitted tests.

    It is no result of its own: its numbers hold for such loads alone, and have no interval.

    Attributes:
        parameters: By name [J/K, K/W].
        rmse_K: Its error on each test [K].
        from_model_K: Root mean square of its distance from the model on the fitted tests [K].
    """

    parameters: dict[str, float]
    rmse_K: dict[str, float]
    from_model_K: float

    def numbers(self) -> str:
        """Return the parameters as they are printed."""
        return ", ".join(
            f"{name} = {quantity(rounded(value, 4), 'J/K' if name.startswith('C') else 'K/W')}"
            for name, value in self.parameters.items()
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TestedLoad:
    """The loaded part of the fitted tests, which figures are stated at, and how far they went.

    Attributes:
        current_A: Rms current of the loaded part [A].
        losses_W: Mean of its loss channel [W].
        winding_degC: Mean of its readings [degC].
        sink_degC: Mean temperature of the sink over all tests [degC].
        second_sink_degC: That of a second sink [degC]; null without.
        speed_rpm: Mean speed of the loaded part [rpm]; null where a test does not tell it.
        coolant_degC: Likewise that of the coolant [degC].
        fan: Likewise fan or flow over its rated value [1].
        rated_speed_rpm: Speed that effects are scaled with [rpm].
        rated_current_A: Current that effects are scaled with [A].
        largest_current_A: Largest rms current of a block [A].
        highest_winding_degC: Highest reading of a block [degC].
    """

    __test__ = False  # no class of tests

    current_A: NonNegative
    losses_W: float
    winding_degC: float
    sink_degC: float
    second_sink_degC: float | None = None
    speed_rpm: float | None = None
    coolant_degC: float | None = None
    fan: float | None = None
    rated_speed_rpm: float
    rated_current_A: float
    largest_current_A: NonNegative
    highest_winding_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedModel:
    """A network as it was fitted.

    Attributes:
        title: Its name in words.
        nodes: Its nodes.
        sinks: Its two sinks, the one that rises count from first; unset where it has one.
        effects: Effects that it has.
        result: How the fit ended.
        message: The same as a sentence.
        stats: Figures of the search by name.
        num_modes: Optima that share the posterior.
        parameters: Network, resistance and effects by name.
        nuisances: Instruments and starts by name.
        correlation: Of the free parameters.
        noise: Of the residuals.
        residuals: Errors by test.
        bodies: Errors of measured bodies beside the winding.
        posterior: How it was drawn.
        derived: Figures that follow from the parameters, by name with unit.
        evidence: What the network is compared by, without the effects that it may miss.
        maybe_missing: Effects that it may miss, the most probable first; the draws are averaged
            over them.
        replica: The plain network nearest to it; unset where it has no effects.
        load: What `derived` is stated at; unset in runs of earlier versions.
    """

    title: str = ""
    nodes: tuple[str, ...] = ()
    sinks: tuple[str, ...] | UnsetType = UNSET
    effects: tuple[EffectInModel, ...] = ()
    result: Literal["converged", "not_converged", "no_start"]
    message: str
    stats: dict[str, int | float | None]
    num_modes: Count
    parameters: dict[str, FittedParameter]
    nuisances: dict[str, FittedParameter]
    correlation: Correlation
    noise: FittedNoise
    residuals: tuple[ResidualRow, ...]
    bodies: tuple[BodyRow, ...] | UnsetType = UNSET
    posterior: PosteriorQuality
    derived: dict[str, Derived]
    evidence: Evidence
    maybe_missing: tuple[MaybeMissing, ...] | UnsetType = UNSET
    replica: Replica | UnsetType = UNSET
    load: TestedLoad | UnsetType = UNSET

    def allowing_for(self, ids: Collection[str]) -> FittedModel:
        """Return it with some of its effects as those that are not beyond doubt."""
        effects = (replace(e, is_allowed_for=True) if e.id in ids else e for e in self.effects)
        return replace(self, effects=tuple(effects))

    def effects_in_words(self) -> str:
        """Return "with" the effects in it, the named ones first; empty without any."""
        allowed = [effect.id for effect in self.effects if effect.is_allowed_for is True]
        words = effects_in_words((e.id for e in self.effects if e.id not in allowed), allowed)
        return f"with {words}" if words else ""

    def about_missing(self) -> str:
        """Return a sentence on the effects that the draws are averaged over, empty without any."""
        rows = known(self.maybe_missing) or ()
        told = [row for row in rows if row.probability >= TOLD]
        if not told:
            return ""
        parts = ", ".join(
            f"{row.id}{'' if row.test is None else f' in {row.test}'} "
            f"{100.0 * row.probability:.0f} %"
            for row in told
        )
        return (
            f"Averaged over small effects that the {self.title} may miss: {parts}. A resistance "
            "that such an effect scales stands for its mean over the tests."
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkVerdict:
    """Which of two networks the data favour.

    Attributes:
        order: Name of the network, or `"undecided"`.
        sentence: The verdict in words.
        log_bayes_factor: Of the network with more nodes to the other one [nat]; null if there are
            not two.
        log_score_difference: Mean log score per block of the network with more nodes less that of
            the other one, over the held-out tests [nat]; unset where there is none.
        log_score_difference_se: Its standard error, which allows for neighbouring blocks that err
            alike [nat]; unset likewise.
    """

    order: str
    sentence: str
    log_bayes_factor: float | None
    log_score_difference: float | UnsetType = UNSET
    log_score_difference_se: NonNegative | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """How long two networks stay within an error.

    Attributes:
        test: Name of the test.
        limit_K: The error [K].
        until_s: Time at which the network with fewer nodes leaves it [s]; null if it never does.
        second_until_s: The same for the other network [s].
    """

    test: str
    limit_K: NonNegative
    until_s: float | None
    second_until_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The measured peak of a test and what two networks predict there.

    Attributes:
        test: Name of the test.
        time_s: When [s].
        measured_degC: The peak [degC].
        first_degC: What the network with fewer nodes predicts [degC].
        second_degC: What the other one predicts [degC].
    """

    test: str
    time_s: float
    measured_degC: float
    first_degC: float
    second_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two networks over the same tests.

    Attributes:
        words: The comparison in sentences.
        thresholds: By test and error.
        peak: By test.
    """

    words: tuple[str, ...]
    thresholds: tuple[Threshold, ...]
    peak: tuple[Peak, ...]


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
        rated_current_A: Rms current that they are scaled with [A], or null.
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
    rated_current_A: float | None = None
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
