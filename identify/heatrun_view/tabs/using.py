"""The tabs that put a run to use and make reports by test type, and files dropped on the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import panel as pn

from heatrun.errors import InputError, of_file
from heatrun.io.whole_files import free_name
from heatrun_reports import CARDS
from heatrun_reports.prototypes import LONGEST_ROLE

from ..look import WIDE, on_change, stacked, text_pane
from ..running_jobs import Job, JobQueue
from ..runs import Run, download, run_name
from ..store import BoundedDropper, UploadRoom, keep_upload
from ..words import error_message, message, table
from .fitting import JobPane

if TYPE_CHECKING:
    from .page import Page

SIMULATED, EXPORTED = "simulated", "exported"
"""Folders beside that of the runs."""

OWN, CHOSEN = "a test of the run", "the tests chosen in the side panel"

OF_RUN, OF_PAGE = "the run's own motor file", "the motor file in the side panel"


class Using:
    """Forms that start `heatrun simulate` and `heatrun export` on the run that is chosen."""

    def __init__(self, page: Page, queue: JobQueue) -> None:
        self._page = page
        simulate = _form(
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
        on_change(self._offer_motor, self._tests)
        export = _form(
            "Export",
            "The run's parameters with a record for MATLAB, Simulink and Octave: a test that the "
            "run was fitted to, or any other, with the network along it.",
            queue,
            self._words_to_export,
            self._show_exported,
            (self._tests, self._motor, self._corrected),
        )
        self.view = stacked(*simulate, *export)

    def _offer_motor(self) -> None:
        self._motor.visible = self._tests.value == CHOSEN

    def _run(self) -> Run:
        run = self._page.run
        if run is None:
            raise InputError(
                "Expected a run.", remedy="Choose one in the side panel, “Simulated course of run”."
            )
        return run

    def _words_to_simulate(self) -> list[str]:
        run = self._run()
        page = self._page
        words = ["simulate", page.required_motor(), str(run.path), *page.required_tests()]
        return [*words, "--out", str(self._page.out.parent / SIMULATED)]

    def _words_to_export(self) -> list[str]:
        run = self._run()
        name, tests = run_name(run.path.name, "run"), []
        if self._tests.value == CHOSEN:
            tests = self._page.required_tests()
            name += f"_{run_name(Path(tests[0]).name.split('.')[0], 'test')}"
            name += f"_and_{len(tests) - 1}_more" if len(tests) > 1 else ""
        out = free_name(self._page.out.parent / EXPORTED / name.replace(".", "_"))
        words = ["export", str(run.path), *tests, "--to", "mat", "--out", str(out)]
        if tests and self._motor.value == OF_PAGE:
            words += ["--motor", self._page.required_motor()]
        return words + (["--corrected"] if self._corrected.value else [])

    def _show_simulated(self, job: Job) -> list[Any]:
        rows = job.output["simulated"]
        head = ("test", "network", "effects", "RMSE [K]")
        said = table(head, [_predicted(row, row["network"]) for row in rows])
        files = [Path(row["file"]) for row in rows if "file" in row]
        return [text_pane(said), self._downloads(files, SIMULATED)]

    def _show_exported(self, job: Job) -> list[Any]:
        written = job.output.get("exports", [job.output])
        return [part for one in written for part in self._exported(one)]

    def _exported(self, written: Mapping[str, Any]) -> list[Any]:
        """Return what is to be said of an export, and its files."""
        head = ("test", "network", "effects", "RMSE of the winding [K]")
        said = table(head, [_predicted(written, written["title"])])
        for f in written["findings"]:
            said += message("warning", f"{f['message']} {f['remedy']}")
        paths = [Path(path) for path in written["files"]]
        return [text_pane(said), self._downloads(paths, EXPORTED)]

    def _downloads(self, paths: Sequence[Path], folder: str) -> pn.FlexBox:
        root = (self._page.out.parent / folder).resolve()
        return pn.FlexBox(*(download(path.resolve(), root, width=240) for path in paths))


def _form(
    title: str,
    intro: str,
    queue: JobQueue,
    words: Callable[[], list[str]],
    show: Callable[[Job], list[Any]],
    choices: Sequence[Any] = (),
) -> list[Any]:
    """Return what stands in a form: its text, its choices, its button, and what was made."""
    made = stacked()

    def asked() -> list[str]:
        made[:] = []
        return words()

    job = JobPane(queue, title, asked, lambda job: made.__setitem__(slice(None), show(job)))
    heading = text_pane(f"<h3>{escape(title)}</h3><p>{escape(intro)}</p>")
    return [heading, pn.FlexBox(*choices), job.view, made]


def _predicted(row: Mapping[str, Any], network: str) -> tuple[Any, ...]:
    rmse = row.get("rmse_K")
    effects = ", ".join(row.get("effects") or ())
    return row["test"], network, effects, "not measured" if rmse is None else float(rmse)


NO_REFERENCE = "(choose)"


class Reporting:
    """A form that starts `heatrun report`, and the reports it has written."""

    def __init__(self, page: Page, queue: JobQueue) -> None:
        self._page = page
        self._intro = text_pane()
        self._reference = pn.widgets.Select(
            name="Record of the other prototype", options=[NO_REFERENCE], sizing_mode=WIDE
        )
        self._tolerances = pn.widgets.TextInput(
            name="Tolerances (optional)", placeholder="winding_degC=3 speed_rpm=50",
            sizing_mode=WIDE,
        )  # fmt: skip
        self._pair = stacked(self._reference, self._tolerances, visible=False)
        self._job = JobPane(queue, "Make report", self._words, self._show, self._show)
        self._made = stacked()
        self.view = stacked(self._intro, self._pair, self._job.view, self._made)

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

    def _words(self) -> list[str]:
        page = self._page
        motor, tests = page.required_motor(), page.required_tests()
        words = ["report", "--type", page.kind, motor, *self._with_roles(tests)]
        words += ["--out", str(page.out.parent / "reports")]
        if CARDS[page.kind].needs_reference:
            words += [f"--tolerance={each}" for each in str(self._tolerances.value).split()]
        words += self._compared()
        self._made[:] = []
        return words

    def _with_roles(self, paths: Sequence[str]) -> list[str]:
        """Return the paths of the tests; of prototypes each with a role, which says of a model."""
        page = self._page
        if page.kind != "prototypes":
            return [*paths]
        if len(paths) < 2:
            raise InputError("Expected two tests or more.", remedy="Choose them in the side panel.")
        named = []
        for number, (name, path) in enumerate(zip(page.chosen, paths, strict=True), 1):
            stem = Path(name).name.split(".")[0].replace("=", " ")
            role = f"{'virtual ' if name in page.simulated else ''}{number} {stem}"
            named.append(f"{role[:LONGEST_ROLE]}={path}")
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
        reports = job.output.get("reports", ())
        self._made[:] = [part for report in reports for part in self._one(report)]

    def _one(self, report: Mapping[str, Any]) -> list[Any]:
        if "error" in report:
            error = report["error"]
            said = InputError(error["problem"], where=error["where"], remedy=error["remedy"])
            return [text_pane(error_message(said))]
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
        return [text_pane(head), pn.FlexBox(*buttons), text_pane(body + told)]


class Sending:
    """Where files are dropped."""

    def __init__(self, room: UploadRoom, arrived: Callable[[], None]) -> None:
        """Take where files are kept, and whom to tell of new ones."""
        self._room, self._arrived = room, arrived
        self._dropper = BoundedDropper(room, self._refuse, height=90, sizing_mode=WIDE)
        self._problem = text_pane()
        self.view = stacked(text_pane("<h3>Other files</h3>"), self._dropper, self._problem)
        on_change(self._keep, self._dropper)

    def close(self) -> None:
        """Give back the room of what has not arrived."""
        self._dropper.close()

    def _keep(self) -> None:
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
