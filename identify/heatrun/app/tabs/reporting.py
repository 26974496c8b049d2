"""The tab that makes reports of the chosen tests by test type."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import panel as pn

from ...errors import InputError
from ...reports.bench_tests import TEST_TYPES
from ..downloads import download
from ..jobs.pane import JobPane
from ..jobs.running import Job, JobQueue
from ..words import error_message, message, table

if TYPE_CHECKING:
    from .page import Page

NO_REFERENCE = "(choose)"


class Reporting:
    """A form that starts `heatrun report`, and the reports it has written.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, page: Page, queue: JobQueue) -> None:
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
        self._job = JobPane(queue, page.look, "Make report")
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
        tests = [NO_REFERENCE, *self._page.tests]
        kept = self._reference.value
        self._reference.options = tests
        self._reference.value = kept if kept in tests else NO_REFERENCE
        lacks = "".join(message("warning", each) for each in missing)
        intro = f"<h3>{escape(card.title)}</h3><p>{escape(card.sentence)}</p>"
        self._intro.object = intro + lacks

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
            if self._reference.value == NO_REFERENCE:
                raise InputError(
                    "Expected the record of the other prototype.", remedy="Choose it above."
                )
            words += ["--reference", str(page.path(str(self._reference.value)))]
            for each in str(self._tolerances.value).split():
                words += [f"--tolerance={each}"]
        if page.run is not None and page.kind in ("thermal", "virtual"):
            words += ["--run", str(page.run.path)]
        return words

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
        return [self._page.pane(head), pn.Row(*buttons), self._page.pane(body + told)]
