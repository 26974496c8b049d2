"""Run folders that the page can show: results, bands, and files, from inside their folder alone.

`run_view` is a run on the page: what it says, its figures, its files.
"""

import io
import os
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd
import panel as pn

from heatrun.errors import InputError
from heatrun.results import DiscoveryResult, FitResult
from heatrun.runs.run import Run as OpenedRun
from heatrun.runs.run import course_name, open_run
from heatrun.runs.run_folder import MANIFEST

from .fleets import MACHINES
from .gate import is_inside, read_inside
from .linked import Band
from .look import WIDE, stacked, text_pane
from .store import Opened, Stamp
from .words import error_message, message, problem

DOWNLOADS = ("sheet.pdf", "sheet.xlsx", "sheet.json", "fit.json", "discovery.pdf", "discovery.json")
"""Files of a run that the page hands out."""

MAX_BYTES = 200_000_000
"""Largest file of a run that is read [byte]; it goes to the browser as one message."""

MAX_FIGURES = 100
MAX_RUNS = 500


@dataclass(frozen=True)
class Run:
    """A whole run folder; outside the folder that is shown or that runs go to nothing is read."""

    path: Path
    root: Path

    @property
    def discovery(self) -> DiscoveryResult | None:
        """What `heatrun discover` found, or None."""
        try:
            return None if self.opened is None else self.opened.discovery
        except (ValueError, LookupError, TypeError, RecursionError):  # InputError too
            return None

    @property
    def calibration(self) -> FitResult | None:
        """What `heatrun calibrate` found, or None."""
        return None if self.opened is None else self.opened.result

    @property
    def opened(self) -> OpenedRun | None:
        """The run with its model and its draws; None if it is damaged."""
        return _opened(self.path, self.root, self.stamp)

    @property
    def stamp(self) -> Stamp:
        """State of the run's manifest: another one means another run under the same name."""
        return Stamp.of(self.path / MANIFEST)

    def read(self, path: Path, max_bytes: int = MAX_BYTES) -> bytes:
        """Return the content of a file of the run.

        Raises:
            InputError: If it is none, is too large or lies elsewhere.
        """
        return read_inside(self.root, path, max_bytes)

    def figures(self) -> list[Path]:
        """Return the figures, those of the discovery first."""
        folders = [self.path / "discovery", self.path / "figures"]
        found = [file for folder in folders for file in sorted(folder.glob("*.png"))]
        return [file for file in found if is_inside(self.root, file)][:MAX_FIGURES]

    def downloads(self) -> list[Path]:
        """Return the files that the page hands out."""
        courses = sorted(self.path.glob("course_*.csv"))
        named = [self.path / name for name in DOWNLOADS]
        return [path for path in [*named, *courses] if is_inside(self.root, path)]

    def bands(self, tests: Sequence[Opened]) -> list[Band]:
        """Return the predicted courses of those tests that the run has seen.

        A test is the same if its file's digest is; the last network counts where there are two.
        """
        result = self.calibration
        if result is None:
            return []
        found = []
        for number, entry in enumerate(result.tests, start=1):
            for opened in tests:
                if entry.sha256 == opened.record.sources[0].sha256:
                    band = self.band(number, opened.record.name)
                    found += [band] if band else []
        return found

    def band(self, number: int, test: str) -> Band | None:
        """Return the predicted course of the last network for a test of the run, counted from 1;
        None where there is none.
        """
        if self.opened is None:
            return None
        order = self.opened.networks[-1]
        courses = (f"{order}_{part}_degC" for part in ("winding", "total_95_low", "total_95_high"))
        try:
            table = pd.read_csv(io.BytesIO(self.read(self.path / course_name(number))))
            time_s, median, low, high, measured = (
                table[name].to_numpy(float) for name in ("time_s", *courses, "measured_degC")
            )
        except (OSError, ValueError, LookupError):  # damaged
            return None
        label = f"simulated, 95 % ({order}) · {test}"
        return Band(label, time_s, median, low, high, test, measured)


def runs_under(places: Sequence[tuple[Path, Path]]) -> list[Run]:
    """Return the runs directly in some folders, each with the one that it must lie in, the youngest
    first.
    """
    found = {
        Run(path.parent.resolve(), root.resolve())
        for folder, root in places
        if folder.is_dir()
        for path in folder.glob(f"*/{MANIFEST}")
        if is_inside(root.resolve(), path) and not (path.parent / MACHINES).exists()
    }
    return sorted(found, key=lambda run: run.stamp.changed_ns, reverse=True)[:MAX_RUNS]


def last_motor(runs: Sequence[Run], motors: Mapping[str, Path]) -> str | None:
    """Return the name of the motor file that was used last; None where no run used any of them.

    The youngest run comes first. A run keeps the path that it was given, which may be relative to
    another folder than the present one.
    """
    for run in runs:
        result = run.calibration
        given = Path(os.path.normpath(result.motor.path)).parts if result else ()
        used = tuple(part for part in given if part != "..")
        for name, path in motors.items():
            if used and path.parts[-len(used) :] == used:
                return name
    return None


@lru_cache(maxsize=256)
def _opened(path: Path, root: Path, stamp: Stamp) -> OpenedRun | None:
    """Return a run, checked and parsed once for as long as the manifest stays."""
    try:
        return open_run(path, lambda file: read_inside(root, file, MAX_BYTES))
    except InputError:
        return None


def download(path: Path, root: Path, *, width: int) -> pn.widgets.FileDownload:
    """Return a button that hands out a file; outside the root nothing is read."""

    def content() -> io.BytesIO:
        try:
            return io.BytesIO(read_inside(root, path, MAX_BYTES))
        except InputError as error:
            button.label = f"{path.name} cannot be read"
            return io.BytesIO(f"{error}\n".encode(errors="backslashreplace"))

    button = pn.widgets.FileDownload(
        callback=content, filename=path.name, label=path.name, button_type="default", width=width
    )
    return button


R = TypeVar("R")

FIGURE_PX = 860

MAX_FIGURE_BYTES = 20_000_000

PNG = b"\x89PNG\r\n\x1a\n"
"""First bytes of a PNG."""


def run_view(
    run: Run,
    read: Callable[[Run], R | None],
    verdict: Callable[[R], str],
    say: Callable[[R], str],
    what: str,
    figure: Any,
) -> pn.Column:
    """Return a column with result, downloads and figures of a run.

    Args:
        run: The run folder.
        read: Returns its result, None if it has none or it is damaged.
        verdict: Returns its verdict.
        say: Turns the rest of it into HTML.
        what: `"calibration"` or `"discovery"`.
        figure: Stands below the verdict.
    """
    result = read(run)
    if result is None:
        words = message("warning", f"{run.path} holds no {what}, or it is damaged.")
        return pn.Column(text_pane(words))
    try:
        head, said = f"<h3>{escape(verdict(result))}</h3>", say(result)
    except Exception as error:  # a result of another version, or a damaged one
        head, said = "", problem(run.path.name, error)
    files = [download(path, run.root, width=155) for path in run.downloads()]
    figures = [pn.pane.HTML(_figure(run, path), sizing_mode=WIDE) for path in run.figures()]
    return stacked(text_pane(head), pn.FlexBox(*files), figure, text_pane(said), *figures)


def _figure(run: Run, path: Path) -> str:
    """Return a figure as HTML: in the page itself, so that nothing asks for its file later."""
    try:
        content = run.read(path, MAX_FIGURE_BYTES)
    except InputError as error:
        return error_message(error)
    if not content.startswith(PNG):
        return message("warning", f"{path.name} is no PNG.")
    source = f"data:image/png;base64,{b64encode(content).decode()}"
    style = f"width: 100%; max-width: {FIGURE_PX}px"
    return f'<img src="{source}" alt="{escape(path.stem)}" style="{style}">'


def typed_number(text: str, where: str, such_as: str) -> float:
    """Return a number that was typed, with a decimal point or comma.

    Raises:
        InputError: If it is none.
    """
    try:
        return float(text.strip().replace(",", "."))
    except ValueError:
        raise InputError(
            f"Expected a number, got {text[:40]!r}.", where=where, remedy=f"Such as {such_as}."
        ) from None


def run_name(text: str, default: str) -> str:
    """Return the name of a run folder: letters, digits and `._-`, no folders; else a default."""
    kept = "".join(c if c.isalnum() or c in "._-" else "_" for c in text.strip()).lstrip(".-")
    return kept[:80] or default
