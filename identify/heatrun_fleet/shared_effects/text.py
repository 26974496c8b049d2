"""What the machines of a fleet share, in plain text for the terminal."""

from __future__ import annotations

from heatrun.io.quantities import printed_unit, rounded

from ..results.fleet_discovery import FleetDiscoveryResult, SharedEffect, TypeDiscovery
from .alone import ALONE

MOST = 5
"""Machines that are named; all stand in the file."""


def discovery_text(found: FleetDiscoveryResult) -> str:
    """Return what the machines of each type share.

    Args:
        found: The discovery.
    """
    return "\n\n".join("\n".join(_type(each)) for each in found.types)


def _type(found: TypeDiscovery) -> list[str]:
    lines = [f"{'Type ' + found.type if found.type else 'All machines'}: {found.sentence}"]
    for effect in found.effects:
        lines += _effect(effect)
    for effect in found.traces:
        lines.append(f"  trace: {effect.id}, {rounded(effect.visible_K.value, 2)} K")
    if found.effects:
        lines.append(f"  {found.num_alone} of {found.num_machines} machines would show something "
                     f"by their own tests alone; {rounded(ALONE * found.num_machines, 2)} would "
                     "by chance")  # fmt: skip
    elif found.screened:
        seen = [each.could_show_K for each in found.screened if each.could_show_K is not None]
        if seen:
            seen.sort()
            lines.append(f"  half of the catalogue would have been seen from "
                         f"{rounded(seen[len(seen) // 2], 2)} K on")  # fmt: skip
    if found.left_out:
        names = ", ".join(f"{each.machine} ({each.reason})" for each in found.left_out[:MOST])
        more = f" and {len(found.left_out) - MOST} more" if len(found.left_out) > MOST else ""
        lines.append(f"  without {names}{more}")
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
