"""A command's progress on the page, with a button to cancel it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape

import panel as pn

from heatrun.errors import InputError

from .look import text_pane
from .running_jobs import Job, JobQueue
from .words import error_message, message

POLL_MS = 250


class JobPane:
    """Starts commands in the queue and shows how far they are.

    Attributes:
        view: What goes on the page.
        job: The command that is shown, None before the first.
    """

    def __init__(self, queue: JobQueue, start: str) -> None:
        self.job: Job | None = None
        self._queue = queue
        self._when_done: Callable[[Job], None] | None = None
        self._when_failed: Callable[[Job], None] | None = None
        self._poll = None
        self.start = pn.widgets.Button(name=start, button_type="primary", width=180)
        self._cancel = pn.widgets.Button(name="Cancel", width=90, visible=False)
        self._cancel.on_click(self._stop)
        self._bar = pn.indicators.Progress(
            value=0, max=100, sizing_mode="stretch_width", visible=False, bar_color="info"
        )
        self._words = text_pane()
        self.view = pn.Column(
            pn.Row(self.start, self._cancel), self._bar, self._words, sizing_mode="stretch_width"
        )

    def run(
        self,
        words: Sequence[str],
        when_done: Callable[[Job], None],
        when_failed: Callable[[Job], None] | None = None,
    ) -> None:
        """Queue a command and follow it.

        Args:
            words: The words after `heatrun`.
            when_done: Told the job once it has succeeded.
            when_failed: Told the job once it has failed, for what there is of it all the same.
        """
        try:
            self.job = self._queue.submit(words)
        except InputError as error:
            self._words.object = error_message(error)
            return
        self._when_done, self._when_failed = when_done, when_failed
        self.start.disabled = True
        self._cancel.visible = self._bar.visible = True
        self._refresh()
        self._poll = pn.state.add_periodic_callback(self._refresh, period=POLL_MS)

    def _stop(self, _: object) -> None:
        if self.job is not None:
            self._queue.cancel(self.job)

    def _refresh(self) -> None:
        job = self.job
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
        if job.state == "done" and self._when_done is not None:
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
    error = job.output.get("error")
    if isinstance(error, dict):
        parts = [str(error.get(key) or "") for key in ("where", "problem", "remedy")]
        return " ".join(part for part in parts if part)
    findings = job.output.get("findings")
    if isinstance(findings, list):
        grave = [f for f in findings if isinstance(f, dict) and f.get("severity") == "error"]
        told = [
            f"{f.get('where', '')}: {f.get('message', '')} {f.get('remedy', '')}" for f in grave
        ]
        return "The data do not allow it. " + " ".join(told)
    if job.output:
        return "Part of it failed; see the results below."
    return "The command failed: " + (job.lines[-1] if job.lines else "no message.")
