"""What `population.json` and `fleet_discovery.json` hold, as types; as `heatrun.results`.

The first is the population of a type, the second the effects that the machines of a fleet share.
`python -m heatrun_fleet.results population-1.json` prints the JSON schema of one, as
`heatrun.results.schema`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Literal

from msgspec import UNSET, UnsetType

from heatrun.results.discovery import ValueWithInterval
from heatrun.results.schema import Schemas, print_schemas
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


FleetVerdict = Literal[
    "nothing_found", "named", "ambiguous", "instrument", "unexplained", "too_few"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentRival:
    """An instrument of the bench whose error, shared by all machines, would explain as much.

    Attributes:
        name: Of the instrument's error, as in the fits.
        stated_sds: How far it would have to be off, in standard deviations that are stated for it.
    """

    name: str
    stated_sds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedEffect:
    """An effect that the machines of a type share.

    Attributes:
        id: Of the effect in the catalogue.
        equivalents: Effects that these tests, of all machines together, cannot tell from it.
        is_beyond_instruments: Whether it stands when all instruments may be off three times as far
            as is stated, and no single one by up to six standard deviations would explain as much.
            If not, it may as well be an instrument.
        instruments: Instruments one of which would explain as much.
        parameter: The parameter that says its size.
        shape: Values of its other parameters that suit the machines best, by name.
        unit: Of the size.
        size: Mean over machines [unit].
        spread: Standard deviation of the size from machine to machine beyond what each machine's
            tests leave open [unit]; zero if none is seen.
        visible_K: What it leaves of a refitted network, root mean square [K].
        statistic: Score over its standard deviation [1].
        familywise_p: Probability that the largest of all effects reaches it by chance [1].
        num_machines: Machines that it rests on.
        separating_test: The test that would tell it from its rivals.
    """

    id: str
    equivalents: list[str]
    is_beyond_instruments: bool
    instruments: list[InstrumentRival]
    parameter: str
    shape: dict[str, float]
    unit: str
    size: ValueWithInterval
    spread: NonNegative
    visible_K: ValueWithInterval
    statistic: float
    familywise_p: Probability
    num_machines: Count
    separating_test: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ScreenedEffect:
    """How an effect of the catalogue fared.

    Attributes:
        id: Of the effect.
        statistic: Score over its standard deviation, at the setting of its shape that suits best,
            before anything was accepted [1].
        could_show_K: Smallest effect that these machines together would show, by what it leaves of
            a refitted network, root mean square [K]; null if they could show none.
        num_machines: Machines that could show it.
    """

    id: str
    statistic: float
    could_show_K: NonNegative | None
    num_machines: Count


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutOfDiscovery:
    """A machine that took no part.

    Attributes:
        machine: Its name.
        reason: Why.
    """

    machine: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeDiscovery:
    """What the machines of a type share.

    Attributes:
        type: The type; empty if none is said.
        verdict: In a word: nothing found; one effect named; one of several that cannot be told
            apart; an effect or an instrument; more is there than the catalogue explains; too few
            machines.
        sentence: In a sentence.
        effects: What was found, in that order.
        traces: What is there and too small to matter, likewise.
        critical: Statistic that an effect must reach [1].
        num_machines: Machines that took part.
        num_alone: Machines of which their own tests alone show an effect; of machines without any,
            one in twenty would by chance.
        left_out: Machines that took no part.
        screened: All effects.
    """

    type: str
    verdict: FleetVerdict
    sentence: str
    effects: list[SharedEffect]
    traces: list[SharedEffect]
    critical: float | None
    num_machines: Count
    num_alone: Count
    left_out: list[LeftOutOfDiscovery]
    screened: list[ScreenedEffect]


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetDiscoveryResult:
    """What the machines of a fleet share.

    Attributes:
        format: Of this file.
        heatrun: Version.
        fleet: Name of the fleet.
        level: Probability of finding anything in a fleet without effects, over all types [1].
        seed: Random seed.
        types: Each type.
    """

    format: Literal["heatrun-fleet-discovery/1"]
    heatrun: str
    fleet: str
    level: Probability
    seed: int
    types: list[TypeDiscovery]


SCHEMAS: Schemas = {
    "population-1.json": (
        PopulationResult,
        "population.json of heatrun: what `heatrun population` writes",
    ),
    "fleet-discovery-1.json": (
        FleetDiscoveryResult,
        "fleet_discovery.json of heatrun: what `heatrun fleet --discover` writes",
    ),
}
"""As `heatrun.results.schema.SCHEMAS`."""


if __name__ == "__main__":
    sys.exit(print_schemas(sys.argv[1:], SCHEMAS))
