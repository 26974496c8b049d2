"""A run as a map of ratings against speed: JSON, CSV, lines and figure."""

import io
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..errors import InputError, UsageError
from ..io.quantities import aligned, rounded
from ..io.texts import LANGUAGES, Texts
from ..io.whole_files import numbered
from ..results import to_json
from ..results.model import DerivedFigure
from ..results.values import known
from ..runs.rating_map import SHORT, Endured, Permitted, RatingMap, rating_map
from ..runs.run import certificate_of, open_run
from ..version import __version__
from .mat import write_export

COLUMNS = ("speed_rpm", "other_losses_W")
"""Columns of a file of speeds; the last may be left out, or be empty where the tests tell it."""


def export_ratings(
    run: Path,
    *,
    speeds: str | None = None,
    duties: Sequence[str] = (),
    language: str = "",
    folder: Path | None = None,
    network: str | None = None,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Write the permitted currents of a run at several speeds, and what stated loads lead to.

    Args:
        run: The run folder.
        speeds: Speeds with commas between [rpm], or a CSV file of `COLUMNS`; None for those that
            were run under load.
        duties: What is rated beside S1, as `--rating`; none for 60, 30 and 10 minutes from cold.
        language: Of the files' words; empty for that of the run's certificate.
        folder: Where the files go; None for a folder `ratings` in the run, numbered where that
            holds another export.
        network: Name of the network; None for the last one of the run.
        is_replacing: Whether another export in `folder` is replaced.

    Returns:
        As plain data: the files, the `ratings` as in the JSON file, their `table` in lines, notes
        and findings.

    Raises:
        UsageError: If the speeds are no numbers, or a duty is none.
        InputError: As `rating_map` and `write_export`.
    """
    opened = open_run(run)
    asked = None if speeds is None else read_speeds(speeds)
    found = rating_map(opened, asked, network, duties or SHORT)
    say = Texts(language or certificate_of(opened).language or LANGUAGES[0])
    title = opened.result.models[found.network].title
    limit = say.again(found.limit)
    content = {
        "about": f"heatrun export: {say('ratings')}",
        "format": "heatrun-ratings/1",
        "heatrun_version": __version__,
        "run_sha256": opened.manifest["files"]["fit.json"],
        "machine": opened.motor.name,
        "title": say.again(title),
        "network": found.network,
        "limit": limit,
        "tested_rpm": found.tested_rpm,
        "ratings": [_row(row, say) for row in found.rows],
        "stated_loads": [_endured(row, say) for row in found.endured],
    }
    table = pd.DataFrame(content["ratings"]).to_csv(index=False, lineterminator="\n")
    files = {
        "ratings.json": (to_json(content) + "\n").encode(),
        "ratings.csv": f"# {content['about']}; {limit}\n{table}".encode(),
        "ratings.png": figure(found, opened.motor.name, opened.motor.rated_current_A, say),
    }
    if found.endured:
        loads = pd.DataFrame(content["stated_loads"]).to_csv(index=False, lineterminator="\n")
        files["stated_loads.csv"] = f"# {content['about']}; {limit}\n{loads}".encode()
    places = [folder] if folder else numbered(run / "ratings")
    inputs = tuple(Path(entry["path"]) for entry in opened.manifest["inputs"])
    written = write_export(places, files, inputs, is_replacing=is_replacing)
    return {
        "files": [str(path) for path in written], "run": str(run), "order": found.network,
        "title": title, "ratings": content, "table": lines(found), "notes": [], "findings": [],
    }  # fmt: skip


def read_speeds(text: str) -> dict[float, float | None]:
    """Return speeds [rpm] with their losses other than copper [W], None where none are given.

    Raises:
        UsageError: If they are no numbers.
        InputError: If the file is no such table.
    """
    if text.lower().endswith(".csv"):
        return _of_file(Path(text))
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if not found or not all(np.isfinite(found)) or min(found) < 0.0:
        raise UsageError(f"--speeds {text!r}: expected speeds such as 1000,2000 [rpm], or a CSV.")
    return dict.fromkeys(found)


def _of_file(path: Path) -> dict[float, float | None]:
    try:
        table = pd.read_csv(path)
        numbers = table.apply(pd.to_numeric)
    except (OSError, ValueError) as error:
        raise InputError(
            f"the speeds cannot be read: {error}", where=str(path),
            remedy=f"Write a CSV file with the columns {', '.join(COLUMNS)}.",
        ) from None  # fmt: skip
    rpm = numbers.get(COLUMNS[0], pd.Series(dtype=float)).to_numpy(float)
    losses = numbers.get(COLUMNS[1], pd.Series(np.nan, numbers.index)).to_numpy(float)
    is_table = set(numbers.columns) <= set(COLUMNS) and rpm.size
    if not is_table or not np.all(np.isfinite(rpm) & (rpm >= 0.0)) or np.any(losses < 0.0):
        raise InputError(
            f"expected speeds and losses of 0 or more in the columns {', '.join(COLUMNS)}, got the "
            f"columns {', '.join(map(str, table.columns))} and {len(table)} rows.",
            where=str(path),
            remedy="Write one row for each speed.",
        )
    pairs = zip(rpm.tolist(), losses.tolist(), strict=True)
    return {n: W if np.isfinite(W) else None for n, W in pairs}


def _row(row: Permitted, say: Texts) -> Mapping[str, Any]:
    low, high = row.current.ends
    return {
        "speed_rpm": row.speed_rpm,
        "duty": row.duty,
        "current_A": row.current.median,
        "low_95_A": low,
        "high_95_A": high,
        "other_losses_W": row.other_losses_W,
        "other_losses_from": say.again(row.other_losses_from),
        **_words(row.current, say),
    }


def _words(rating: DerivedFigure, say: Texts) -> dict[str, str]:
    said = {"condition": rating.condition, "refused": rating.refused}
    return {name: say.again(known(words) or "") for name, words in said.items()}


def _endured(row: Endured, say: Texts) -> Mapping[str, Any]:
    low, high = row.found.ends
    return {
        "speed_rpm": row.speed_rpm,
        "name": row.name,
        "value": row.found.median,
        "low_95": low,
        "high_95": high,
        **_words(row.found, say),
    }


def lines(found: RatingMap) -> list[str]:
    """Return the map as lines: a heading, a row for each speed, and what lies beyond the tests."""
    by_speed: dict[float, list[Permitted]] = {}
    for row in found.rows:
        by_speed.setdefault(row.speed_rpm, []).append(row)
    duties = [row.duty for row in next(iter(by_speed.values()))]
    head = ["rpm", *(f"{duty} [A]" for duty in duties), "other losses [W]"]
    cells = [head]
    for rpm, rows in by_speed.items():
        cells.append([
            f"{rpm:.0f}",
            *(_cell(row.current) for row in rows),
            f"{rows[0].other_losses_W:.0f}, {rows[0].other_losses_from}",
        ])  # fmt: skip
    whys = dict.fromkeys(
        f"* {row.speed_rpm:.0f} rpm: {words}"
        for row, rating in (
            *((row, row.current) for row in found.rows),
            *((row, row.found) for row in found.endured),
        )
        if (words := f"refused, {why}" if (why := known(rating.refused)) else _beyond(rating))
    )
    title = f"Permitted currents at {found.limit}, rms, with 95 % intervals:"
    loads = [f"{row.speed_rpm:.0f} rpm  {row.name}: {_cell(row.found)}" for row in found.endured]
    return [title, *(f"  {line}" for line in (*aligned(cells), *loads, *whys))]


def _beyond(rating: DerivedFigure) -> str:
    _, word, rest = (known(rating.condition) or "").partition("extrapolated, ")
    return word + rest


def _cell(rating: DerivedFigure) -> str:
    if known(rating.refused):
        return "refused*"
    low, high = rating.ends
    star = "*" if _beyond(rating) else ""
    median = rounded(rating.median, 4)
    return f"{median} ({rounded(low, 4)} … {rounded(high, 4)}){star}"


def figure(found: RatingMap, machine: str, rated_A: float | None, say: Texts) -> bytes:
    """Return the map as PNG: a line for each duty with its 95 % interval.

    Args:
        found: The map.
        machine: Name of the machine.
        rated_A: Rated current [A], drawn where it is given.
        say: The texts in the language of the figure.
    """
    from matplotlib.figure import Figure

    from ..reports.figures import COLOURS, NODES

    colours = cycle((COLOURS["measured"], COLOURS["second"], NODES[0], COLOURS["first"]))
    drawn = Figure(figsize=(7.2, 4.4), layout="constrained")
    axis = drawn.add_subplot()
    duties = list(dict.fromkeys(row.duty for row in found.rows))
    has_beyond = False
    for place, (duty, colour) in enumerate(zip(duties, colours, strict=False)):
        rows = [r for r in found.rows if r.duty == duty and not known(r.current.refused)]
        if not rows:
            continue
        rpm, middle = [r.speed_rpm for r in rows], [r.current.median for r in rows]
        low, high = zip(*(r.current.ends for r in rows), strict=True)
        ends = np.abs(np.array([low, high]) - middle)
        style = ("-", "--", ":", "-.")[place // 4 % 4]
        axis.errorbar(rpm, middle, ends, color=colour, ls=style, lw=1.2, capsize=3, elinewidth=1.0,
                      label=_label(duty, say))  # fmt: skip
        for is_beyond in (False, True):
            at = [(r.speed_rpm, r.current.median) for r in rows
                  if bool(_beyond(r.current)) == is_beyond]  # fmt: skip
            face = "white" if is_beyond else colour
            axis.plot(*zip(*at, strict=True) if at else ((), ()), "o", ms=5, color=colour,
                      markerfacecolor=face)  # fmt: skip
            has_beyond = has_beyond or (is_beyond and bool(at))
    if has_beyond:
        axis.plot([], [], "o", ms=5, color="#666666", markerfacecolor="white",
                  label=say("ratings_beyond"))  # fmt: skip
    if rated_A is not None:
        axis.axhline(rated_A, color="#B00020", lw=0.9, ls="--", label=say("ratings_rated"))
    for rpm in found.tested_rpm:
        axis.axvline(rpm, color="#BBBBBB", lw=0.6, zorder=0)
    axis.set(xlabel=say("ratings_speed"), ylabel=say("ratings_current"), ylim=(0.0, None),
             title=f"{machine}: {say.again(found.limit)}")  # fmt: skip
    axis.grid(lw=0.3, axis="y")
    axis.legend(fontsize=8, frameon=False)
    stream = io.BytesIO()
    drawn.savefig(stream, format="png", dpi=150, metadata={"Software": "heatrun export: ratings"})
    return stream.getvalue()


def _label(duty: str, say: Texts) -> str:
    kind, _, minutes = duty.partition("-")
    if kind == "S2" and minutes.isdigit():
        return say("ratings_S2", duty=duty, min=minutes)
    return say("ratings_S1") if duty == "S1" else duty
