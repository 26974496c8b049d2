"""The words of a type sheet, from what stands in `population.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import UnsetType

from heatrun.io.quantities import clean, quantity, with_breaks
from heatrun.reports.printed import format_value
from heatrun.results.discovery import ValueWithInterval

from ..results.population import (
    Assumed,
    PopulationCovariate,
    PopulationMachine,
    PopulationNoise,
    PopulationParameter,
    PopulationResult,
)
from .law import LKJ, OUTLIER_SCALE, OUTLIER_SHARE

BREAKS_EVERY = 15
"""Letters of a long word after which it may break."""

MOST_LISTED = 40
"""Machines of a list on the sheet; all of them stand in `population.parquet`."""

LONGEST_FOOT = 60

TOO_FAR = 20.0
"""Upper over lower limit from which on a parameter counts as not determined [1]."""

LARGEST_SHARE = 10.0
"""Spread or change from which on no upper limit is printed [1]."""

MANY_TIMES = 3.0
"""Value over the median from which on it is said in times and not in percent [1]."""

FEW = 10
"""Machines below which the sheet says that spreads and limits are wide for want of machines."""


def type_sheet_content(result: PopulationResult) -> dict[str, Any]:
    """Return what the sheet says.

    Args:
        result: The population.
    """
    names = list(result.parameters)
    return _breakable(
        {
            "title": clean(result.type) or "Machines without a type",
            "foot": clean(result.type)[:LONGEST_FOOT],
            "version": f"heatrun {result.heatrun}",
            "sentence": _sentence(result),
            "is_sound": result.is_converged,
            "notes": [clean(note) for note in _notes(result)],
            "parameters": [_parameter(name, said) for name, said in result.parameters.items()],
            "rule": RULE,
            "outliers": [
                _outlier(each, result.parameters) for each in _outliers(result)[:MOST_LISTED]
            ],
            "more_outliers": max(0, len(_outliers(result)) - MOST_LISTED),
            **_noise(result.noise),
            "covariates": _covariates(result),
            "correlation_head": names,
            "correlation": [
                [name, *(f"{each:.2f}" for each in row)]
                for name, row in zip(names, result.correlation, strict=True)
            ],
            "left_out": [
                [clean(each.name), clean(each.reason)] for each in result.left_out[:MOST_LISTED]
            ],
            "more_left_out": max(0, len(result.left_out) - MOST_LISTED),
            "method": _method(result),
            "assumed": [
                [name, *_assumed(said, result.parameters[name])]
                for name, said in result.assumed.items()
            ]
            + ([
                [name, *_assumed(said, result.noise.parameters[name])]
                for name, said in result.noise.assumed.items()
            ] if result.noise else []),
        }
    )  # fmt: skip


RULE = (
    "Median and spread: with their 95 % intervals. Spread: standard deviation from machine to "
    "machine. Tolerance limits: at 95 % confidence, 95 % of the machines of the type lie between "
    "them; machines that do not fit are left aside. Next machine: 95 % interval before its first "
    "test; it may be one that does not fit."
)


NOISE_RULE = (
    "Noise of the winding's readings: its slow part, the correlation time of that, and its white "
    "part (of a mean over 20 s); and the heat that the network misses (its standard deviation over "
    "the mean loss). A population of its own: noise of another kind is a matter of the bench, and "
    "heat of another size one of the network or the instruments. The next machine takes the "
    "prior of this heat from here."
)


def _noise(noise: PopulationNoise | UnsetType) -> dict[str, Any]:
    """Return the section on noise and unmodelled heat; empty lists where they are not known."""
    if not noise:
        return {"noise": [], "noise_rule": "", "noise_outliers": [], "more_noise_outliers": 0}
    odd = _outliers(noise)
    return {
        "noise": [_parameter(name, said) for name, said in noise.parameters.items()],
        "noise_rule": NOISE_RULE,
        "noise_outliers": [_outlier(each, noise.parameters) for each in odd[:MOST_LISTED]],
        "more_noise_outliers": max(0, len(odd) - MOST_LISTED),
    }


def _outliers(result: PopulationResult | PopulationNoise) -> list[PopulationMachine]:
    """Return the machines that do not fit, the surest first."""
    found = [machine for machine in result.machines if machine.is_outlier]
    return sorted(found, key=lambda machine: -machine.outlier_probability)


def _sentence(result: PopulationResult) -> str:
    parts = [f"{result.num_machines} machines count"]
    fleet, network = (clean(result.source.get(key, "")) for key in ("fleet", "network"))
    if fleet:
        parts[0] += f" of the fleet {fleet}"
    if network:
        parts[0] += f" (network: {network})"
    parts.append(f"{len(result.left_out)} left out" if result.left_out else "none left out")
    num = len(_outliers(result))
    fits = "all of them fit the type"
    if num:
        fits = f"{num} of them {'does' if num == 1 else 'do'} not fit the type"
    return f"{parts[0]}, {parts[1]}; {fits}."


def _notes(result: PopulationResult) -> list[str]:
    notes = list(result.notes)
    if result.num_machines < FEW:
        notes.append(
            f"{result.num_machines} machines say little of a spread: its interval and the "
            "tolerance limits are wide for want of machines."
        )
    doubtful = [each.name for each in result.machines if each.clipped > 0.1]
    if doubtful:
        more = f" and {len(doubtful) - 3} more" if len(doubtful) > 3 else ""
        notes.append(
            f"The posterior of {', '.join(doubtful[:3])}{more} is wider than its prior in some "
            "direction: take their rows with caution."
        )
    return notes


def _parameter(name: str, said: PopulationParameter) -> list[str]:
    return [
        name,
        _ranged(said.median, said.unit),
        spread_words(said),
        _between(said.tolerance_95_95, said),
        _between(said.next_interval_95, said),
    ]


def spread_words(said: PopulationParameter) -> str:
    """Return the spread over machines as it is printed: a percentage, or in the unit."""
    if said.transform == "linear":
        return _ranged(said.spread, said.unit)
    return _percent(said.spread)


def _ranged(entry: ValueWithInterval, unit: str) -> str:
    low, high = entry.interval_95
    half = 0.5 * (high - low)
    value, *ends = (format_value(each, half)[0] for each in (entry.value, low, high))
    return f"{quantity(value, unit)} ({ends[0]} … {ends[1]})"


def _between(ends: Sequence[float], said: PopulationParameter) -> str:
    low, high = ends
    unit = said.unit
    if said.transform == "log" and high > TOO_FAR * low:
        return "not determined"
    half = 0.5 * (high - low)
    texts = [format_value(end, half)[0] for end in ends]
    return quantity(f"{texts[0]} … {texts[1]}", unit)


def _percent(entry: ValueWithInterval, *, is_signed: bool = False) -> str:
    low, high = entry.interval_95
    if high > LARGEST_SHARE:
        return f"{100.0 * entry.value:.0f} % (from {100.0 * low:.0f} % on)"
    half = 50.0 * (high - low)

    def printed(value: float) -> str:
        text = format_value(100.0 * value, half)[0]
        return f"+{text}" if is_signed and float(text) > 0.0 else text

    return f"{printed(entry.value)} % ({printed(low)} … {printed(high)})"


def _outlier(
    machine: PopulationMachine, parameters: Mapping[str, PopulationParameter]
) -> list[str]:
    what = [_difference(name, machine, parameters) for name in machine.different]
    return [
        clean(machine.name),
        f"{machine.outlier_probability:.2f}",
        "; ".join(what) or "no single parameter, but their combination",
    ]


def _difference(
    name: str, machine: PopulationMachine, parameters: Mapping[str, PopulationParameter]
) -> str:
    own, said = machine.parameters[name], parameters[name]
    far = own.distance_sd
    side = "above" if far > 0.0 else "below"
    median = said.median.value
    if said.transform == "log" and median > 0.0 and own.value > MANY_TIMES * median:
        times = own.value / median
        return f"{name} {times:.2g} times the median ({abs(far):.0f} standard deviations)"
    if said.transform == "log" and median > 0.0:
        by = f"{abs(100.0 * (own.value / median - 1.0)):.0f} %"
    else:
        by = quantity(format_value(abs(own.value - median), abs(median))[0], said.unit)
    return f"{name} {by} {side} the median ({abs(far):.0f} standard deviations)"


def _covariates(result: PopulationResult) -> list[list[str]]:
    return [
        [clean(_covariate(label, each)), _effects(each, result)]
        for label, each in result.covariate_columns.items()
    ]


def _covariate(label: str, said: PopulationCovariate) -> str:
    if said.kind == "category":
        return f"{said.column}: {said.unit} against {said.reference}"
    return f"{said.column}, from {said.first} to {said.last}"


def _effects(said: PopulationCovariate, result: PopulationResult) -> str:
    """Return what a covariate does, in plain words: those that are sure first."""
    sure, open_ones = [], []
    for name, entry in said.over_range.items():
        low, high = entry.interval_95
        parameter = result.parameters[name]
        is_log = parameter.transform == "log"
        size = _percent(entry, is_signed=True) if is_log else _ranged(entry, parameter.unit)
        is_sure = low > 0.0 or high < 0.0
        (sure if is_sure else open_ones).append(f"{name} {size}")
    parts = []
    if sure:
        parts.append(f"Changes {'; '.join(sure)}.")
    if open_ones:
        parts.append(f"Not significantly different from zero: {'; '.join(open_ones)}.")
    return " ".join(parts)


def _method(result: PopulationResult) -> list[list[str]]:
    share = result.outlier_share
    drawn = {
        "importance": f"importance sampling (Pareto k {_number(result.pareto_k)})",
        "emcee": "MCMC (emcee)",
    }[result.method]
    return [
        ["Method", "Two stages (Lunn et al. 2013): each machine is calibrated by itself; its "
         "posterior as a normal law, with the prior of its calibration divided out, is the datum "
         "of the second stage. So a short test borrows from the other machines and does not "
         "outweigh them."],
        ["Law", "The parameters of a machine are normal about the type's mean, shifted by the "
         "covariates, with a covariance that all machines share; for resistances and capacities "
         "their logarithms are. A machine that does not fit follows the same law, "
         f"{OUTLIER_SCALE:.0f} times as wide; {100 * share.value:.1f} % "
         f"({100 * share.interval_95[0]:.1f} … {100 * share.interval_95[1]:.1f}) of the type are "
         "such. A machine is called one where that is more probable than not; a parameter is named "
         "where it is more than 3 standard deviations from what is expected."],
        ["Draws", f"{drawn}, seed {result.seed}; "
         f"{'converged' if result.is_converged else 'NOT converged: intervals are indicative'}."],
        ["Assumed", f"Share of machines that do not fit: logistic-normal with median "
         f"{100 * OUTLIER_SHARE:.0f} % (0.4 … 19 %). Correlations: LKJ({LKJ:.0f}). Medians, "
         "spreads and covariates as in the table below."],
        ["Limits", "Errors of instruments that all machines share are not averaged out: each "
         "calibration takes its own as unknown, and what the bench's meters have in common shifts "
         "all machines alike. Median, limits and the next machine hold for the covariates' mean."],
    ]  # fmt: skip


def _assumed(said: Assumed, parameter: PopulationParameter) -> list[str]:
    unit = parameter.unit
    if parameter.transform == "linear":
        texts = [format_value(value, said.spread)[0]
                 for value in (said.mean, said.mean_sd, said.spread, said.effect_sd)]  # fmt: skip
        centre, *widths = (quantity(text, unit) for text in texts)
        return [f"{centre} ± {widths[0]} (sd)", widths[1], f"± {widths[2]} (sd)"]
    factor = math.exp(1.96 * said.mean_sd)
    centre = format_value(said.mean, 0.02 * abs(said.mean))[0]
    return [
        f"{quantity(centre, unit)}, to a factor of {factor:.0f}",
        f"{100 * said.spread:.0f} % (median; half-Cauchy)",
        f"± {100 * said.effect_sd:.0f} % (sd)",
    ]


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _breakable(value: Any) -> Any:
    """Return texts whose long words may break, at any depth of lists and objects."""
    if isinstance(value, str):
        return with_breaks(value, BREAKS_EVERY)
    if isinstance(value, dict):
        return {key: _breakable(item) for key, item in value.items()}
    return [_breakable(item) for item in value] if isinstance(value, list) else value
