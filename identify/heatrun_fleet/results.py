"""What `population.json` and `fleet_discovery.json` hold, as types; as `heatrun.results`.

The first is the population of a type, the second the effects that the machines of a fleet share.
`python -m heatrun_fleet.results population-1.json` prints the JSON schema of one, as
`heatrun.results.schema`.
"""

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
    """A parameter over the machines of a type."""

    unit: str  # Its unit.
    # Whether the logarithm of the value or the value itself is normal over machines.
    transform: Literal["log", "linear"]
    median: ValueWithInterval  # Median over the machines [unit].
    # Standard deviation over the machines: of the logarithm, less 1 after taking the exponential,
    # for `"log"` [1]; of the value for `"linear"` [unit].
    spread: ValueWithInterval
    tolerance_95_95: Interval  # Limits that hold 95 % of the machines at 95 % confidence [unit].
    next_median: float  # Median of the next machine before its first test [unit].
    next_log_sd: NonNegative | None  # Standard deviation of its logarithm [1]; null for `"linear"`.
    next_sd: NonNegative | None  # Standard deviation of its value [unit]; null for `"log"`.
    # 95 % interval of the next machine [unit], which may be one that does not belong to the type.
    next_interval_95: Interval

    def tells(self, limits: Interval) -> bool:
        """Return whether limits of it, such as those of tolerance, are near enough to tell it."""
        low, high = limits
        return self.transform != "log" or high <= TOO_FAR * low


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationCovariate:
    """A covariate of the machines: what its numbers are."""

    column: str  # Column of the fleet file.
    kind: Literal["number", "date", "category"]  # What its texts were taken for.
    unit: str  # What one unit is: `"1"` of the column's own, `"year"`, or the category.
    reference: str  # The category that it is held against; empty for numbers and dates.
    first: str  # Smallest number or date over the machines; empty for a category.
    last: str  # Largest number or date likewise.
    # What it does to each parameter from the first to the last, or in the category: a share for a
    # parameter that is normal by its logarithm, else in its unit.
    over_range: dict[str, ValueWithInterval]


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineParameter:
    """A parameter of a machine before and after the others were taken into account."""

    value: float  # Given all machines [unit].
    interval_95: Interval  # Likewise [unit].
    alone_value: float  # By its own calibration [unit].
    alone_interval_95: Interval  # Likewise [unit].
    # How far its tests put it from what is expected of it [standard deviations].
    distance_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationMachine:
    """A machine of the type."""

    name: str  # Its name.
    outlier_probability: Probability  # Probability that it does not belong to the type [1].
    is_outlier: bool  # Whether that is above one half.
    different: list[str]  # Parameters that are far from what is expected of it.
    # How far its posterior was wider than its prior in some direction, over the prior's precision
    # [1]; more than a trifle puts its row in doubt.
    clipped: NonNegative
    parameters: dict[str, MachineParameter]  # By name.


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineLeftOut:
    """A machine that does not count."""

    name: str  # Its name.
    reason: str  # Why, in a sentence.


@dataclass(frozen=True, slots=True, kw_only=True)
class Assumed:
    """What was assumed of a parameter before the machines were seen."""

    mean: float  # Centre of the prior of the population's median [unit].
    mean_sd: NonNegative  # Standard deviation of the prior in the space of the transform.
    # Median of the half-Cauchy prior of the spread, in the space of the transform.
    spread: NonNegative
    effect_sd: NonNegative  # Standard deviation of what a covariate does over its range, likewise.


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationNoise:
    """Noise and unmodelled heat over the machines of a type: a population of its own.

    A machine with a loose sensor is no other motor: which machines do not fit is told apart here
    and for the thermal parameters.
    """

    num_machines: Count  # Machines that count.
    is_converged: bool  # Whether the draws are to be relied on.
    parameters: dict[str, PopulationParameter]  # By name: noise and unmodelled heat.
    # Over the machines, of the logarithms, in the order of `parameters` [1].
    correlation: list[list[float]]
    outlier_share: ValueWithInterval  # Share of machines whose noise is not that of the type [1].
    # What each changes over its range, a share [1], by label and parameter.
    covariates: dict[str, dict[str, ValueWithInterval]]
    machines: list[PopulationMachine]  # The machines that count.
    assumed: dict[str, Assumed]  # Hyperprior by parameter.


@dataclass(frozen=True, slots=True, kw_only=True)
class PopulationResult:
    """What the machines of a type have in common, how they differ, and which do not fit."""

    format: Literal["heatrun-population/1"]  # Of the file.
    heatrun: str  # Version that wrote it.
    type: str  # Of the machines; empty if not said.
    # What the machines were taken from: fleet, network, SHA-256 of the rows.
    source: dict[str, str]
    num_machines: Count  # Machines that count.
    left_out: list[MachineLeftOut]  # Machines that do not.
    method: Literal["importance", "emcee"]  # How the posterior was drawn.
    pareto_k: float | None  # Of the importance weights [1]; null where they are of no use.
    is_converged: bool  # Whether the draws are to be relied on.
    seed: Count  # Random seed.
    parameters: dict[str, PopulationParameter]  # By name.
    # Over the machines, in the space of the transforms, in the order of `parameters` [1].
    correlation: list[list[float]]
    outlier_share: ValueWithInterval  # Share of machines that do not belong to the type [1].
    # What one unit of each does to each parameter, as `over_range` says it.
    covariates: dict[str, dict[str, ValueWithInterval]]
    covariate_columns: dict[str, PopulationCovariate]  # What each of them is.
    machines: list[PopulationMachine]  # The machines that count.
    assumed: dict[str, Assumed]  # Hyperprior by parameter.
    notes: list[str]  # What else must be known of it, in sentences.
    # Noise and unmodelled heat over the machines; not there where their calibrations do not tell
    # them.
    noise: PopulationNoise | UnsetType = UNSET


FleetVerdict = Literal[
    "nothing_found", "named", "ambiguous", "instrument", "unexplained", "too_few"
]


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentRival:
    """An instrument of the bench whose error, shared by all machines, would explain as much."""

    name: str  # Of the instrument's error, as in the fits.
    # How far it would have to be off, in standard deviations that are stated for it.
    stated_sds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedEffect:
    """An effect that the machines of a type share."""

    id: str  # Of the effect in the catalogue.
    # Effects that these tests, of all machines together, cannot tell from it.
    equivalents: list[str]
    # Whether it stands when all instruments may be off three times as far as is stated, and no
    # single one by up to six standard deviations would explain as much. If not, it may as well be
    # an instrument.
    is_beyond_instruments: bool
    instruments: list[InstrumentRival]  # Instruments one of which would explain as much.
    parameter: str  # The parameter that says its size.
    shape: dict[str, float]  # Values of its other parameters that suit the machines best, by name.
    unit: str  # Of the size.
    size: ValueWithInterval  # Mean over machines [unit].
    # Standard deviation of the size from machine to machine beyond what each machine's tests leave
    # open [unit]; zero if none is seen.
    spread: NonNegative
    visible_K: ValueWithInterval  # What it leaves of a refitted network, root mean square [K].
    statistic: float  # Score over its standard deviation [1].
    # Probability that the largest of all effects reaches it by chance [1].
    familywise_p: Probability
    num_machines: Count  # Machines that it rests on.
    separating_test: str  # The test that would tell it from its rivals.


@dataclass(frozen=True, slots=True, kw_only=True)
class ScreenedEffect:
    """How an effect of the catalogue fared."""

    id: str  # Of the effect.
    # Score over its standard deviation, at the setting of its shape that suits best, before
    # anything was accepted [1].
    statistic: float
    # Smallest effect that these machines together would show, by what it leaves of a refitted
    # network, root mean square [K]; null if they could show none.
    could_show_K: NonNegative | None
    num_machines: Count  # Machines that could show it.


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutOfDiscovery:
    """A machine that took no part."""

    machine: str  # Its name.
    reason: str  # Why.


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeDiscovery:
    """What the machines of a type share."""

    type: str  # The type; empty if none is said.
    # In a word: nothing found; one effect named; one of several that cannot be told apart; an
    # effect or an instrument; more is there than the catalogue explains; too few machines.
    verdict: FleetVerdict
    sentence: str  # In a sentence.
    effects: list[SharedEffect]  # What was found, in that order.
    traces: list[SharedEffect]  # What is there and too small to matter, likewise.
    critical: float | None  # Statistic that an effect must reach [1].
    num_machines: Count  # Machines that took part.
    # Machines of which their own tests alone show an effect; of machines without any, one in twenty
    # would by chance.
    num_alone: Count
    left_out: list[LeftOutOfDiscovery]  # Machines that took no part.
    screened: list[ScreenedEffect]  # All effects.


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetDiscoveryResult:
    """What the machines of a fleet share."""

    format: Literal["heatrun-fleet-discovery/1"]  # Of this file.
    heatrun: str  # Version.
    fleet: str  # Name of the fleet.
    # Probability of finding anything in a fleet without effects, over all types [1].
    level: Probability
    seed: int  # Random seed.
    types: list[TypeDiscovery]  # Each type.


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
