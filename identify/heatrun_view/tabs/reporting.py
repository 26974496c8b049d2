"""The tab that makes reports of the chosen tests by test type."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import panel as pn

from heatrun.errors import InputError
from heatrun_reports import TEST_TYPES

from ..downloads import download
from ..jobs.pane import JobPane
from ..jobs.running import Job, JobQueue
from ..runs import Run
from ..words import error_message, message, table
from .choices import Choices

NO_REFERENCE = "(choose)"


class Reporting:
    """A form that starts `heatrun report`, and the reports it has written.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, page: Choices, queue: JobQueue) -> None:
        self._page = page
        self._intro = page.pane("")
        self._reference = pn.widgets.Select(
            name="Record of the other prototype", options=[NO_REFERENCE],
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._tolerances = pn.widgets.TextInput(
            name="Tolerances (optional)", placeholder="winding_degC=3 speed_rpm=50",
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._pair = pn.Column(
            self._reference, self._tolerances, visible=False, sizing_mode="stretch_width"
        )
        self._problem = page.pane("")
        self._job = JobPane(queue, "Make report")
        self._job.start.on_click(lambda _: self._start())
        self._made = pn.Column(sizing_mode="stretch_width")
        self.view = pn.Column(
            self._intro, self._pair, self._job.view, self._problem, self._made,
            sizing_mode="stretch_width",
        )  # fmt: skip

    def say_missing(self, missing: Sequence[str]) -> None:
        """Show what the chosen test type answers, and what the chosen tests lack for it."""
        card = TEST_TYPES[self._page.kind]
        self._pair.visible = card.needs_reference
        self.offer_references()
        lacks = "".join(message("warning", each) for each in missing)
        intro = f"<h3>{escape(card.title)}</h3><p>{escape(card.sentence)}</p>"
        self._intro.object = intro + lacks

    def offer_references(self) -> None:
        """Bring the list of the other prototype's records up to date; a chosen one stays chosen."""
        kept, run = self._reference.value, self._run()
        first = NO_REFERENCE if run is None else f"(run {run.path.name}, selected on the left)"
        self._reference.options = [first, *self._records]
        self._reference.value = kept if kept in self._records else first

    @property
    def _records(self) -> list[str]:
        return [*self._page.tests, *self._page.simulated]

    def _run(self) -> Run | None:
        """Return the selected run, where the test type can show it."""
        return self._page.run if self._page.kind in ("thermal", "virtual") else None

    def _start(self) -> None:
        try:
            words = self._words()
        except InputError as error:
            self._problem.object = error_message(error)
            return
        self._problem.object = ""
        self._made[:] = []
        self._job.run(words, self._show, when_failed=self._show)

    def _words(self) -> list[str]:
        page = self._page
        if page.motor_path is None:
            raise InputError("Expected a motor file.", remedy="Choose one on the left.")
        if not page.chosen:
            raise InputError("Expected a test.", remedy="Choose tests on the left.")
        card = TEST_TYPES[page.kind]
        words = ["report", "--type", page.kind, str(page.motor_path)]
        words += [str(page.path(name)) for name in page.chosen]
        words += ["--out", str(page.out.parent / "reports")]
        if card.needs_reference:
            words += [f"--tolerance={each}" for each in str(self._tolerances.value).split()]
        return words + self._compared()

    def _compared(self) -> list[str]:
        """Return the option that names the other prototype's record, or the run.

        A record that is chosen in the form counts before the run, which may have been selected
        for the plots only; the command takes one of the two.
        """
        page, run = self._page, self._run()
        card = TEST_TYPES[page.kind]
        if card.needs_reference and self._reference.value in self._records:
            return ["--reference", str(page.path(str(self._reference.value)))]
        if run is not None:
            return ["--run", str(run.path)]
        if card.needs_reference:
            also = ", or select a run on the left" if page.kind == "virtual" else ""
            raise InputError(
                "Expected the record of the other prototype.", remedy=f"Choose it above{also}."
            )
        return []

    def _show(self, job: Job) -> None:
        reports = job.output.get("reports")
        parts = []
        for report in reports if isinstance(reports, list) else []:
            parts += self._one(report)
        self._made[:] = parts

    def _one(self, report: Mapping[str, Any]) -> list[Any]:
        if "error" in report:
            error = report["error"]
            return [
                self._page.pane(
                    error_message(InputError(error["problem"], where=error["where"],
                                             remedy=error["remedy"]))
                )
            ]  # fmt: skip
        files = [Path(path) for path in report["written"]]
        root = (self._page.out.parent / "reports").resolve()
        buttons = [
            download(path, root, width=380) for path in files if path.suffix in (".pdf", ".csv")
        ]
        rows = [
            (row["label"], "undefined" if row["value"] is None else row["value"], row["unit"],
             row["note"])
            for row in report["table"]
        ]  # fmt: skip
        told = "".join(
            message(f["severity"], f"{f['where']}: {f['message']} {f['remedy']}")
            for f in report["findings"]
            if f["severity"] != "note"
        )
        head = f"<h3>{escape(report['test'])}</h3><p>{escape(report['summary'])}</p>"
        body = table(("", "value", "unit", ""), rows)
        return [self._page.pane(head), pn.FlexBox(*buttons), self._page.pane(body + told)]
