"""The tab that puts a run to use: simulated along the chosen tests, and exported."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any

import panel as pn

from ...errors import InputError
from ..downloads import download
from ..jobs.pane import JobPane
from ..jobs.running import Job, JobQueue
from ..pane import text_pane
from ..runs import Run
from ..words import error_message, table
from .choices import Choices

SIMULATED, EXPORTED = "simulated", "exported"
"""Folders beside that of the runs."""


class Using:
    """Forms that start `heatrun simulate` and `heatrun export` on the run that is chosen.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, page: Choices, queue: JobQueue) -> None:
        self._page = page
        simulate = self._form(
            "Simulate",
            "The run's network along the chosen tests, driven by their currents, losses and "
            "ambient or coolant: one CSV file for each, with 95 % bands.",
            queue,
            self._words_to_simulate,
            self._show_simulated,
        )
        export = self._form(
            "Export",
            "Parameters and record of the run for MATLAB, Simulink and Octave.",
            queue,
            self._words_to_export,
            self._show_exported,
        )
        self.view = pn.Column(*simulate, *export, sizing_mode="stretch_width")

    def _form(
        self,
        title: str,
        intro: str,
        queue: JobQueue,
        words: Callable[[], list[str]],
        show: Callable[[Job, pn.Column], None],
    ) -> list[Any]:
        job, told = JobPane(queue, title), text_pane()
        made = pn.Column(sizing_mode="stretch_width")

        def start(_: object) -> None:
            told.object, made[:] = "", []
            try:
                job.run(words(), lambda done: show(done, made))
            except InputError as error:
                told.object = error_message(error)

        job.start.on_click(start)
        heading = text_pane(f"<h3>{escape(title)}</h3><p>{escape(intro)}</p>")
        return [heading, job.view, told, made]

    def _run(self) -> Run:
        run = self._page.run
        if run is None:
            raise InputError(
                "Expected a run.", remedy="Choose one on the left, “Simulated course of run”."
            )
        return run

    def _words_to_simulate(self) -> list[str]:
        page, run = self._page, self._run()
        if page.motor_path is None:
            raise InputError("Expected a motor file.", remedy="Choose one on the left.")
        if not page.chosen:
            raise InputError("Expected a test.", remedy="Choose tests on the left.")
        tests = [str(page.path(name)) for name in page.chosen]
        out = str(page.out.parent / SIMULATED)
        return ["simulate", str(page.motor_path), str(run.path), *tests, "--out", out]

    def _words_to_export(self) -> list[str]:
        run = self._run()
        out = str(self._page.out.parent / EXPORTED / run.path.name)
        return ["export", str(run.path), "--to", "mat", "--out", out]

    def _show_simulated(self, job: Job, made: pn.Column) -> None:
        found = job.output.get("simulated")
        rows = [row for row in found if isinstance(row, dict)] if isinstance(found, list) else []
        said = table(
            ("test", "network", "effects", "RMSE [K]"),
            (
                (str(row.get("test", "")), str(row.get("network", "")),
                 ", ".join(map(str, row.get("effects") or ())),
                 "not measured" if row.get("rmse_K") is None else float(row["rmse_K"]))
                for row in rows
            ),
        )  # fmt: skip
        files = [Path(str(row["file"])) for row in rows if "file" in row]
        made[:] = [text_pane(said), self._downloads(files, SIMULATED)]

    def _show_exported(self, job: Job, made: pn.Column) -> None:
        files = job.output.get("files")
        paths = [Path(str(path)) for path in files] if isinstance(files, list) else []
        made[:] = [self._downloads(paths, EXPORTED)]

    def _downloads(self, paths: list[Path], folder: str) -> pn.FlexBox:
        root = (self._page.out.parent / folder).resolve()
        return pn.FlexBox(*(download(path.resolve(), root, width=240) for path in paths))
