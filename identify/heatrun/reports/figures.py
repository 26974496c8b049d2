"""Figures of a run, drawn from its tables; nothing is computed here but differences."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from textwrap import fill

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from ..io.quantities import printed_unit
from ..io.texts import LANGUAGES, Texts
from ..io.whole_files import whole
from ..record.findings import Attempts

COLOURS = {"first": "#D55E00", "second": "#0072B2", "measured": "#222222"}
NODES = ("#009E73", "#E69F00", "#56B4E9", "#CC79A7")
"""Colours of the nodes that are simulated and not measured."""
"""Okabe and Ito's palette, which colour-blind readers can tell apart."""

MARKS = ("^", "s", "v", "D", "<", ">", "p")
"""Marks of measured bodies beside the winding."""

MEASURED = "measured_degC"
"""Column of the winding's readings."""

LIMITS_K = (1.0, 2.0, 5.0)


def draw(
    tables: Sequence[tuple[str, str, pd.DataFrame]],
    draws: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    titles: Mapping[str, str],
    certified: str,
    say: Texts,
    folder: Path,
    attempts: Attempts,
) -> list[Path]:
    """Draw all figures of a run as PNG, but for those that fail.

    Args:
        tables: Name, role and courses (`band_table`) of each test.
        draws: Posterior draws of the network's parameters by name, each of shape (draw,).
        units: Unit of each parameter.
        titles: Titles of the networks by name, the one with most nodes last.
        certified: Name of the network that the sheet states.
        say: The texts in the language of the sheet.
        folder: Where the files go.
        attempts: Told which figure failed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted: dict[str, Callable[[], Figure]] = {
        f"course_{number}.png": partial(course, *table, certified, say)
        for number, table in enumerate(tables, start=1)
    }
    if len(titles) == 2:
        wanted[f"{'_against_'.join(titles)}.png"] = partial(errors, tables, titles, say)
    if draws:
        wanted["posterior.png"] = partial(pairs, draws, units, say)
    written = [drawn(figure, folder / name, attempts) for name, figure in wanted.items()]
    return [path for path in written if path is not None]


def drawn(figure: Callable[[], Figure], path: Path, attempts: Attempts) -> Path | None:
    """Draw and save a figure; None if that failed."""
    return attempts.of("the figure", lambda: save(figure(), path), None, where=path.name)


def course(name: str, role: str, table: pd.DataFrame, network: str, say: Texts) -> Figure:
    """Return the course of one test: winding with bands, residuals, load."""
    figure = Figure(figsize=(7.2, 6.4))
    top, middle, bottom = figure.subplots(3, 1, sharex=True, height_ratios=[3.2, 1.2, 1.2])
    minutes = table["time_s"] / 60.0
    colour = COLOURS["second"]
    for kind, label, alpha in (("total", "band_noise", 0.15),
                               ("parameters", "band_parameters", 0.3)):  # fmt: skip
        ends = [table[f"{network}_{kind}_95_{side}_degC"] for side in ("low", "high")]
        top.fill_between(minutes, *ends, color=colour, alpha=alpha, lw=0, label=say(label))
    top.plot(minutes, table[f"{network}_winding_degC"], color=colour, lw=1.2, label=say("model"))
    middle.plot(minutes, table[f"{network}_residual_K"], color=colour, lw=0.9)
    top.plot(minutes, table["measured_degC"], ".", color=COLOURS["measured"], ms=2.2,
             label=say("measured_winding"))  # fmt: skip
    for number, node in enumerate(_nodes(table, network)):
        colour = NODES[number % len(NODES)]
        limits = [table[f"{network}_{node}_95_{side}_degC"] for side in ("low", "high")]
        label = say("simulated_node", node=node.replace("_", " "))
        top.fill_between(minutes, *limits, color=colour, alpha=0.2, lw=0)
        top.plot(minutes, table[f"{network}_{node}_degC"], color=colour, lw=1.1, label=label)
    for number, channel in enumerate(_bodies(table)):
        body = channel.removeprefix("measured_").removesuffix("_degC").replace("_", " ")
        top.plot(minutes, table[channel], MARKS[number % len(MARKS)], color="0.35", ms=2.4, mew=0.5,
                 mfc="none", markevery=max(1, len(table) // 120),
                 label=say("measured_node", body=body))  # fmt: skip
    top.plot(minutes, table["sink_degC"], color="0.55", lw=0.8, label=say("sink"))
    top.set_ylabel(say("temperature_degC"))
    top.set_title(f"{plain(name)} ({say(role)})", loc="left", fontsize=10, y=1.0)
    handles, words = top.get_legend_handles_labels()
    figure.legend(handles, words, fontsize=7, frameon=False, ncols=4, loc="lower center")
    middle.axhline(0.0, color="0.6", lw=0.6)
    middle.set_ylabel(say("residual_K"))
    _load(bottom, minutes, table, say)
    bottom.set_xlabel(say("time_min"))
    finish(figure.axes, say)
    num_rows = -(-len(handles) // 4)
    stack(
        figure, [top, middle, bottom], [0.27, 0.12, 0.12], below=0.52 + 0.14 * num_rows, right=0.7
    )
    return figure


def errors(
    tables: Sequence[tuple[str, str, pd.DataFrame]], titles: Mapping[str, str], say: Texts
) -> Figure:
    """Return the absolute error of two networks over time, with lines at 1, 2 and 5 K."""
    figure = Figure(figsize=(7.2, 1.0 + 1.9 * len(tables)))
    axes = np.atleast_1d(figure.subplots(len(tables), 1))
    for axis, (name, role, table) in zip(axes, tables, strict=True):
        for colour, (order, title) in zip(("first", "second"), titles.items(), strict=True):
            axis.semilogy(table["time_s"] / 60.0,
                          np.maximum(np.abs(table[f"{order}_residual_K"]), 1e-2),
                          color=COLOURS[colour], lw=0.9, label=say.again(title))  # fmt: skip
        for limit in LIMITS_K:
            axis.axhline(limit, color="0.6", lw=0.6, ls=":")
            axis.annotate(f"{limit:g} K", (1.005, limit), xycoords=("axes fraction", "data"),
                          fontsize=7, va="center")  # fmt: skip
        axis.set_ylabel(say("error_K"))
        axis.set_title(f"{plain(name)} ({say(role)})", loc="left", fontsize=9, y=1.0)
    axes[0].legend(fontsize=7, frameon=False, ncols=2, loc="lower right",
                   bbox_to_anchor=(1.0, 1.0))  # fmt: skip
    axes[-1].set_xlabel(say("time_min"))
    finish(list(axes))
    stack(figure, list(axes), [0.27, *[0.45] * (len(tables) - 1)], right=0.35)
    return figure


def _bodies(table: pd.DataFrame) -> list[str]:
    """Return the columns of measured bodies beside the winding."""
    return [c for c in map(str, table.columns) if c.startswith("measured_") and c != MEASURED]


def _nodes(table: pd.DataFrame, network: str) -> list[str]:
    """Return the unmeasured nodes of a network that a table holds."""
    head, tail = f"{network}_", "_95_low_degC"
    columns = map(str, table.columns)
    found = [c[len(head) : -len(tail)] for c in columns if c.startswith(head) and c.endswith(tail)]
    return [node for node in found if node not in ("total", "parameters")]


def pairs(draws: Mapping[str, np.ndarray], units: Mapping[str, str], say: Texts) -> Figure:
    """Return marginal and pairwise densities of the parameters."""
    names = list(draws)
    size = len(names)
    side = max(5.6, 1.0 * size)
    figure = Figure(figsize=(side, side))
    cell, gap = (1.0 - 0.9 / side) / size, GAP_IN / side
    for row, lower in enumerate(names):
        for column, left in enumerate(names[: row + 1]):
            corner = (0.8 / side + column * cell, 1.0 - 0.1 / side - (row + 1) * cell + gap)
            axis = figure.add_axes((*corner, cell - gap, cell - gap))
            if column == row:
                axis.hist(draws[left], bins=25, color=COLOURS["second"], alpha=0.7,
                          histtype="stepfilled")  # fmt: skip
                axis.set_yticks([])
            else:
                axis.hist2d(draws[left], draws[lower], bins=25, cmap="Blues", rasterized=True)
                axis.yaxis.set_major_locator(MaxNLocator(3))
            axis.xaxis.set_major_locator(MaxNLocator(3))
            for each in (axis.xaxis, axis.yaxis):
                each.set_major_formatter(Decimal(say))
            # a row and a column share their scale: it is written once
            axis.tick_params(labelsize=6, labelbottom=row == size - 1, labelleft=column == 0)
            axis.tick_params(axis="x", labelrotation=45)
            if row == size - 1:
                axis.set_xlabel(_label(left, units), fontsize=6)
            if column == 0 and row > 0:
                axis.set_ylabel(_label(lower, units), fontsize=6)
    _fix_labels(figure, TICK_LABELS_IN)
    return figure


def _label(name: str, units: Mapping[str, str]) -> str:
    unit = printed_unit(units[name])
    return f"{name}\n[{unit}]" if unit else name


def _load(axis: Axes, minutes: pd.Series, table: pd.DataFrame, say: Texts) -> None:
    second = axis
    if table["phase_current_A"].notna().any():
        axis.plot(minutes, table["phase_current_A"], color="#CC79A7", lw=0.9)
        axis.set_ylabel(say("current_A"), color="#CC79A7")
        second = axis.twinx()
    second.plot(minutes, table["losses_W"], color="#555555", lw=0.8)
    second.set_ylabel(say("losses_W"), color="#555555")


class Decimal(ScalarFormatter):
    """Numbers at an axis with the decimal sign of a language."""

    def __init__(self, say: Texts) -> None:
        super().__init__()
        self._say = say

    def __call__(self, x: float, pos: int | None = None) -> str:
        """As `ScalarFormatter`."""
        return self._say.number(super().__call__(x, pos))


def finish(axes: Sequence[Axes], say: Texts | None = None) -> None:
    """Give axes the look of all figures of a sheet, and numbers the decimal sign of a language."""
    for axis in axes:
        if say is not None:
            axis.set_xlabel(axis.get_xlabel(), fontsize=8.5)
            axis.set_ylabel(axis.get_ylabel(), fontsize=8.5)
            axis.xaxis.set_major_formatter(Decimal(say))
            axis.yaxis.set_major_formatter(Decimal(say))
        axis.tick_params(labelsize=8)
        axis.spines["top"].set_visible(False)


BESIDE_CHARACTERS = 16
"""Characters of 8 pt that a label of several lines has room for beside a low panel."""


def again(figure: Figure, say: Texts) -> Figure:
    """Return a figure whose labels were English with labels and numbers in a language."""
    if say.language == LANGUAGES[0]:
        return figure
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        said = say.again(" ".join(text.get_text().split()))
        if "\n[" in text.get_text():
            said = said.replace(" [", "\n[")
        elif "\n" in text.get_text():
            said = fill(said, BESIDE_CHARACTERS)
        text.set_text(said)
    lines = max((axes.get_ylabel().count("\n") + 1 for axes in figure.axes), default=1)
    _move_right(figure, LINE_IN * max(0, lines - LEFT_LINES))
    for axis in (each for axes in figure.axes for each in (axes.xaxis, axes.yaxis)):
        if type(axis.get_major_formatter()) is ScalarFormatter:
            axis.set_major_formatter(Decimal(say))
    return figure


def _move_right(figure: Figure, room_in: float) -> None:
    """Leave more room [in] to the left of all panels; their right edges stay."""
    shift = room_in / figure.get_size_inches()[0]
    for axis in figure.axes if shift else ():
        place = axis.get_position()
        axis.set_position((place.x0 + shift, place.y0, place.width - shift, place.height))


TICK_LABELS_IN = 0.46
"""Room for the numbers beside an axis [in]."""

GAP_IN = 0.12
"""Room between two panels that share an axis [in]."""


def stack(
    figure: Figure,
    axes: Sequence[Axes],
    above: Sequence[float],
    *,
    below: float = 0.42,
    right: float = 0.12,
) -> None:
    """Give panels under each other their places: to try which suit takes longer than to draw.

    Args:
        figure: The figure.
        axes: The panels, of one grid, whose ratios their heights keep.
        above: Room above each [in].
        below: Room below the last [in].
        right: Room to the right [in].
    """
    width, height = figure.get_size_inches()
    grid = axes[0].get_gridspec()
    ratios = np.ones(len(axes)) if grid is None else np.asarray(grid.get_height_ratios())
    tall = (height - below - sum(above)) * ratios / np.sum(ratios)
    foot = height - np.cumsum(above) - np.cumsum(tall)
    for axis, low, each in zip(axes, foot, tall, strict=True):
        axis.set_position(
            (LEFT_IN / width, low / height, 1 - (LEFT_IN + right) / width, each / height)
        )
    _fix_labels(figure, 0.27)


def _fix_labels(figure: Figure, below: float) -> None:
    """Put the labels of all axes as far from them [in] as numbers need, which are not measured."""
    width, height = figure.get_size_inches()
    for axis in figure.axes:
        beside = TICK_LABELS_IN / (width * axis.get_position().width)
        is_left = axis.yaxis.get_label_position() == "left"
        axis.yaxis.set_label_coords(-beside if is_left else 1.0 + beside, 0.5)
        axis.xaxis.set_label_coords(0.5, -below / (height * axis.get_position().height))


LEFT_IN, LEFT_LINES, LINE_IN = 0.8, 2, 0.14
"""Room for numbers and a label of so many lines to the left, and that of one line more [in]."""


def plain(name: str) -> str:
    """Return a name in which matplotlib sees no mathematics and no control characters."""
    clean = "".join(c if c.isprintable() else "?" for c in name)
    return clean.replace("$", r"\$")[:90]


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, whole or not at all."""
    figure.set_dpi(160)
    with whole(path) as partial:
        # `savefig` would draw it twice
        FigureCanvasAgg(figure).print_png(partial, metadata={"Software": None})
    return path


LIMIT_COLOUR = "#B00020"

MOST_MARKS = 150
"""Marks of readings; more hide the line behind them."""


def certificate_figure(
    name: str,
    table: pd.DataFrame,
    network: tuple[str, str],
    limits: Sequence[tuple[str, float]],
    say: Texts,
    aspect: float,
) -> Figure:
    """Return the course of one test as a customer reads it, with the residuals below.

    Args:
        name: The test.
        table: Its courses (`heatrun.runs.write.band_table`).
        network: Whose prediction is drawn, and its title.
        limits: Of the insulation, in words, and their temperatures [degC], at most two, the one
            that decides first.
        say: The texts in the language of the sheet.
        aspect: Height over width [1].
    """
    order, title = network
    figure = Figure(figsize=(7.2, 7.2 * aspect))
    axis, below = figure.subplots(2, 1, sharex=True, height_ratios=[3.4, 1.0])
    minutes = table["time_s"] / 60.0
    low, high = (table[f"{order}_total_95_{side}_degC"] for side in ("low", "high"))
    band = axis.fill_between(minutes, low, high, color=COLOURS["second"], alpha=0.25, lw=0)
    marks = {"color": COLOURS["measured"], "mfc": "none", "mew": 0.6, "ms": 3.0}
    every = max(1, len(table) // MOST_MARKS)
    (measured,) = axis.plot(minutes, table["measured_degC"], "o", **marks, markevery=every)
    predicted = table[f"{order}_winding_degC"]
    (model,) = axis.plot(minutes, predicted, color=COLOURS["second"], lw=1.2)
    (sink,) = axis.plot(minutes, table["sink_degC"], color="0.55", lw=0.8)
    handles = [measured, model, band, sink]
    words = [say("measured_winding"), say("model_named", network=title), say("band"), say("sink")]
    for (text, degC), style in zip(limits, ("--", ":"), strict=False):
        handles.append(axis.axhline(degC, color=LIMIT_COLOUR, lw=1.0, ls=style))
        words.append(text)
    below.fill_between(
        minutes, low - predicted, high - predicted, color=COLOURS["second"], alpha=0.25, lw=0
    )
    below.axhline(0.0, color=COLOURS["second"], lw=1.2)
    below.plot(minutes, table[f"{order}_residual_K"], color=COLOURS["measured"], lw=0.7)
    below.set_ylabel(say("residual_short_K"))
    below.set_xlabel(say("time_min"))
    axis.set_ylabel(say("temperature_degC"))
    axis.margins(x=0.01)
    axis.set_title(plain(name), loc="left", fontsize=9, y=1.0)
    columns = 5 if len(handles) <= 5 else 3
    figure.legend(
        handles, words, fontsize=7.5, frameon=False, ncols=columns, loc="lower center",
        columnspacing=1.2, handlelength=1.6,
    )  # fmt: skip
    finish([axis, below], say)
    stack(figure, [axis, below], [0.25, GAP_IN], below=0.72 if columns == 5 else 0.86)
    for each in (axis, below):
        _fit_label(each, 7.2 * aspect)
    return figure


CHARACTER_IN = 0.058
"""Width of a character of a label [in], about."""


def _fit_label(axis: Axes, height_in: float) -> None:
    """Break the label beside a low panel before its unit; of a lower one the words go inside."""
    label, room_in = axis.yaxis.label, height_in * axis.get_position().height
    words = label.get_text()
    if CHARACTER_IN * len(words) > room_in:
        label.set_text(words.replace(" [", "\n["))
    name, _, unit = words.rpartition(" [")
    if CHARACTER_IN * len(name) > room_in:
        label.set_text(f"[{unit}")
        axis.text(0.005, 0.96, name, transform=axis.transAxes, fontsize=7, va="top")
