"""The type sheet: the words of `population.json`, the figure of the machines, and the PDF."""

import math
import tempfile
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font

from heatrun.io.quantities import clean, printed_unit, quantity
from heatrun.reports.figures import COLOURS, finish, plain, save
from heatrun.reports.pdf import breakable, typeset
from heatrun.reports.printed import format_value
from heatrun.results.discovery import ValueWithInterval

from ..results import (
    Assumed,
    MachineParameter,
    PopulationCovariate,
    PopulationMachine,
    PopulationNoise,
    PopulationParameter,
    PopulationResult,
)
from .law import LKJ, OUTLIER_SCALE, OUTLIER_SHARE

MOST_LISTED = 40
"""Machines of a list on the sheet; all of them stand in `population.parquet`."""

LONGEST_FOOT = 60

LARGEST_SHARE = 10.0
"""Spread or change from which on no upper limit is printed [1]."""

MANY_TIMES = 3.0
"""Value over the median from which on it is said in times and not in percent [1]."""

FEW = 10
"""Machines below which the sheet says that spreads and limits are wide for want of machines."""


def type_sheet_content(result: PopulationResult) -> dict[str, Any]:
    """Return what the sheet says."""
    names = list(result.parameters)
    main = _section(result)
    noise = _section(result.noise) if result.noise else {}
    return {
        "title": clean(result.type) or "Machines without a type",
        "foot": clean(result.type)[:LONGEST_FOOT],
        "version": f"heatrun {result.heatrun}",
        "sentence": _sentence(result),
        "is_sound": result.is_converged,
        "notes": [clean(note) for note in _notes(result)],
        "parameters": main["parameters"],
        "rule": RULE,
        "outliers": main["outliers"],
        "more_outliers": main["more"],
        "noise": noise.get("parameters", []),
        "noise_rule": NOISE_RULE if noise else "",
        "noise_outliers": noise.get("outliers", []),
        "more_noise_outliers": noise.get("more", 0),
        "covariates": [
            [clean(_covariate(label, each)), _effects(each, result)]
            for label, each in result.covariate_columns.items()
        ],
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
        "assumed": main["assumed"] + noise.get("assumed", []),
    }


def _section(part: PopulationResult | PopulationNoise) -> dict[str, Any]:
    """Return what is said alike of the parameters and of the noise."""
    odd = sorted(_outliers(part), key=lambda machine: -machine.outlier_probability)
    return {
        "parameters": [
            [
                name,
                _ranged(said.median, said.unit),
                _ranged(said.spread, said.unit) if said.transform == "linear" else
                _percent(said.spread),
                _between(said.tolerance_95_95, said),
                _between(said.next_interval_95, said),
            ]
            for name, said in part.parameters.items()
        ],
        "outliers": [_outlier(machine, part.parameters) for machine in odd[:MOST_LISTED]],
        "more": max(0, len(odd) - MOST_LISTED),
        "assumed": [
            [name, *_assumed(said, part.parameters[name])] for name, said in part.assumed.items()
        ],
    }  # fmt: skip


def _outliers(part: PopulationResult | PopulationNoise) -> list[PopulationMachine]:
    return [machine for machine in part.machines if machine.is_outlier]


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


def _ranged(entry: ValueWithInterval, unit: str) -> str:
    low, high = entry.interval_95
    half = 0.5 * (high - low)
    value, *ends = (format_value(each, half)[0] for each in (entry.value, low, high))
    return f"{quantity(value, unit)} ({ends[0]} … {ends[1]})"


def _between(ends: tuple[float, float], said: PopulationParameter) -> str:
    if not said.tells(ends):
        return "not determined"
    low, high = (format_value(end, 0.5 * (ends[1] - ends[0]))[0] for end in ends)
    return quantity(f"{low} … {high}", said.unit)


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
    what = [
        _difference(name, machine.parameters[name], parameters[name]) for name in machine.different
    ]
    return [
        clean(machine.name),
        f"{machine.outlier_probability:.2f}",
        "; ".join(what) or "no single parameter, but their combination",
    ]


def _difference(name: str, own: MachineParameter, said: PopulationParameter) -> str:
    median = said.median.value
    side = "above" if own.distance_sd > 0.0 else "below"
    if said.transform != "log" or median <= 0.0:
        off = format_value(abs(own.value - median), abs(median))[0]
        by = f"{quantity(off, said.unit)} {side}"
    elif own.value > MANY_TIMES * median:
        by = f"{own.value / median:.2g} times"
    else:
        by = f"{abs(100.0 * (own.value / median - 1.0)):.0f} % {side}"
    return f"{name} {by} the median ({abs(own.distance_sd):.0f} standard deviations)"


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
    parts = (("Changes", sure), ("Not significantly different from zero:", open_ones))
    return " ".join(f"{words} {'; '.join(names)}." for words, names in parts if names)


def _method(result: PopulationResult) -> list[list[str]]:
    share = result.outlier_share
    k = "–" if result.pareto_k is None else f"{result.pareto_k:.2f}"
    drawn = {"importance": f"importance sampling (Pareto k {k})", "emcee": "MCMC (emcee)"}
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
        ["Draws", f"{drawn[result.method]}, seed {result.seed}; "
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


ALONE, GIVEN, OTHER = "0.62", COLOURS["second"], COLOURS["first"]

PER_FIGURE = 4
"""Parameters of a figure; more make further figures."""

MOST_NAMES = 40
"""Machines whose names fit under the panels."""

MOST_MACHINES = 400
"""Machines that are drawn: more are thinned out evenly, but for those that do not fit."""

MOST_MARKED = 12
"""Names inside a panel."""

MOST_ROOM = 2.0
"""What a panel shows beyond the machines, at most, over their range [1]."""

LONGEST_NAME = 14
"""Letters of a machine's name in the figure."""


def type_figures(result: PopulationResult) -> list[Figure]:
    """Return the figures of all parameters."""
    names = list(result.parameters)
    shown = shown_machines(result.machines)
    return [
        _figure(result, names[first : first + PER_FIGURE], shown)
        for first in range(0, len(names), PER_FIGURE)
    ]


def shown_machines(machines: Sequence[PopulationMachine]) -> list[PopulationMachine]:
    """Return the machines that are drawn, in their order."""
    if len(machines) <= MOST_MACHINES:
        return list(machines)
    every = -(-len(machines) // MOST_MACHINES)
    return [m for place, m in enumerate(machines) if m.is_outlier or place % every == 0]


def _figure(
    result: PopulationResult, names: Sequence[str], shown: Sequence[PopulationMachine]
) -> Figure:
    has_names = len(shown) <= MOST_NAMES
    height_in = 1.3 * len(names) + (1.1 if has_names else 0.6)
    figure = Figure(figsize=(7.2, height_in), layout="constrained")
    axes = list(figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0])
    for axis, name in zip(axes, names, strict=True):
        _panel(axis, result, name, shown)
    place = np.arange(len(shown))
    axes[-1].set_xlim(-0.7, len(shown) - 0.3)
    if has_names:
        axes[-1].set_xticks(place, [_short(machine.name) for machine in shown], rotation=90)
    else:
        axes[-1].set_xticks([])
        axes[-1].set_xlabel("machines in the order of the fleet", fontsize=8)
    handles, words = axes[0].get_legend_handles_labels()
    figure.legend(handles, words, fontsize=7, frameon=False, ncols=5, loc="outside upper center")
    finish(axes)
    for axis in axes:
        axis.spines["right"].set_visible(False)
        axis.tick_params(labelsize=6 if has_names else 7)
    return figure


def _panel(
    axis: Axes, result: PopulationResult, name: str, shown: Sequence[PopulationMachine]
) -> None:
    said = result.parameters[name]
    low, high = said.tolerance_95_95
    axis.axhspan(low, high, color=GIVEN, alpha=0.10, lw=0, label="tolerance limits 95/95")
    axis.axhline(said.median.value, color=GIVEN, lw=0.6, alpha=0.7)
    own = [machine.parameters[name] for machine in shown]
    is_other = np.array([machine.is_outlier for machine in shown], dtype=bool)
    at = np.arange(len(shown), dtype=float)
    thick = max(0.5, min(2.2, 120.0 / len(shown)))
    apart = 0.18 if len(shown) <= 2 * MOST_NAMES else 0.0
    alone = np.array([entry.alone_interval_95 for entry in own])
    given = np.array([entry.interval_95 for entry in own])
    value = np.array([entry.value for entry in own])
    axis.vlines(
        at - apart, *alone.T, color=ALONE, lw=0.8 * thick, label="its own tests alone (95 %)"
    )
    for mask, colour, label in (
        (~is_other, GIVEN, "given all machines (95 %)"),
        (is_other, OTHER, "does not fit the type"),
    ):
        if mask.any():
            axis.vlines(at[mask] + apart, *given[mask].T, color=colour, lw=thick, label=label)
            axis.plot(at[mask] + apart, value[mask], ".", color=colour, ms=min(4.0, 2.0 + thick))
    _frame(axis, np.concatenate([given.ravel(), [low, high]]), value)
    _mark(axis, name, at + apart, value, shown)
    unit = printed_unit(said.unit)
    axis.set_ylabel(f"{plain(name)}\n[{unit}]" if unit else plain(name), fontsize=7)


def _frame(axis: Axes, ends: np.ndarray, values: np.ndarray) -> None:
    """Show the values, and of the ends of intervals what is not far off, as by a short test or too
    few machines.
    """
    low, high = float(values.min()), float(values.max())
    reach = MOST_ROOM * max(high - low, 0.1 * abs(high))
    low = max(float(ends.min()), low - reach)
    high = min(float(ends.max()), high + reach)
    room = 0.08 * (high - low) or 0.05 * abs(high) or 1.0
    axis.set_ylim(low - room, high + room)


def _mark(
    axis: Axes, name: str, at: np.ndarray, value: np.ndarray, shown: Sequence[PopulationMachine]
) -> None:
    """Write the names of the machines that differ in this parameter beside them."""
    places = [
        place for place, machine in enumerate(shown)
        if machine.is_outlier and name in machine.different
    ]  # fmt: skip
    places.sort(key=lambda place: -abs(shown[place].parameters[name].distance_sd))
    for number, place in enumerate(sorted(places[:MOST_MARKED])):
        is_left = place > 0.8 * len(shown)
        up = (number % 3 - 1) * 5  # neighbours do not hide each other's names
        axis.annotate(
            _short(shown[place].name), (at[place], value[place]),
            xytext=(-4 if is_left else 4, up), textcoords="offset points",
            ha="right" if is_left else "left", va="center", fontsize=6, color=OTHER,
        )  # fmt: skip


def _short(name: str) -> str:
    """Return a name as the figure has room and letters for it."""
    letters = "".join(c if c == " " or ord(c) in _letters() else f"U+{ord(c):04X}" for c in name)
    cut = letters if len(letters) <= LONGEST_NAME else f"{letters[: LONGEST_NAME - 1]}…"
    return plain(cut)


@cache
def _letters() -> frozenset[int]:
    """Return the letters that the figures' font can draw."""
    return frozenset(get_font(findfont("DejaVu Sans")).get_charmap())


TEMPLATE = resources.files("heatrun_fleet.population") / "type.typ"


def write_type_sheet(result: PopulationResult, path: Path) -> Path:
    """Draw the figures of a type and set its sheet as PDF, written whole or not at all."""
    content = breakable(type_sheet_content(result))
    num = len(shown_machines(result.machines))
    thinned = "" if num == len(result.machines) else (
        f" {num} of {len(result.machines)} machines are drawn, with all that do not fit."
    )  # fmt: skip
    content["caption"] = (
        "Each machine by its own tests, and given all machines of the type. Long intervals of "
        f"short tests are truncated at the frame.{thinned}"
    )
    with tempfile.TemporaryDirectory() as name:
        figures = [
            save(figure, Path(name) / f"{number:03d}.png")
            for number, figure in enumerate(type_figures(result))
        ]
        return typeset(TEMPLATE, content, figures, path)
