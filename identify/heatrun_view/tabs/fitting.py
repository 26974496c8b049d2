"""What calibration and discovery have in common on the page: tests by role, a run, its result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Generic, TypeVar

import panel as pn

from heatrun.errors import InputError
from heatrun.io.free_names import free_name

from ..folder import Stamp
from ..jobs.pane import JobPane
from ..jobs.running import Job, JobQueue
from ..runs import Run
from ..words import error_message, message
from .choices import Choices
from .fit_figure import FitFigure
from .run_view import run_name, run_view

R = TypeVar("R")

NONE = "(none yet)"


class Fitting(Generic[R]):
    """A form that starts a command on the chosen tests, and the runs it has made.

    Attributes:
        view: What goes on the page.
        figure: Measured, model and residual of a test of the run that is shown.
    """

    def __init__(
        self,
        page: Choices,
        queue: JobQueue,
        *,
        command: str,
        read: Callable[[Run], R | None],
        orders: Mapping[str, str],
        verdict: Callable[[R], str],
        say: Callable[[R], str],
        intro: str,
    ) -> None:
        self._page, self._command, self._read = page, command, read
        self._verdict, self._say = verdict, say
        self.figure = FitFigure(self._draw)
        self._runs: dict[str, Run] = {}
        self._state: tuple[Path, Stamp] | None = None
        self._tests: list[str] = []
        self._holdout = pn.widgets.CheckBoxGroup(sizing_mode="stretch_width")
        self._order = pn.widgets.Select(name="Network", options=dict(orders), width=200)
        self._quick = pn.widgets.Checkbox(
            name="Quick: importance sampling instead of MCMC where its diagnostics allow",
            value=True,
        )
        self._name = pn.widgets.TextInput(name="Name of the run", placeholder="by the test")
        self._problem = page.pane("")
        self._job = JobPane(queue, command.capitalize())
        self._job.start.on_click(lambda _: self.start())
        self._shown = pn.widgets.Select(name="Result of run", options=[NONE], width=320)
        self._shown.param.watch(lambda _: self._show(), "value")
        self._result = pn.Column(sizing_mode="stretch_width")
        self.view = pn.Column(
            page.pane(f"<p>{intro}</p>"),
            page.pane("<h3>Held-out tests (predicted, not fitted)</h3>"),
            pn.Column(self._holdout, max_height=120, scroll=True, sizing_mode="stretch_width"),
            pn.FlexBox(self._order, self._name),
            self._quick,
            self._job.view,
            self._problem,
            self._shown,
            self._result,
            sizing_mode="stretch_width",
        )

    def offer(self, runs: Sequence[Run]) -> None:
        """Bring the lists of runs and of held-out tests up to date."""
        self._holdout.options = self._page.tests
        kept = [run for run in runs if self._read(run) is not None]
        self._runs = {run.path.name: run for run in kept}
        chosen = self._shown.value
        self._shown.options = [*self._runs] or [NONE]
        self._shown.value = chosen if chosen in self._runs else self._shown.options[0]
        self._show()

    def start(self) -> None:
        """Start the command, or say what it lacks."""
        try:
            words, folder = self._words()
        except InputError as error:
            self._problem.object = error_message(error)
            return
        self._problem.object = ""
        self._job.run(words, lambda job: self._done(job, folder))

    def _words(self) -> tuple[list[str], Path]:
        page = self._page
        holdout = [str(name) for name in self._holdout.value]
        fitted = [name for name in page.chosen if name not in holdout]
        if page.motor_path is None:
            raise InputError("Expected a motor file.", remedy="Choose one on the left.")
        if not fitted:
            raise InputError(
                "Expected at least one test to fit.",
                remedy="Choose tests on the left that are not held out.",
            )
        stem = Path(fitted[0]).name.split(".")[0]
        name = run_name(str(self._name.value), f"{run_name(stem, 'test')}_{self._command}")
        folder = free_name(page.out / name)
        words = [self._command, str(page.motor_path), *(str(page.path(name)) for name in fitted)]
        if holdout:
            words += ["--holdout", *(str(page.path(name)) for name in holdout)]
        words += ["--model", str(self._order.value), "--out", str(folder)]
        return words + (["--quick"] if self._quick.value else []), folder

    def _done(self, job: Job, folder: Path) -> None:
        self._page.list_runs(choose=folder)
        self._shown.value = folder.name if folder.name in self._runs else self._shown.value
        if job.output.get("run") is None:
            self._problem.object = message("warning", "The command wrote no run folder.")

    def _show(self) -> None:
        run = self._runs.get(str(self._shown.value))
        state = None if run is None else (run.path, run.stamp)
        if state == self._state:
            return
        self._state = state
        self._tests = (
            []
            if run is None or run.calibration is None
            else [f"{test.name} ({test.role})" for test in run.calibration.tests]
        )
        self.figure.offer(self._tests)
        self._draw()
        self._result[:] = [] if run is None else [self._view_of(run)]

    def _draw(self) -> None:
        run, test = self._runs.get(str(self._shown.value)), self.figure.test
        found = None
        if run is not None and test is not None and test in self._tests:
            found = run.band(self._tests.index(test) + 1, test)
        self.figure.show(found)

    def _view_of(self, run: Run) -> pn.Column:
        what = "calibration" if self._command == "calibrate" else "discovery"
        return run_view(run, self._read, self._verdict, self._say, what, self.figure.view)
