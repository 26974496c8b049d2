"""From the rows of a fleet to the effects that its machines share: `fleet_discovery.json`."""

from pathlib import Path

from heatrun.errors import InputError
from heatrun.io.quantities import printed_unit, rounded
from heatrun.results import from_json
from heatrun.version import __version__

from ..results import FleetDiscoveryResult, LeftOutOfDiscovery, SharedEffect, TypeDiscovery
from ..rows import FITTED, OF_EFFECTS, Row, evidence_in
from .pooled import Evidence
from .search import ALONE, FEWEST, LEVEL, discover_type

NAME = "fleet_discovery.json"

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

    types: dict[str, tuple[list[Evidence], set[str], list[LeftOutOfDiscovery]]] = {}
    with ParquetFile(rows) as file:
        for number in range(file.num_row_groups):
            for row in file.read_row_group(number, columns=list(NEEDED)).to_pylist():
                evidence, thermal, left_out = types.setdefault(row["type"] or "", ([], set(), []))
                if reason := _why_not(row):
                    left_out.append(LeftOutOfDiscovery(machine=row["machine"], reason=reason))
                else:
                    evidence.append(evidence_in(row))
                    thermal |= set(row["parameters"])
    large = sum(len(evidence) >= FEWEST for evidence, _, _ in types.values())
    level = LEVEL / max(1, large)
    return FleetDiscoveryResult(
        format="heatrun-fleet-discovery/1",
        heatrun=__version__,
        fleet=fleet,
        level=LEVEL,
        seed=seed,
        types=[discover_type(name, *own, level=level, seed=seed) for name, own in types.items()],
    )


def _why_not(row: Row) -> str:
    """Return why a machine takes no part; empty if it does."""
    if row["status"] != FITTED:
        return row["status"]
    if not row["is_converged"]:
        return "the fit did not converge"
    return "" if row["effects"] else "no effect could be told from its tests"


def read_discovery(folder: Path) -> FleetDiscoveryResult:
    """Return what stands in the folder of a fleet.

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


MOST_NAMED = 5
"""Machines that are named; all stand in the file."""


def discovery_text(found: FleetDiscoveryResult) -> str:
    """Return what the machines of each type share, as text for the terminal."""
    return "\n\n".join("\n".join(_type(each)) for each in found.types)


def _type(found: TypeDiscovery) -> list[str]:
    lines = [f"{'Type ' + found.type if found.type else 'All machines'}: {found.sentence}"]
    for effect in found.effects:
        lines += _effect(effect)
    for effect in found.traces:
        lines.append(f"  trace: {effect.id}, {rounded(effect.visible_K.value, 2)} K")
    seen = sorted(e.could_show_K for e in found.screened if e.could_show_K is not None)
    if found.effects:
        lines.append(f"  {found.num_alone} of {found.num_machines} machines would show something "
                     f"by their own tests alone; {rounded(ALONE * found.num_machines, 2)} would "
                     "by chance")  # fmt: skip
    elif seen:
        lines.append(f"  half of the catalogue would have been seen from "
                     f"{rounded(seen[len(seen) // 2], 2)} K on")  # fmt: skip
    if found.left_out:
        names = ", ".join(f"{each.machine} ({each.reason})" for each in found.left_out[:MOST_NAMED])
        others = len(found.left_out) - MOST_NAMED
        lines.append(f"  without {names}{f' and {others} more' if others > 0 else ''}")
    return lines


def _effect(effect: SharedEffect) -> list[str]:
    unit = printed_unit(effect.unit)
    low, high = effect.size.interval_95
    shape = ", ".join(f"{name} = {rounded(value, 3)}" for name, value in effect.shape.items())
    lines = [
        f"  {effect.id}: {effect.parameter} = {rounded(effect.size.value, 3)} {unit}".rstrip()
        + f" ({rounded(low, 3)} … {rounded(high, 3)}){' with ' + shape if shape else ''}",
        f"    leaves {rounded(effect.visible_K.value, 2)} K "
        f"({rounded(effect.visible_K.interval_95[0], 2)} … "
        f"{rounded(effect.visible_K.interval_95[1], 2)} K) of a refitted network; by chance with "
        f"p = {rounded(effect.familywise_p, 2)} over all effects; {effect.num_machines} machines",
    ]
    if effect.spread > 0.0:
        lines.append(f"    from machine to machine by {rounded(effect.spread, 2)} {unit}".rstrip())
    if effect.equivalents:
        lines.append(f"    not told apart from {', '.join(effect.equivalents)}")
    for rival in effect.instruments:
        lines.append(f"    or {rival.name} off, for all machines, by "
                     f"{rounded(abs(rival.stated_sds), 2)} times its stated standard "
                     "deviation")  # fmt: skip
    if not effect.is_beyond_instruments:
        lines.append("    not claimed: instruments off three times as far as stated would do")
    lines.append(f"    what would tell: {effect.separating_test}")
    return lines
