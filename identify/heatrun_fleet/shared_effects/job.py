"""From the rows of a fleet to the effects that its machines share: `fleet_discovery.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from heatrun.errors import InputError
from heatrun.results import from_json
from heatrun.version import __version__

from ..results import (
    FleetDiscoveryResult,
    FleetVerdict,
    LeftOutOfDiscovery,
    SharedEffect,
    TypeDiscovery,
)
from ..rows import OF_EFFECTS, evidence_in
from .pooled import Evidence, pool
from .search import FEWEST, Search, search

NAME = "fleet_discovery.json"

LEVEL = 0.05
"""Probability of finding anything in a fleet without effects, over all its types [1]."""

NEEDED = ("machine", "type", "status", "is_converged", "parameters",
          *(name for name, _, _, _ in OF_EFFECTS))  # fmt: skip


def discover_fleet(rows: Path, fleet: str, *, seed: int = 0) -> FleetDiscoveryResult:
    """Return the effects that the machines of each type share.

    Args:
        rows: `machines.parquet` of a fleet that was calibrated with `--discover`.
        fleet: Name of the fleet.
        seed: Of what is drawn.
    """
    from pyarrow.parquet import ParquetFile

    types: dict[str, _Type] = {}
    with ParquetFile(rows) as file:
        for number in range(file.num_row_groups):
            for row in file.read_row_group(number, columns=list(NEEDED)).to_pylist():
                types.setdefault(row["type"] or "", _Type()).add(row)
    large = sum(len(each.machines) >= FEWEST for each in types.values())
    level = LEVEL / max(1, large)
    return FleetDiscoveryResult(
        format="heatrun-fleet-discovery/1",
        heatrun=__version__,
        fleet=fleet,
        level=LEVEL,
        seed=seed,
        types=[each.discovery(name, level, seed) for name, each in types.items()],
    )


def read_discovery(folder: Path) -> FleetDiscoveryResult:
    """Return what stands in the folder of a fleet.

    Args:
        folder: Of the fleet.

    Raises:
        InputError: If there is none, or it cannot be read.
    """
    try:
        content = (folder / NAME).read_bytes()
    except OSError as error:
        raise InputError(
            f"Expected {NAME} in the folder of the fleet, found none ({error.strerror}).",
            where=str(folder),
            remedy="Calibrate the fleet with --discover.",
        ) from None
    return from_json(content, FleetDiscoveryResult, NAME, str(folder))


class _Type:
    """The machines of a type as they are read."""

    def __init__(self) -> None:
        self.machines: list[str] = []
        self.evidence: list[Evidence] = []
        self.thermal: set[str] = set()
        self.left_out: list[LeftOutOfDiscovery] = []

    def add(self, row: Mapping[str, Any]) -> None:
        evidence = evidence_in(row) if row["status"] == "fitted" else None
        reason = ""
        if row["status"] != "fitted":
            reason = row["status"]
        elif not row["is_converged"]:
            reason = "the fit did not converge"
        elif evidence is None:
            reason = "no effect could be told from its tests"
        if reason or evidence is None:
            self.left_out.append(LeftOutOfDiscovery(machine=row["machine"], reason=reason))
            return
        self.machines.append(row["machine"])
        self.evidence.append(evidence)
        self.thermal |= set(row["parameters"])

    def discovery(self, name: str, level: float, seed: int) -> TypeDiscovery:
        if len(self.machines) < FEWEST:
            return TypeDiscovery(
                type=name, verdict="too_few",
                sentence=f"Effects that machines share are sought from {FEWEST} machines on; "
                f"{len(self.machines)} can be used.",
                effects=[], traces=[], critical=None, num_machines=len(self.machines), num_alone=0,
                left_out=self.left_out, screened=[],
            )  # fmt: skip
        return discover_type(name, self.machines, self.evidence, self.thermal, self.left_out,
                             level=level, seed=seed)  # fmt: skip


def discover_type(
    name: str,
    machines: Sequence[str],
    evidence: Sequence[Evidence],
    thermal: set[str],
    left_out: Sequence[LeftOutOfDiscovery] = (),
    *,
    level: float = LEVEL,
    seed: int = 0,
) -> TypeDiscovery:
    """Return the effects that machines of a type share.

    Args:
        name: Of the type.
        machines: Name of each, `FEWEST` or more.
        evidence: Of each.
        thermal: Names of the parameters of the network and its known effects.
        left_out: Machines that take no part.
        level: Probability of finding anything where there is nothing [1].
        seed: Of what is drawn.
    """
    whole = pool(machines, evidence)
    instruments = [n for n in whole.parameters if n not in thermal and "_start[" not in n]
    found = search(whole, instruments, level, seed)
    verdict, sentence = _verdict(found, len(machines))
    return TypeDiscovery(
        type=name,
        verdict=verdict,
        sentence=sentence,
        effects=found.effects,
        traces=found.traces,
        critical=found.critical,
        num_machines=len(machines),
        num_alone=found.num_alone,
        left_out=list(left_out),
        screened=found.screened,
    )


def _verdict(found: Search, num: int) -> tuple[FleetVerdict, str]:
    if not found.effects and found.is_left:
        return "unexplained", (
            f"The {num} machines share something that no effect of the catalogue explains at a "
            "plausible size."
        )
    if not found.effects:
        seen = f" {len(found.traces)} too small to matter." if found.traces else ""
        return "nothing_found", (
            f"No effect that matters is shared by the {num} machines, as far as their tests "
            f"together can show.{seen}"
        )
    names = " and ".join(_words(each) for each in found.effects)
    if found.is_left:
        return "unexplained", (
            f"The {num} machines share something that the catalogue does not explain: {names} "
            "helps, and more is left, so no cause is claimed."
        )
    if any(not each.is_beyond_instruments for each in found.effects):
        return "instrument", (
            f"The {num} machines share {names}, or an instrument of their bench is off: no number "
            "of machines tells the two apart."
        )
    if any(each.equivalents for each in found.effects):
        return "ambiguous", (
            f"The {num} machines share {names}; their tests together do not say which."
        )
    return "named", f"The {num} machines share {names}."


def _words(effect: SharedEffect) -> str:
    if not effect.equivalents:
        return effect.id
    return f"one of {', '.join([effect.id, *effect.equivalents])}"
