"""A fitted network, as it stands in `fit.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from msgspec import UNSET, UnsetType

from ..io.quantities import quantity, rounded
from .derived import Derived
from .parameter import FittedParameter
from .residuals import BodyRow, ResidualRow
from .values import Count, Interval, NonNegative, Probability, known

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
    """

    id: str
    law: str
    parameters: tuple[str, ...]


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
