"""The tabs that put a run to use and make reports by test type, and files dropped on the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import panel as pn

from heatrun.errors import InputError, of_file
from heatrun.io.whole_files import free_name
from heatrun_reports import CARDS
from heatrun_reports.prototypes import LONGEST_ROLE

from ..look import text_pane
from ..running_jobs import Job, JobQueue
from ..runs import Run, download, run_name
from ..store import BoundedDropper, UploadRoom, keep_upload
from ..words import error_message, message, table
from .fitting import Choices, JobPane

SIMULATED, EXPORTED = "simulated", "exported"
"""Folders beside that of the runs."""

OWN, CHOSEN = "a test of the run", "the tests chosen in the side panel"

OF_RUN, OF_PAGE = "the run's own motor file", "the motor file in the side panel"


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
        self._tests = pn.widgets.Select(name="What is exported", options=[OWN, CHOSEN], width=300)
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
                "Expected a run.", remedy="Choose one in the side panel, “Simulated course of run”."
            )
        return run

    def _motor_path(self) -> str:
        if self._page.motor_path is None:
            raise InputError("Expected a motor file.", remedy="Choose one in the side panel.")
        return str(self._page.motor_path)

    def _chosen(self) -> list[str]:
        """Return the paths of the chosen tests, at least one."""
        page = self._page
        if not page.chosen:
            raise InputError("Expected a test.", remedy="Choose tests in the side panel.")
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
        card = CARDS[self._page.kind]
        self._pair.visible = card.needs_reference
        self.offer_references()
        lacks = "".join(message("warning", each) for each in missing)
        intro = f"<h3>{escape(card.title)}</h3><p>{escape(card.sentence)}</p>"
        self._intro.object = intro + lacks

    def offer_references(self) -> None:
        """Bring the list of the other prototype's records up to date; a chosen one stays chosen."""
        kept, run = self._reference.value, self._run()
        first = (
            NO_REFERENCE if run is None else f"(run {run.path.name}, selected in the side panel)"
        )
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
            raise InputError("Expected a motor file.", remedy="Choose one in the side panel.")
        if not page.chosen:
            raise InputError("Expected a test.", remedy="Choose tests in the side panel.")
        card = CARDS[page.kind]
        words = ["report", "--type", page.kind, str(page.motor_path)]
        words += self._tests()
        words += ["--out", str(page.out.parent / "reports")]
        if card.needs_reference:
            words += [f"--tolerance={each}" for each in str(self._tolerances.value).split()]
        return words + self._compared()

    def _tests(self) -> list[str]:
        """Return the paths of the tests; of prototypes each with a role, which says of a model."""
        page = self._page
        if page.kind != "prototypes":
            return [str(page.path(name)) for name in page.chosen]
        if len(page.chosen) < 2:
            raise InputError("Expected two tests or more.", remedy="Choose them in the side panel.")
        named = []
        for number, name in enumerate(page.chosen, 1):
            stem = Path(name).name.split(".")[0].replace("=", " ")
            role = f"{'virtual ' if name in page.simulated else ''}{number} {stem}"
            named.append(f"{role[:LONGEST_ROLE]}={page.path(name)}")
        return named

    def _compared(self) -> list[str]:
        """Return the option that names the other prototype's record, or the run.

        A record that is chosen in the form counts before the run, which may have been selected
        for the plots only; the command takes one of the two.
        """
        page, run = self._page, self._run()
        card = CARDS[page.kind]
        if card.needs_reference and self._reference.value in self._records:
            return ["--reference", str(page.path(str(self._reference.value)))]
        if run is not None:
            return ["--run", str(run.path)]
        if card.needs_reference:
            also = ", or select a run in the side panel" if page.kind == "virtual" else ""
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
            (row["label"], row["value"], row["unit"], row["note"]) if row["value"] is not None
            else (row["label"], "", "", row["note"] or "undefined")
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


class Sending:
    """Where files are dropped.

    Attributes:
        view: What goes on the page.
    """

    def __init__(self, room: UploadRoom, arrived: Callable[[], None]) -> None:
        """Take where files are kept, and whom to tell of new ones."""
        self._room, self._arrived = room, arrived
        self._dropper = BoundedDropper(room, self._refuse, height=90, sizing_mode="stretch_width")
        self._problem = text_pane()
        self.view = pn.Column(
            text_pane("<h3>Other files</h3>"), self._dropper, self._problem,
            sizing_mode="stretch_width",
        )  # fmt: skip
        self._dropper.param.watch(self._keep, "value")

    def close(self) -> None:
        """Give back the room of what has not arrived."""
        self._dropper.close()

    def _keep(self, _: Any) -> None:
        problems = ""
        for name, content in self._dropper.arrived().items():
            try:
                keep_upload(self._room.folder, name, content)
            except InputError as error:
                problems += error_message(error)
            except OSError as error:
                problems += error_message(of_file(error))
        self._problem.object = problems
        self._arrived()

    def _refuse(self, error: InputError) -> None:
        self._problem.object = error_message(error)
