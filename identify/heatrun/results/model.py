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


Identifiability = Literal["identified", "weak", "not identifiable", "fixed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DerivedFigure:
    """A figure with its interval and the condition it holds under; or only why it is refused."""

    value: float | UnsetType | None = UNSET  # Median [unit]; null where it is not finite.
    unit: str | UnsetType = UNSET  # Its unit.
    # Standard deviation [unit]; null where too many draws are not finite.
    sd: NonNegative | UnsetType | None = UNSET
    # 95 % interval [unit]; null for a limit that is not finite.
    interval_95: tuple[float | None, float | None] | UnsetType = UNSET
    condition: str | UnsetType = UNSET  # What it holds under.
    refused: str | UnsetType = UNSET  # Why there is no figure; all other fields are unset then.
    # Where its uncertainty comes from, of resistances at stated conditions, time constants, steady
    # rise, continuous currents and ratings; unset for others and in files of earlier versions.
    budget: tuple[BudgetRow, ...] | UnsetType = UNSET
    # How well the tests determine a resistance at stated conditions; unset likewise.
    identifiability: Identifiability | UnsetType = UNSET

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


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter:
    """What the tests say of a parameter."""

    value: float  # Of the machine that is stated, in the middle of the posterior [unit].
    unit: str  # Its unit.
    sd: NonNegative  # Standard uncertainty [unit].
    sd_type_a: NonNegative | None  # What remains of it with exact instruments [unit].
    sd_type_b: NonNegative | None  # What the stated uncertainties of the instruments add [unit].
    interval_95: Interval  # 95 % interval [unit].
    # Standard uncertainty over the value [1]; null where the value is 0.
    relative_sd: NonNegative | None
    prior_95: Interval  # 95 % interval of the prior [unit].
    prior_basis: str  # Where the prior comes from.
    meaning: str  # What the parameter is.
    fixed: bool  # Whether it was held at its value.
    # How well the tests determine it; unset for nuisance parameters.
    identifiability: Identifiability | UnsetType = UNSET
    why: str | UnsetType = UNSET  # What this rests on; unset likewise.
    # Where its uncertainty comes from; unset likewise, for a fixed parameter and in files of
    # earlier versions.
    budget: tuple[BudgetRow, ...] | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualRow:
    """Error figures of one prediction, over the block means that were measured."""

    test: str  # Name of the test.
    role: Role  # Whether it was fitted or only predicted.
    rmse_K: NonNegative  # Root mean square error [K].
    mae_K: NonNegative  # Mean absolute error [K].
    max_K: NonNegative  # Maximum absolute error [K].
    end_K: float  # Mean error over the last blocks, measured minus predicted [K].
    # Probability of such residuals if they were white [1], by Ljung and Box.
    whiteness_p: Probability | None
    coverage_95: Probability  # Share of the readings inside the 95 % band [1].
    log_score: float | None  # Mean log predictive density of a block [nat].
    # Its standard error, which allows for neighbouring blocks that err alike [nat]; null for less
    # than ten blocks, unset in files of earlier versions.
    log_score_se: NonNegative | UnsetType | None = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyRow:
    """Error figures of one measured body beside the winding in one test."""

    test: str  # Name of the test.
    role: Role  # Whether the test was fitted or only predicted.
    body: str  # Channel of the body.
    node: str  # The node that it is compared with.
    # Whether the readings of this body took part in the fit, with the errors of their sensor; if
    # not, they are held against the node's temperature.
    fitted: bool
    rmse_K: NonNegative  # Root mean square error [K].
    mean_K: float  # Mean error, measured minus predicted [K].
    max_K: NonNegative  # Maximum absolute error [K].
    coverage_95: Probability  # Share of the readings inside the 95 % band [1].


@dataclass(frozen=True, slots=True, kw_only=True)
class WindingAtEnd:
    """Whether the winding had settled under the last load that was held."""

    # Whether thermal equilibrium was reached; null where the readings leave it open.
    is_reached: bool | None
    gradient_K_per_h: float  # Of its rise over the sink in the last interval [K/h].
    gradient_se_K_per_h: NonNegative  # Its standard error [K/h].
    from_s: float  # Begin of the stretch [s].
    to_s: float  # Its end [s].
    # Steady rise of the readings alone, by one exponential [K]; null where it was reached, or the
    # readings show no end.
    continued_K: float | None = None
    continued_95_K: Interval | None = None  # Its 95 % interval [K]; null likewise.
    # Standard whose criterion of equilibrium it is; unset in earlier versions.
    criterion: str | UnsetType = UNSET
    # Steady rise of the network under the load of the last third of the stretch [K]; null where it
    # was reached, or the network has none.
    network_K: float | None = None
    network_95_K: Interval | None = None  # Its 95 % interval [K]; null likewise.


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribedTest:
    """What is said of a test."""

    name: str  # Its name in the run.
    role: Role  # Whether it was fitted or only predicted.
    path: str  # Its first file as the user gave it; empty for a record that was made in memory.
    sha256: str  # Digest of that file; empty likewise.
    reader: str = ""  # Which reader read it.
    # The part of the files that was used, as it is written behind a file; unset for all.
    stretch: str | UnsetType = UNSET
    notes: tuple[str, ...] = ()  # What was converted, derived and reduced, in sentences.
    mapping: tuple[ColumnReading, ...] = ()  # How each channel came about.
    duration_s: NonNegative  # Its length [s].
    num_samples: Count  # Samples of the record.
    sample_s: float | None  # Interval of the samples [s].
    step_s: float | None  # Step of the simulation [s].
    block_s: float | None  # Length of a block [s].
    rounding_K: float | None = None  # Resolution of the winding's readings [K]; 0 if none is seen.
    start_degC: float | None = None  # Mean of the winding's first readings [degC].
    current_A: Interval | None  # Smallest and largest rms current [A]; null if not recorded.
    losses_W: Interval | None  # Smallest and largest losses [W]; null if not recorded.
    speed_rpm: Interval | None  # Smallest and largest speed [rpm]; null if not recorded.
    # Lowest and highest winding temperature [degC]; null if not recorded.
    winding_degC: Interval | None
    # Lowest and highest temperature of the sink [degC]; null if not recorded.
    sink_degC: Interval | None
    reduction_error_K: float | None = None  # Error of reducing the record to blocks [K].
    # Day on which it began by the clock or the header of the record, ISO 8601; unset where that has
    # no date.
    start: str | UnsetType = UNSET
    # Of the winding; unset where no load was held for half an hour.
    equilibrium: WindingAtEnd | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingSpan:
    """A stretch of time in which something is missing."""

    test: str  # Name of the test.
    from_s: float  # Its begin [s].
    to_s: float  # Its end [s].
    node: str  # Node, or `"sensor"`.
    missing_W: float | UnsetType = UNSET  # Mean missing heat [W]; unset for the sensor.
    missing_K: float | UnsetType = UNSET  # Mean error of the reading [K]; unset for a node.
    interval_95: Interval  # 95 % interval of the one that is set [W or K].

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
    """What is missing at one node over one test."""

    test: Count  # Index of the calibration test, from 0.
    node: str  # Node, or `"sensor"`.
    unit: str  # W, or K for the sensor.
    time_s: tuple[float, ...]  # Times of the knots [s].
    mean: tuple[float, ...]  # What is missing at each knot [unit].
    sd: tuple[float, ...]  # Its standard deviation [unit].


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalisedMisfit:
    """Where a model lacks heat or reads wrongly."""

    nodes: tuple[str, ...]  # Nodes that the evidence puts it at; empty if nothing is missing.
    log_evidence: dict[str, float | None]  # Of each set of nodes, relative to none [nat].
    # Correlation of what is missing with what drives it, by node and driver [1].
    dependence: dict[str, dict[str, float | None]]
    courses: tuple[MissingCourse, ...]  # By test and node.


@dataclass(frozen=True, slots=True, kw_only=True)
class Localisation:
    """Where something is missing, before and after."""

    before: LocalisedMisfit  # With the base network.
    after: LocalisedMisfit  # With the final model.


TOLD = 0.1
"""Probability from which on an effect that may be missing is told [1], that which each has before
the tests have spoken."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectInModel:
    """An effect that a model has."""

    id: str  # Its name in the catalogue.
    law: str  # Its law in words.
    parameters: tuple[str, ...]  # Names of its parameters among those of the model.
    # True where the tests ask for it, though not beyond doubt; else unset.
    is_allowed_for: bool | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class MaybeMissing:
    """An effect that the network may miss; the posterior is averaged over these."""

    id: str  # Its name in the catalogue.
    test: str | None = None  # The test that it happens in; null if it acts in all.
    probability: Probability  # That it is missing [1].
    # Parameters of network and effect by name at the amplitude that counts as 1.
    with_effect: dict[str, float]
    without: dict[str, float]  # Parameters of the network alone that it is told from.


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation of the free parameters over the draws."""

    names: tuple[str, ...]  # The parameters.
    # Their correlation [1]; null where a parameter does not vary.
    matrix: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggerNoise:
    """The noise of one of several loggers."""

    sample_s: NonNegative  # Sampling period [s].
    resolution_K: NonNegative  # Resolution of the readings [K]; 0 if none is seen.
    sensor: str  # Column of the file that holds the readings; empty where it is not known.
    scale: NonNegative  # Its noise over that of the first one [1].
    tests: tuple[str, ...]  # The fitted tests that were recorded with it.


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedNoise:
    """The noise of the residuals."""

    sd_K: NonNegative  # Standard deviation of its slow part [K].
    time_s: NonNegative  # Correlation time of the slow part [s].
    white_K: NonNegative  # Standard deviation of the white part in a 20 s mean [K].
    # Standard deviation of the heat that the network misses over the mean loss [1].
    unmodelled_heat: NonNegative | UnsetType = UNSET
    # Noise of each logger, where the tests were recorded with several; the figures above are those
    # of the first.
    loggers: tuple[LoggerNoise, ...] | UnsetType = UNSET
    # Correlated; earlier versions could count residuals as white.
    kind: Literal["correlated", "white"] = "correlated"
    # 1; earlier versions could divide the evidence of the residuals by more.
    temper: NonNegative = 1.0
    prior: dict[str, Interval]  # 95 % intervals of the priors by parameter of the noise.


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorQuality:
    """How the posterior was drawn and whether it can be trusted."""

    method: str  # How it was drawn.
    draws: Count  # Number of draws.
    ess_min: float | None  # Smallest effective sample size.
    # Longest autocorrelation time [steps]; null for importance sampling.
    autocorrelation_max: float | None
    rhat_max: float | None  # Largest R-hat [1]; null likewise.
    pareto_k: float | None  # Shape of the Pareto fit to the largest importance weights [1].
    verdict: str  # The judgement in words.
    is_sound: bool  # Whether the draws can be trusted.
    # Smallest effective sample size of the share of draws in a tail of 5 %; unset for importance
    # sampling.
    ess_tail_min: float | UnsetType = UNSET
    # Probability of differences between the ensembles and their halves as large as they are, in
    # means and tails, had all been drawn from one law [1]; unset likewise.
    agreement_p: float | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Figures that networks are compared by."""

    log_evidence: float | None  # Laplace approximation of the marginal likelihood [nat].
    aic: float | None = None  # Akaike's information criterion.
    bic: float | None = None  # Bayesian information criterion.
    num_parameters: Count  # Free parameters, with those of the noise.
    num_blocks: Count  # Block means that were fitted.


@dataclass(frozen=True, slots=True, kw_only=True)
class Replica:
    """The plain network that behaves most like a model with effects over its fitted tests.

    It is no result of its own: its numbers hold for such loads alone, and have no interval.
    """

    parameters: dict[str, float]  # By name [J/K, K/W].
    rmse_K: dict[str, float]  # Its error on each test [K].
    from_model_K: float  # Root mean square of its distance from the model on the fitted tests [K].

    def numbers(self) -> str:
        """Return the parameters as they are printed."""
        return ", ".join(
            f"{name} = {quantity(rounded(value, 4), 'J/K' if name.startswith('C') else 'K/W')}"
            for name, value in self.parameters.items()
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class TestedLoad:
    """The loaded part of the fitted tests, which figures are stated at, and how far they went."""

    __test__ = False  # no class of tests

    current_A: NonNegative  # Rms current of the loaded part [A].
    losses_W: float  # Mean of its loss channel [W].
    winding_degC: float  # Mean of its readings [degC].
    sink_degC: float  # Mean temperature of the sink over all tests [degC].
    second_sink_degC: float | None = None  # That of a second sink [degC]; null without.
    # Mean speed of the loaded part [rpm]; null where a test does not tell it.
    speed_rpm: float | None = None
    coolant_degC: float | None = None  # Likewise that of the coolant [degC].
    fan: float | None = None  # Likewise fan or flow over its rated value [1].
    rated_speed_rpm: float  # Speed that effects are scaled with [rpm].
    rated_current_A: float  # Current that effects are scaled with [A].
    largest_current_A: NonNegative  # Largest rms current of a block [A].
    highest_winding_degC: float  # Highest reading of a block [degC].


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedModel:
    """A network as it was fitted."""

    title: str = ""  # Its name in words.
    nodes: tuple[str, ...] = ()  # Its nodes.
    # Its two sinks, the one that rises count from first; unset where it has one.
    sinks: tuple[str, ...] | UnsetType = UNSET
    effects: tuple[EffectInModel, ...] = ()  # Effects that it has.
    result: Literal["converged", "not_converged", "no_start"]  # How the fit ended.
    message: str  # The same as a sentence.
    stats: dict[str, int | float | None]  # Figures of the search by name.
    num_modes: Count  # Optima that share the posterior.
    parameters: dict[str, FittedParameter]  # Network, resistance and effects by name.
    nuisances: dict[str, FittedParameter]  # Instruments and starts by name.
    correlation: Correlation  # Of the free parameters.
    noise: FittedNoise  # Of the residuals.
    residuals: tuple[ResidualRow, ...]  # Errors by test.
    bodies: tuple[BodyRow, ...] | UnsetType = UNSET  # Errors of measured bodies beside the winding.
    posterior: PosteriorQuality  # How it was drawn.
    derived: dict[str, Derived]  # Figures that follow from the parameters, by name with unit.
    evidence: Evidence  # What the network is compared by, without the effects that it may miss.
    # Effects that it may miss, the most probable first; the draws are averaged over them.
    maybe_missing: tuple[MaybeMissing, ...] | UnsetType = UNSET
    # The plain network nearest to it; unset where it has no effects.
    replica: Replica | UnsetType = UNSET
    # What `derived` is stated at; unset in runs of earlier versions.
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
    """Which of two networks the data favour."""

    order: str  # Name of the network, or `"undecided"`.
    sentence: str  # The verdict in words.
    # Of the network with more nodes to the other one [nat]; null if there are not two.
    log_bayes_factor: float | None
    # Mean log score per block of the network with more nodes less that of the other one, over the
    # held-out tests [nat]; unset where there is none.
    log_score_difference: float | UnsetType = UNSET
    # Its standard error, which allows for neighbouring blocks that err alike [nat]; unset likewise.
    log_score_difference_se: NonNegative | UnsetType = UNSET


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """How long two networks stay within an error."""

    test: str  # Name of the test.
    limit_K: NonNegative  # The error [K].
    # Time at which the network with fewer nodes leaves it [s]; null if it never does.
    until_s: float | None
    second_until_s: float | None  # The same for the other network [s].


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """The measured peak of a test and what two networks predict there."""

    test: str  # Name of the test.
    time_s: float  # When [s].
    measured_degC: float  # The peak [degC].
    first_degC: float  # What the network with fewer nodes predicts [degC].
    second_degC: float  # What the other one predicts [degC].


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two networks over the same tests."""

    words: tuple[str, ...]  # The comparison in sentences.
    thresholds: tuple[Threshold, ...]  # By test and error.
    peak: tuple[Peak, ...]  # By test.


FIT_FORMAT = "heatrun-fit/1"
"""The number rises with what a reader must know."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedMotor:
    """What the motor file said of the machine."""

    name: str  # The machine.
    phases: Count  # Number of phases [1].
    # Whether `losses_W` is the measured total or the other losses alone.
    losses: Literal["balance", "map"]
    sink: Literal["ambient", "coolant"]  # Channel that the stator loses its heat to.
    insulation_class: str | None  # IEC 60085 class letter, or null.
    phase_resistance_ohm: float | None  # At the reference temperature [ohm], or null.
    reference_temperature_degC: float  # Temperature that the resistance holds for [degC].
    resistance_coefficient_degC: float  # B of R(T) = R (B + T)/(B + Tref) [degC].
    rated_speed_rpm: float | None = None  # Speed that effects are scaled with [rpm], or null.
    rated_current_A: float | None = None  # Rms current that they are scaled with [A], or null.
    path: str  # The motor file as the user gave it; empty if made in memory.
    sha256: str  # Its digest; empty likewise.


@dataclass(frozen=True, slots=True)
class UseVerdict:
    """Whether the parameters can be used: the one verdict, which every page prints."""

    use: Literal["usable", "restricted", "not usable"]  # In a word.
    sentence: str  # What it means here.
    reasons: tuple[str, ...]  # What decides it first, then what else it rests on, in sentences.


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """The result of a calibration, or of the final model of a discovery."""

    format: Literal["heatrun-fit/1"]  # Of this file.
    heatrun_version: str  # That wrote it.
    command: str  # As it was given.
    seed: int  # Random seed.
    motor: FittedMotor  # The machine.
    tests: Annotated[tuple[DescribedTest, ...], Meta(min_length=1)]  # Calibration first.
    findings: tuple[Finding, ...]  # About records, fits and sampling.
    verdict: NetworkVerdict  # Which network the data favour.
    # The fitted networks by name, the one with fewer nodes first.
    models: Annotated[dict[str, FittedModel], Meta(min_length=1)]
    comparison: Comparison | None  # Of two networks; null if there are not two.
    # Ids of the effects that the tests asked for; unset in runs of earlier versions.
    effects: tuple[str, ...] | UnsetType = UNSET
    # Whether the parameters can be used; unset in runs of earlier versions.
    use: UseVerdict | UnsetType = UNSET
