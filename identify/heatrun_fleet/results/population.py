"""The population of a type, as it stands in `population.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from msgspec import UNSET, UnsetType

from heatrun.results.discovery import ValueWithInterval
from heatrun.results.values import Count, Interval, NonNegative, Probability

POPULATION_FORMAT = "heatrun-population/1"


TOO_FAR = 20.0
"""Upper over lower limit from which on a parameter counts as not determined [1]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationParameter:
    """A parameter over the machines of a type.

    Attributes:
        unit: Its unit.
        transform: Whether the logarithm of the value or the value itself is normal over machines.
        median: Median over the machines [unit].
        spread: Standard deviation over the machines: of the logarithm, less 1 after taking the
            exponential, for `"log"` [1]; of the value for `"linear"` [unit].
        tolerance_95_95: Limits that hold 95 % of the machines at 95 % confidence [unit].
        next_median: Median of the next machine before its first test [unit].
        next_log_sd: Standard deviation of its logarithm [1]; null for `"linear"`.
        next_sd: Standard deviation of its value [unit]; null for `"log"`.
        next_interval_95: 95 % interval of the next machine [unit], which may be one that does not
            belong to the type.
    """

    unit: str
    transform: Literal["log", "linear"]
    median: ValueWithInterval
    spread: ValueWithInterval
    tolerance_95_95: Interval
    next_median: float
    next_log_sd: NonNegative | None
    next_sd: NonNegative | None
    next_interval_95: Interval

    def tells(self, limits: Interval) -> bool:
        """Return whether limits of it, such as those of tolerance, are near enough to tell it."""
        low, high = limits
        return self.transform != "log" or high <= TOO_FAR * low


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationCovariate:
    """A covariate of the machines: what its numbers are.

    Attributes:
        column: Column of the fleet file.
        kind: What its texts were taken for.
        unit: What one unit is: `"1"` of the column's own, `"year"`, or the category.
        reference: The category that it is held against; empty for numbers and dates.
        first: Smallest number or date over the machines; empty for a category.
        last: Largest number or date likewise.
        over_range: What it does to each parameter from the first to the last, or in the category:
            a share for a parameter that is normal by its logarithm, else in its unit.
    """

    column: str
    kind: Literal["number", "date", "category"]
    unit: str
    reference: str
    first: str
    last: str
    over_range: dict[str, ValueWithInterval]


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineParameter:
    """A parameter of a machine before and after the others were taken into account.

    Attributes:
        value: Given all machines [unit].
        interval_95: Likewise [unit].
        alone_value: By its own calibration [unit].
        alone_interval_95: Likewise [unit].
        distance_sd: How far its tests put it from what is expected of it [standard deviations].
    """

    value: float
    interval_95: Interval
    alone_value: float
    alone_interval_95: Interval
    distance_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationMachine:
    """A machine of the type.

    Attributes:
        name: Its name.
        outlier_probability: Probability that it does not belong to the type [1].
        is_outlier: Whether that is above one half.
        different: Parameters that are far from what is expected of it.
        clipped: How far its posterior was wider than its prior in some direction, over the prior's
            precision [1]; more than a trifle puts its row in doubt.
        parameters: By name.
    """

    name: str
    outlier_probability: Probability
    is_outlier: bool
    different: list[str]
    clipped: NonNegative
    parameters: dict[str, MachineParameter]


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineLeftOut:
    """A machine that does not count.

    Attributes:
        name: Its name.
        reason: Why, in a sentence.
    """

    name: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumed:
    """What was assumed of a parameter before the machines were seen.

    Attributes:
        mean: Centre of the prior of the population's median [unit].
        mean_sd: Standard deviation of the prior in the space of the transform.
        spread: Median of the half-Cauchy prior of the spread, in the space of the transform.
        effect_sd: Standard deviation of what a covariate does over its range, likewise.
    """

    mean: float
    mean_sd: NonNegative
    spread: NonNegative
    effect_sd: NonNegative


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationNoise:
    """Noise and unmodelled heat over the machines of a type: a population of its own.

    A machine with a loose sensor is no other motor: which machines do not fit is told apart here
    and for the thermal parameters.

    Attributes:
        num_machines: Machines that count.
        is_converged: Whether the draws are to be relied on.
        parameters: By name: noise and unmodelled heat.
        correlation: Over the machines, of the logarithms, in the order of `parameters` [1].
        outlier_share: Share of machines whose noise is not that of the type [1].
        covariates: What each changes over its range, a share [1], by label and parameter.
        machines: The machines that count.
        assumed: Hyperprior by parameter.
    """

    num_machines: Count
    is_converged: bool
    parameters: dict[str, PopulationParameter]
    correlation: list[list[float]]
    outlier_share: ValueWithInterval
    covariates: dict[str, dict[str, ValueWithInterval]]
    machines: list[PopulationMachine]
    assumed: dict[str, Assumed]


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationResult:
    """What the machines of a type have in common, how they differ, and which do not fit.

    Attributes:
        format: Of the file.
        heatrun: Version that wrote it.
        type: Of the machines; empty if not said.
        source: What the machines were taken from: fleet, network, SHA-256 of the rows.
        num_machines: Machines that count.
        left_out: Machines that do not.
        method: How the posterior was drawn.
        pareto_k: Of the importance weights [1]; null where they are of no use.
        is_converged: Whether the draws are to be relied on.
        seed: Random seed.
        parameters: By name.
        correlation: Over the machines, in the space of the transforms, in the order of
            `parameters` [1].
        outlier_share: Share of machines that do not belong to the type [1].
        covariates: What one unit of each does to each parameter, as `over_range` says it.
        covariate_columns: What each of them is.
        machines: The machines that count.
        assumed: Hyperprior by parameter.
        notes: What else must be known of it, in sentences.
        noise: Noise and unmodelled heat over the machines; not there where their calibrations do
            not tell them.
    """

    format: Literal["heatrun-population/1"]
    heatrun: str
    type: str
    source: dict[str, str]
    num_machines: Count
    left_out: list[MachineLeftOut]
    method: Literal["importance", "emcee"]
    pareto_k: float | None
    is_converged: bool
    seed: Count
    parameters: dict[str, PopulationParameter]
    correlation: list[list[float]]
    outlier_share: ValueWithInterval
    covariates: dict[str, dict[str, ValueWithInterval]]
    covariate_columns: dict[str, PopulationCovariate]
    machines: list[PopulationMachine]
    assumed: dict[str, Assumed]
    notes: list[str]
    noise: PopulationNoise | UnsetType = UNSET
