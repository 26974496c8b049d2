"""The tab that puts a run to use: simulated along the chosen tests, and exported."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import panel as pn

from heatrun.errors import InputError
from heatrun.io.free_names import free_name

from ..downloads import download
from ..jobs.pane import JobPane
from ..jobs.running import Job, JobQueue
from ..pane import text_pane
from ..runs import Run
from ..words import error_message, message, table
from .choices import Choices
from .run_view import run_name

SIMULATED, EXPORTED = "simulated", "exported"
"""Folders beside that of the runs."""

OWN, CHOSEN = "a test of the run", "the tests chosen on the left"

OF_RUN, OF_PAGE = "the run's own motor file", "the motor file on the left"


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
        self._tests = pn.widgets.Select(name="What is exported", options=[OWN, CHOSEN], width=260)
        self._motor = pn.widgets.Select(
            name="Columns and machine from", options=[OF_RUN, OF_PAGE], width=260, visible=False
        )
        self._corrected = pn.widgets.Checkbox(
            name="Correct Is, Pd and Te by the errors of current, losses, sink and timing that "
            "the run has estimated"
        )

        def offer_motor(event: Any) -> None:
            self._motor.visible = event.new == CHOSEN

        self._tests.param.watch(offer_motor, "value")
        export = self._form(
            "Export",
            "The run's parameters with a record for MATLAB, Simulink and Octave: a test that the "
            "run was fitted to, or any other, with the network along it.",
            queue,
            self._words_to_export,
            self._show_exported,
            (self._tests, self._motor, self._corrected),
        )
        self.view = pn.Column(*simulate, *export, sizing_mode="stretch_width")

    def _form(
        self,
        title: str,
        intro: str,
        queue: JobQueue,
        words: Callable[[], list[str]],
        show: Callable[[Job, pn.Column], None],
        choices: Sequence[Any] = (),
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
        return [heading, pn.FlexBox(*choices), job.view, told, made]

    def _run(self) -> Run:
        run = self._page.run
        if run is None:
            raise InputError(
                "Expected a run.", remedy="Choose one on the left, “Simulated course of run”."
            )
        return run

    def _motor_path(self) -> str:
        if self._page.motor_path is None:
            raise InputError("Expected a motor file.", remedy="Choose one on the left.")
        return str(self._page.motor_path)

    def _chosen(self) -> list[str]:
        """Return the paths of the chosen tests, at least one."""
        page = self._page
        if not page.chosen:
            raise InputError("Expected a test.", remedy="Choose tests on the left.")
        return [str(page.path(name)) for name in page.chosen]

    def _words_to_simulate(self) -> list[str]:
        run = self._run()
        words = ["simulate", self._motor_path(), str(run.path), *self._chosen()]
        return [*words, "--out", str(self._page.out.parent / SIMULATED)]

    def _words_to_export(self) -> list[str]:
        run = self._run()
        name, tests = run_name(run.path.name, "run"), []
        if self._tests.value == CHOSEN:
            tests = self._chosen()
            name += f"_{run_name(Path(tests[0]).name.split('.')[0], 'test')}"
            name += f"_and_{len(tests) - 1}_more" if len(tests) > 1 else ""
        out = free_name(self._page.out.parent / EXPORTED / name.replace(".", "_"))
        words = ["export", str(run.path), *tests, "--to", "mat", "--out", str(out)]
        words += ["--motor", self._motor_path()] if tests and self._motor.value == OF_PAGE else []
        return words + (["--corrected"] if self._corrected.value else [])

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
        several = job.output.get("exports")
        parts: list[Any] = []
        for written in several if isinstance(several, list) else [job.output]:
            parts += self._exported(written) if isinstance(written, dict) else []
        made[:] = parts

    def _exported(self, written: Mapping[str, Any]) -> list[Any]:
        """Return what is to be said of an export, and its files."""
        files, findings = written.get("files"), written.get("findings")
        paths = [Path(str(path)) for path in files] if isinstance(files, list) else []
        rmse = written.get("rmse_K")
        said = table(
            ("test", "network", "effects", "RMSE of the winding [K]"),
            [
                (str(written.get("test", "")), str(written.get("title", "")),
                 ", ".join(map(str, written.get("effects") or ())),
                 "not measured" if rmse is None else float(rmse))
            ],
        )  # fmt: skip
        said += "".join(
            message("warning", f"{f.get('message', '')} {f.get('remedy', '')}")
            for f in findings or ()
            if isinstance(f, dict)
        )
        return [text_pane(said), self._downloads(paths, EXPORTED)]

    def _downloads(self, paths: list[Path], folder: str) -> pn.FlexBox:
        root = (self._page.out.parent / folder).resolve()
        return pn.FlexBox(*(download(path.resolve(), root, width=240) for path in paths))
