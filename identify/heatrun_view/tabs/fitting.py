"""The tabs that calibrate and that discover: tests by role, a run, its result, and its figure.

`JobPane` shows the progress of a command, with a button to cancel it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
import panel as pn

from heatrun.errors import InputError
from heatrun.io.whole_files import free_name
from heatrun.reports.terminal import verdict_lines
from heatrun.results import DiscoveryResult, FitResult

from ..background import Soon, in_order
from ..linked import Band, Plots, Told
from ..look import WIDE, Screen, button, on_change, stacked, text_pane
from ..running_jobs import Job, JobQueue
from ..runs import Run, run_name, run_view
from ..store import Stamp
from ..trace import LOOK_AT, MEASURED, MODEL, RESIDUAL, Trace
from ..words import calibration_html, discovery_html, error_message, message

if TYPE_CHECKING:
    from .page import Page


HEIGHT_PX = 420


class FitFigure:
    """A choice of a test, and its figure."""

    def __init__(self, choose: Callable[[], None]) -> None:
        """Take whom to tell that another test is chosen."""
        self._screen = Screen()
        self._plots: Plots | None = None
        self._soon = Soon()
        self._tests = pn.widgets.Select(name="Test", width=280)
        on_change(choose, self._tests)
        self._place = stacked()
        self.view = stacked(self._tests, self._place, visible=False)

    @property
    def test(self) -> str | None:
        """Name of the test that is chosen, or None."""
        return self._tests.value  # pyright: ignore[reportReturnType]

    def offer(self, tests: Sequence[str]) -> None:
        """Offer tests; the one that is chosen and still there stays chosen."""
        kept = self.test
        self.view.visible = bool(tests)
        self._tests.visible = len(tests) > 1
        self._tests.options = [*tests]
        self._tests.value = kept if kept in tests else next(iter(tests), None)

    def look_like(self, screen: Screen) -> None:
        """Show the figure in the browser's colours."""
        self._screen = screen
        if self._plots is not None:
            with in_order():
                self._plots.paint(screen.look)

    def show(self, band: Band | None) -> None:
        """Draw a course with its measurement and its residual; None draws nothing."""
        self._plots, self._place[:] = None, []
        traces = [] if band is None else _traces(band)
        if band is None or not traces:
            return
        told = Told(self._soon, lambda *_: None, lambda *_: None, LOOK_AT)
        plots = self._plots = Plots(traces, [band], self._screen.look, HEIGHT_PX, told)
        self._place[:] = [
            pn.pane.Bokeh(each, sizing_mode=WIDE) for each in (plots.layout, plots.readout)
        ]

    def move(self, band: Band) -> None:
        """Show another course of the model over the same measurement."""
        if self._plots is not None:
            with in_order():
                self._plots.grow(_traces(band))


def _traces(band: Band) -> list[Trace]:
    """Return what is drawn, each with a reading."""
    residual = band.measured - band.median
    lines = ((MEASURED, band.measured, "degC"), (MODEL, band.median, "degC"),
             (RESIDUAL, residual, "K"))  # fmt: skip
    found = [Trace.of(band.test, name, band.time_s, value, unit) for name, value, unit in lines]
    return [trace for trace in found if trace.time_s.size]


def error_of(band: Band) -> tuple[float, float] | None:
    """Return RMSE and largest residual by magnitude [K]; None where nothing was measured."""
    residual = (band.measured - band.median)[np.isfinite(band.measured)]
    if not residual.size:
        return None
    return float(np.sqrt(np.mean(residual**2))), float(np.max(np.abs(residual)))


R = TypeVar("R")

NONE = "(none yet)"


class Fitting(Generic[R]):
    """A form that starts a command on the chosen tests, and the runs it has made.

    Attributes:
        figure: Measured, model and residual of a test of the run that is shown.
    """

    def __init__(
        self,
        page: Page,
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
        self._holdout = pn.widgets.CheckBoxGroup(sizing_mode=WIDE)
        self._order = pn.widgets.Select(name="Network", options=dict(orders), width=200)
        self._quick = pn.widgets.Checkbox(
            name="Quick: importance sampling instead of MCMC where its diagnostics allow",
            value=True,
        )
        self._name = pn.widgets.TextInput(name="Name of the run", placeholder="by the test")
        self._job = JobPane(queue, command.capitalize(), self._words, self._done)
        self._shown = pn.widgets.Select(name="Result of run", options=[NONE], width=320)
        on_change(self._show, self._shown)
        self._result = stacked()
        self.view = stacked(
            text_pane(f"<p>{intro}</p>"),
            text_pane("<h3>Held-out tests (predicted, not fitted)</h3>"),
            stacked(self._holdout, max_height=120, scroll=True),
            pn.FlexBox(self._order, self._name),
            self._quick,
            self._job.view,
            self._shown,
            self._result,
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
        self._job.begin()

    def _words(self) -> list[str]:
        page = self._page
        holdout = [str(name) for name in self._holdout.value]
        fitted = [name for name in page.chosen if name not in holdout]
        motor = page.required_motor()
        if not fitted:
            raise InputError(
                "Expected at least one test to fit.",
                remedy="Choose tests in the side panel that are not held out.",
            )
        stem = Path(fitted[0]).name.split(".")[0]
        name = run_name(str(self._name.value), f"{run_name(stem, 'test')}_{self._command}")
        self._folder = free_name(page.out / name)
        words = [self._command, motor, *(str(page.path(name)) for name in fitted)]
        if holdout:
            words += ["--holdout", *(str(page.path(name)) for name in holdout)]
        words += ["--model", str(self._order.value), "--out", str(self._folder)]
        return words + (["--quick"] if self._quick.value else [])

    def _done(self, job: Job) -> None:
        folder = self._folder
        self._page.list_runs(choose=folder)
        self._shown.value = folder.name if folder.name in self._runs else self._shown.value
        if job.output.get("run") is None:
            self._job.say(message("warning", "The command wrote no run folder."))

    def _show(self) -> None:
        run = self._runs.get(str(self._shown.value))
        state = None if run is None else (run.path, run.stamp)
        if state == self._state:
            return
        self._state = state
        result = None if run is None else run.calibration
        tests = () if result is None else result.tests
        self._tests = [f"{test.name} ({test.role})" for test in tests]
        self.figure.offer(self._tests)
        self._draw()
        what = "calibration" if self._command == "calibrate" else "discovery"
        self._result[:] = [] if run is None else [
            run_view(run, self._read, self._verdict, self._say, what, self.figure.view)
        ]  # fmt: skip

    def _draw(self) -> None:
        run, test = self._runs.get(str(self._shown.value)), self.figure.test
        found = None
        if run is not None and test is not None and test in self._tests:
            found = run.band(self._tests.index(test) + 1, test)
        self.figure.show(found)


def calibrating(page: Page, queue: JobQueue) -> Fitting[FitResult]:
    """Return the form and the results of `heatrun calibrate`."""
    return Fitting(
        page,
        queue,
        command="calibrate",
        read=lambda run: run.calibration,
        orders={"first and second order": "both", "second order": "second",
                "first order": "first"},
        verdict=lambda result: verdict_lines(result)[0],
        say=calibration_html,
        intro="Fits the network to the tests that are chosen in the side panel.",
    )  # fmt: skip


def discovering(page: Page, queue: JobQueue) -> Fitting[DiscoveryResult]:
    """Return the form and the results of `heatrun discover`."""
    return Fitting(
        page,
        queue,
        command="discover",
        read=lambda run: run.discovery,
        orders={"second order": "second", "first order": "first"},
        verdict=lambda result: f"{result.verdict.upper()}: {result.sentence}",
        say=discovery_html,
        intro="Searches for physical effects that the network lacks on the chosen tests.",
    )


POLL_MS = 250


class JobPane:
    """A button that queues a command, and how far that is."""

    def __init__(
        self,
        queue: JobQueue,
        start: str,
        words: Callable[[], list[str]],
        when_done: Callable[[Job], None],
        when_failed: Callable[[Job], None] | None = None,
    ) -> None:
        """Take what gives the words after `heatrun`, and whom to tell of the job once it is over.

        Args:
            queue: Of all tabs.
            start: What stands on the button.
            words: Raises InputError where something lacks.
            when_done: Told the job once it has succeeded.
            when_failed: Told the job once it has failed, for what there is of it all the same.
        """
        self._job: Job | None = None
        self._queue, self._asked = queue, words
        self._when_done, self._when_failed = when_done, when_failed
        self._poll = None
        self.start = button(start, self.begin, 180, button_type="primary")
        self._cancel = button("Cancel", self._stop, 90, visible=False)
        self._bar = pn.indicators.Progress(
            value=0, max=100, sizing_mode=WIDE, visible=False, bar_color="info"
        )
        self._words, self._problem = text_pane(), text_pane()
        buttons = pn.Row(self.start, self._cancel)
        self.view = stacked(buttons, self._bar, self._words, self._problem)

    def say(self, html: str) -> None:
        """Show a sentence below the progress."""
        self._problem.object = html

    def begin(self) -> None:
        """Queue the command and follow it, or say what it lacks."""
        self.say("")
        try:
            words = self._asked()
        except InputError as error:
            self.say(error_message(error))
            return
        try:
            self._job = self._queue.submit(words)
        except InputError as error:
            self._words.object = error_message(error)
            return
        self.start.disabled = True
        self._cancel.visible = self._bar.visible = True
        self._refresh()
        self._poll = pn.state.add_periodic_callback(self._refresh, period=POLL_MS)

    def _stop(self) -> None:
        if self._job is not None:
            self._queue.cancel(self._job)

    def _refresh(self) -> None:
        job = self._job
        assert job is not None
        self._bar.value = round(100 * job.share) if job.share > 0.0 else -1
        said = "".join(f"<br>{escape(line)}" for line in list(job.lines)[-6:])
        command = f"<p class='faded'><code>{escape(job.command)}</code>{said}</p>"
        self._words.object = f"<p>{escape(self._state(job))}</p>{command}"
        if not job.is_over:
            return
        if self._poll is not None:
            self._poll.stop()
            self._poll = None
        self.start.disabled = False
        self._cancel.visible = self._bar.visible = False
        if job.state == "done":
            self._words.object = command
            self._when_done(job)
        elif job.state == "cancelled":
            self._words.object = command + message(
                "note", "Cancelled. Started again, it resumes from the last checkpoint."
            )
        elif job.state == "failed":
            self._words.object = command + message("error", _reason(job))
            if self._when_failed is not None:
                self._when_failed(job)

    def _state(self, job: Job) -> str:
        if job.state == "waiting":
            num = self._queue.num_ahead(job)
            return f"Waiting for {num} other command{'s' if num != 1 else ''} to end."
        last = job.lines[-1].removeprefix("· ") if job.lines else "starting"
        return f"{job.doing} … {100 * job.share:.0f} %" if job.share > 0.0 else f"{last} …"


def _reason(job: Job) -> str:
    """Return why a command failed, in its own words."""
    error, findings = job.output.get("error"), job.output.get("findings")
    if error:
        return " ".join(filter(None, (error.get(k) for k in ("where", "problem", "remedy"))))
    if findings:
        grave = [f for f in findings if f["severity"] == "error"]
        told = (f"{f['where']}: {f['message']} {f['remedy']}" for f in grave)
        return f"The data do not allow it. {' '.join(told)}"
    if job.output:
        return "Part of it failed; see the results below."
    return "The command failed: " + (job.lines[-1] if job.lines else "no message.")
