"""The effects that the machines of a fleet share: the whole of `fleet_discovery.json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from heatrun.results.discovery import ValueWithInterval
from heatrun.results.values import Count, NonNegative, Probability

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
class MachineLeftOut:
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
    left_out: list[MachineLeftOut]
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
