"""Several sensors of one channel: the course that they make, and one that departs from the rest."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from .channels import CHANNEL
from .record import Finding, UnitSource
from .stretch import runs

APART_K, APART_SHARE = 5.0, 0.2
"""A sensor this far from the median of the others, and by this share of their rise [1], is loose or
elsewhere: phases of one winding differ by a few kelvin."""

OFF_SHARE = 0.5
"""And by this one it is off, and what is made of all of them shows no winding."""

FLOWS = 0.2
"""In parts of the largest current [1]: below, offsets of the clamps decide."""

UNBALANCE, PHASE_OFF, NOTHING = 0.1, 0.2, 0.02
"""Phases of a balanced machine agree to this share [1]; one that differs by the second is its
clamp's, its range's or its winding's; one below the third is dead."""

SPAN_SAMPLES, MOST_SPANS, MOSTLY = 10, 48, 0.9
"""Phases are compared in spans of so many samples under load at least, and so many spans at most;
one that differs in more than the share of them [1] always did."""


def combine(channel: str, how: str, parts: Sequence[np.ndarray]) -> np.ndarray:
    """Return one course for several sensors [unit of the channel], shape (time,) each.

    It is their `"mean"`, of currents that of the squares, as heat is, what is `"hottest"`, or the
    `"sum"`. It is NaN wherever one of them has no reading: what is left is not the same mean.
    """
    stacked = np.stack(parts)
    if how == "hottest":
        return np.max(stacked, axis=0)
    if how == "sum":
        return np.sum(stacked, axis=0)
    if CHANNEL[channel].quantity == "phase current":
        return np.sqrt(np.mean(stacked**2, axis=0))
    return np.mean(stacked, axis=0)


def known_by(sources: Sequence[UnitSource]) -> UnitSource:
    """Return how the unit of the whole is known: as badly as that of its worst part."""
    return next((one for one in ("assumed", "name") if one in sources), sources[0])  # type: ignore


def sensors_differ(
    channel: str, parts: Mapping[str, np.ndarray], time_s: np.ndarray, where: str
) -> Finding | None:
    """Return the finding about a sensor that departs from the others, None if none does.

    `parts` are the readings [degC or A] of each column, `time_s` their times [s], shape (time,).
    """
    if len(parts) < 2 or CHANNEL[channel].quantity == "power":  # parts of a sum may differ
        return None
    names, stacked = list(parts), np.stack(list(parts.values()))
    known = np.all(np.isfinite(stacked), axis=0)
    if not known.any():
        return None
    stacked = stacked[:, known]
    if CHANNEL[channel].quantity == "phase current":
        return _phase_differs(channel, names, stacked, time_s[known], where)
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
        "error" if apart[worst] > OFF_SHARE * rise else "warning",
        f"Expected sensors of one winding or body to agree within {APART_K:g} K or "
        f"{100 * APART_SHARE:.0f} % of the rise; {pair} {distance:.1f} K apart"
        f"{'' if len(names) == 2 else ' from the others'}, with a rise of {rise:.0f} K.",
        f"{where}, {channel}",
        "Check where it sits and whether it is loose. To do without it: "
        f'{channel} = "{_mean_without(names, worst) or "COLUMN"}" under [columns].',
        values={"apart_K": distance, "rise_K": rise},
    )


def _mean_without(names: Sequence[str], place: int) -> str:
    """Return the line for the others of three columns or more, empty for two."""
    rest = [name for name in names if name != names[place]]
    return f"mean({', '.join(rest)})" if len(rest) > 1 else ""


def _phase_differs(
    channel: str, names: Sequence[str], stacked: np.ndarray, time_s: np.ndarray, where: str
) -> Finding | None:
    """Return the finding about a phase that reads otherwise than the others agree on."""
    size = np.abs(stacked)
    largest = np.max(size, axis=0)
    flows = largest > FLOWS * np.quantile(largest, 0.99)
    if not flows.any():
        return None
    typical = np.median(size[:, flows] / largest[flows], axis=1)
    if len(names) > 2 and np.sum(np.less(typical, NOTHING)) == len(names) - 1:
        lone = names[int(np.argmax(typical))]
        rest = " and ".join(name for name in names if name != lone)
        return Finding(
            "sensors_differ",
            "error",
            f"Expected phases of one winding to carry one current; {rest} read nothing where "
            f"column '{lone}' carries current, and what flows in must flow out. The mean reads "
            f"{100.0 / len(names):.0f} % of the copper loss.",
            f"{where}, {channel}",
            f'Check the clamps and what they measure. To do without them: {channel} = "{lone}" '
            "under [columns].",
            values={"factor": len(names) ** 0.5},
        )
    level = np.median(size, axis=0) if len(names) > 2 else largest
    top = np.quantile(level, 0.99)
    flows = level > FLOWS * top
    if not flows.any():
        return None
    time_s, ratio, level = time_s[flows], stacked[:, flows] / level[flows], level[flows]
    sizes = np.abs(np.median(ratio, axis=1))
    if np.max(np.abs(sizes - 1.0)) >= PHASE_OFF:  # a sign does no harm to the mean, this does
        ratio = np.abs(ratio)
    # below half load an offset of the clamps counts less
    far = np.abs(ratio - 1.0) * np.minimum(2.0 * level / top, 1.0)
    num_spans = int(np.clip(level.size // SPAN_SAMPLES, 1, MOST_SPANS))
    edges = np.linspace(0, level.size, num_spans + 1).astype(int)
    spans = [slice(a, b) for a, b in itertools.pairwise(edges)]
    share = np.array([np.median(ratio[:, span], axis=1) for span in spans])
    away = np.array([np.median(far[:, span], axis=1) for span in spans])
    worst = int(np.argmax(np.sum(away >= PHASE_OFF, axis=0)))
    others = np.delete(share, worst, axis=1)
    is_off = (away[:, worst] >= PHASE_OFF) & (np.argmax(away, axis=1) == worst)
    is_off &= (len(names) == 2) | (np.ptp(others, axis=1) < UNBALANCE)
    first, past = runs(is_off)
    # a passing unbalance is none of the clamp's; what lasts to the end may have just begun
    lasting = (past - first > 1) | (past == num_spans)
    if not lasting.any():
        return None
    begin, end = int(first[lasting][0]), int(past[lasting][-1])
    is_whole = bool(np.mean(is_off) > MOSTLY)
    at = edges[max(begin - 1, 0)]
    fine = np.flatnonzero(far[worst, at : edges[begin + 1]] < PHASE_OFF)
    at += int(fine[-1]) + 1 if fine.size else 0
    until = edges[end] - 1
    if end < num_spans:
        fine = np.flatnonzero(far[worst, edges[end - 1] : edges[end + 1]] < PHASE_OFF)
        until = edges[end - 1] + fine[0] - 1 if fine.size else until
    from_s, to_s = float(time_s[min(at, time_s.size - 1)]), float(time_s[until])
    share, others = np.median(share[is_off], axis=0), np.median(others[is_off], axis=0)
    is_sign = abs(share[worst] + 1.0) < UNBALANCE
    got = "nothing" if abs(share[worst]) < NOTHING else f"{share[worst]:.3g} of it"
    got = "the other sign" if is_sign else got
    since = f" until {to_s:.0f} s" if end < num_spans else " on"
    got += "" if is_whole else f" from {from_s:.0f} s{since}"
    whole = float(np.sqrt(np.mean(share**2)))
    factor = 1.0 if is_sign else float(np.sqrt(np.mean(others**2))) / whole
    rest = [name for name in names if name != names[worst]]
    line = _mean_without(names, worst) or rest[0]
    harm = (
        "Squares have no sign, so that the mean is right; the clamp sits the wrong way round."
        if is_sign
        else f"The mean reads {100.0 / factor**2:.0f} % of the copper loss."
    )
    span = {} if is_whole else {"from_s": from_s, "to_s": to_s}
    return Finding(
        "sensors_differ",
        "warning" if is_sign else "error",
        f"Expected phases of one winding to carry one current; column '{names[worst]}' reads {got} "
        f"where {' and '.join(rest)} {'agree' if len(rest) > 1 else 'carries current'}. {harm}",
        f"{where}, {channel}",
        f'Check its clamp and its setting. To do without it: {channel} = "{line}" under [columns].',
        values={"share": float(share[worst]), "factor": factor, **span},
    )
