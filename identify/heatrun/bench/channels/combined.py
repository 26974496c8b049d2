"""Several sensors of one channel: `mean(T_U, T_V, T_W)` and `hottest(T_U, T_V, T_W)`.

The thermometers of the three phases read one winding. Their mean is what a network of one winding
node stands for; the hottest is what an insulation limit is about.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ..record import Finding, UnitSource
from .schema import CHANNEL

COMBINED = re.compile(
    r"(?P<how>mean|hottest)\s*\((?P<parts>[^()]*(?:\([^()]*\)[^()]*)*)\)(?:\s*\[(?P<unit>[^\[\]]+)\])?",
    re.DOTALL,
)
"""Right-hand side of `[columns]`; a unit behind it holds for all of its columns."""

MOST_PARTS = 64

APART_K, APART_SHARE = 5.0, 0.2
"""A sensor this far from the median of the others, and by this share of their rise [1], is loose or
elsewhere: phases of one winding differ by a few kelvin."""


FLOWS = 0.2
"""In parts of the largest current [1]: below, offsets of the clamps decide."""

UNBALANCE, PHASE_OFF, NOTHING = 0.1, 0.2, 0.02
"""Phases of a balanced machine agree to this share [1]; one that differs by the second is its
clamp's, its range's or its winding's; one below the third is dead."""


def split_parts(text: str) -> list[str]:
    """Return the columns between the brackets; a comma inside brackets separates none."""
    return [part.strip() for part in re.split(r",(?![^\[(]*[\])])", text)]


def columns_named(text: str) -> list[str]:
    """Return the columns that a right-hand side of `[columns]` names, with their units."""
    several = COMBINED.fullmatch(text.strip())
    return [text] if several is None else [text, *split_parts(several["parts"])]


def refuse_combination(channel: str, how: str, num_parts: int, where: str) -> None:
    """Refuse what cannot be combined.

    Args:
        channel: Canonical name.
        how: `"mean"` or `"hottest"`.
        num_parts: Columns that are named.
        where: The line of the motor file, for the message.

    Raises:
        InputError: If the channel is none of temperature or phase current, only temperatures have
            a hottest, or fewer than two columns are named.
    """
    quantity = CHANNEL[channel].quantity
    if quantity not in ("temperature", "phase current") or (
        how == "hottest" and quantity != "temperature"
    ):
        raise InputError(
            f"Expected one column for {channel}, got {how}(…).",
            where=where,
            remedy="mean(…) is for temperatures and phase currents, hottest(…) for temperatures.",
        )
    if not 2 <= num_parts <= MOST_PARTS:
        raise InputError(
            f"Expected 2 to {MOST_PARTS} columns in {how}(…), got {num_parts}.",
            where=where,
            remedy="Write the names with commas between them, as in mean(T_U, T_V, T_W).",
        )


def combine(channel: str, how: str, parts: Sequence[np.ndarray]) -> np.ndarray:
    """Return one course for several sensors, NaN wherever one of them has no reading.

    A sensor that drops out would make the mean jump: what is left is not the same mean.

    Args:
        channel: Canonical name.
        how: `"mean"` or `"hottest"`; of currents the mean is that of the squares, as heat is.
        parts: In the channel's unit, shape (time,) each.
    """
    stacked = np.stack(parts)
    if how == "hottest":
        return np.max(stacked, axis=0)
    if CHANNEL[channel].quantity == "phase current":
        return np.sqrt(np.mean(stacked**2, axis=0))
    return np.mean(stacked, axis=0)


def known_by(sources: Sequence[UnitSource]) -> UnitSource:
    """Return how the unit of the whole is known: as badly as that of its worst part."""
    return next((one for one in ("assumed", "name") if one in sources), sources[0])  # type: ignore


def sensors_differ(channel: str, parts: Mapping[str, np.ndarray], where: str) -> Finding | None:
    """Return the finding about a sensor that departs from the others, None if none does.

    Args:
        channel: A temperature or the phase current.
        parts: Column to readings [degC or A], shape (time,) each.
        where: The file.
    """
    if len(parts) < 2:
        return None
    if CHANNEL[channel].quantity == "phase current":
        return _phase_differs(channel, parts, where)
    names, stacked = list(parts), np.stack(list(parts.values()))
    stacked = stacked[:, np.all(np.isfinite(stacked), axis=0)]
    if stacked.shape[1] == 0:
        return None
    middle = np.median(stacked, axis=0)
    rise = float(np.max(middle) - np.min(middle))
    # the 95 % quantile over time: a passing difference after a load step is none of the sensor's
    apart = np.quantile(np.abs(stacked - middle), 0.95, axis=1)
    worst = int(np.argmax(apart))
    if apart[worst] <= max(APART_K, APART_SHARE * rise):
        return None
    pair = "the two columns are" if len(names) == 2 else f"column '{names[worst]}' is"
    distance = float(2.0 * apart[worst] if len(names) == 2 else apart[worst])
    return Finding(
        "sensors_differ",
        "warning",
        f"Expected sensors of one winding or body to agree within {APART_K:g} K or "
        f"{100 * APART_SHARE:.0f} % of the rise; {pair} {distance:.1f} K apart"
        f"{'' if len(names) == 2 else ' from the others'}, with a rise of {rise:.0f} K.",
        f"{where}, {channel}",
        "Check where it sits and whether it is loose; leave it out of [columns] if so.",
        values={"apart_K": distance, "rise_K": rise},
    )


def _phase_differs(channel: str, parts: Mapping[str, np.ndarray], where: str) -> Finding | None:
    """Return the finding about a phase that reads less or more than the others agree on."""
    names, stacked = list(parts), np.stack(list(parts.values()))
    stacked = stacked[:, np.all(np.isfinite(stacked), axis=0)]
    level = (
        np.median(np.abs(stacked), axis=0) if len(names) > 2 else np.max(np.abs(stacked), axis=0)
    )
    flows = level > FLOWS * np.quantile(level, 0.99) if level.size else np.zeros(0, dtype=bool)
    if not flows.any():
        return None
    # of a few hours at most, so that a passing unbalance of a start is none of the clamp's
    share = np.median(stacked[:, flows] / level[flows], axis=1)
    off = np.abs(share - 1.0)
    worst = int(np.argmax(off))
    others = np.delete(share, worst)
    agree = len(names) == 2 or np.ptp(others) < UNBALANCE
    if off[worst] < PHASE_OFF or not agree:
        return None
    got = f"{share[worst]:.3g} of it"
    got = "nothing" if abs(share[worst]) < NOTHING else got
    is_sign = abs(share[worst] + 1.0) < UNBALANCE
    got = "the other sign" if is_sign else got
    whole = float(np.sqrt(np.mean(share**2)))
    factor = 1.0 if is_sign else float(np.sqrt(np.mean(others**2))) / whole
    rest = [name for name in names if name != names[worst]]
    line = f"mean({', '.join(rest)})" if len(rest) > 1 else rest[0]
    harm = (
        "Squares have no sign, so that the mean is right; the clamp sits the wrong way round."
        if is_sign
        else f"The mean reads {100.0 / factor**2:.0f} % of the copper loss."
    )
    return Finding(
        "sensors_differ",
        "warning" if is_sign else "error",
        f"Expected phases of one winding to carry one current; column '{names[worst]}' reads {got} "
        f"where {' and '.join(rest)} {'agree' if len(rest) > 1 else 'carries current'}. {harm}",
        f"{where}, {channel}",
        f'Check its clamp and its setting. To do without it: {channel} = "{line}" under [columns].',
        values={"share": float(share[worst]), "factor": factor},
    )
