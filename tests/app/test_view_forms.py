"""The tabs “Report” and “Simulate and export”: their commands, and what is handed out of them."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from heatrun.cli import _parser
from heatrun.errors import InputError
from heatrun_reports.job import check_use
from heatrun_reports.prototypes import parse_roles
from heatrun_view.store import Folder, RecordStore, UploadRoom
from heatrun_view.tabs.page import Page
from heatrun_view.tabs.sidebar import NO_RUN

# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")


class Told:
    """A queue that keeps the words it is given and takes no command."""

    words: list[str]

    def submit(self, words: list[str]) -> None:
        self.words = list(words)
        raise InputError("Nothing is run here.")


@pytest.fixture(scope="module")
def queue() -> Told:
    return Told()


@pytest.fixture(scope="module")
def home(shared_folder: Path) -> Path:
    """Where the results go; it holds the folder of the tests and one run."""
    (shared_folder.parent / "runs" / "cold").mkdir(parents=True)
    (shared_folder.parent / "runs" / "cold" / "manifest.json").write_text("{}")
    (shared_folder.parent / "sent").mkdir()
    return shared_folder.parent


@pytest.fixture(scope="module")
def shared(shared_folder: Path, home: Path, queue: Told) -> Page:
    sent = UploadRoom(home / "sent", 1000)
    return Page(Folder(shared_folder), home / "runs", sent, RecordStore(), queue)


@pytest.fixture
def page(shared: Page, queue: Told) -> Page:
    """The page with one test, no run, and its forms empty."""
    side, reporting, using = shared._sidebar, shared.reporting, shared.using
    side.run.value, side.kind.value, side.tests.value = NO_RUN, "general", ["duty_30min.csv.gz"]
    for choice in (reporting._reference, using._tests, using._motor):
        choice.value = choice.options[0]
    using._corrected.value, reporting._job._problem.object, queue.words = False, "", []
    return shared


def ordered(page: Page, kind: str, **chosen: str):
    """Return what the command makes of the form of a report, filled in and started."""
    page._sidebar.kind.value = kind
    page._sidebar.run.value = chosen.get("run", page._sidebar.run.value)
    reference = page.reporting._reference
    reference.value = chosen.get("reference", reference.value)
    page.reporting._job.start.clicks += 1
    options = _parser().parse_args(page.reporting._job._queue.words)
    check_use(options.kind, options.run, options.reference is not None, {}, options.offset)
    return options


def test_a_selected_run_is_the_virtual_prototype(page, home):
    options = ordered(page, "virtual", run="cold")
    assert options.run == home / "runs/cold"
    assert options.reference is None
    assert "cold" in str(page.reporting._reference.value)  # the form says with what it compares


def test_a_record_chosen_as_virtual_prototype_counts_before_the_selected_run(page, shared_folder):
    options = ordered(page, "virtual", run="cold", reference="step_30min.csv.gz")
    assert options.run is None
    assert options.reference == shared_folder / "step_30min.csv.gz"


def test_a_run_is_no_real_prototype(page, queue, shared_folder):
    page._sidebar.run.value = "cold"
    page._sidebar.kind.value = "real"
    page.reporting._job.start.clicks += 1
    assert queue.words == []
    assert "Expected the record of the other prototype" in page.reporting._job._problem.object
    options = ordered(page, "real", reference="step_30min.csv.gz")
    assert (options.run, options.reference) == (None, shared_folder / "step_30min.csv.gz")


def test_without_run_and_record_the_form_names_both(page, queue):
    page._sidebar.kind.value = "virtual"
    page.reporting._job.start.clicks += 1
    assert queue.words == []
    assert "select a run in the side panel" in page.reporting._job._problem.object


def test_a_thermal_report_shows_the_selected_run(page, home):
    assert ordered(page, "thermal", run="cold").run == home / "runs/cold"
    assert ordered(page, "general").run is None


def test_prototypes_are_named_after_their_records(page, queue, shared_folder):
    page._sidebar.kind.value = "prototypes"
    page.reporting._job.start.clicks += 1
    assert queue.words == []
    assert "two tests or more" in page.reporting._job._problem.object
    names = ["duty_30min.csv.gz", "step_30min.csv.gz"]
    page._sidebar.tests.value = names
    page.reporting._job.start.clicks += 1
    options = _parser().parse_args(queue.words)
    roles = [f"{number} {name.split('.')[0]}" for number, name in enumerate(names, 1)]
    files = [shared_folder / name for name in names]
    assert parse_roles(map(str, options.tests)) == tuple(zip(roles, files, strict=True))


def test_what_is_undefined_is_said_in_words(page):
    report = {"test": "t", "summary": "s", "written": [], "findings": [], "table": [
        {"label": "Energy", "value": None, "unit": "kWh", "note": "undefined: no power"},
        {"label": "Span", "value": 1.5, "unit": "min", "note": ""}]}  # fmt: skip
    said = page.reporting._one(report)[-1].object
    assert "kWh" not in said
    assert said.count("undefined") == 1
    assert "min" in said


def _press(page: Page, name: str) -> None:
    (button,) = page.using.view.select(lambda each: getattr(each, "name", "") == name)
    button.clicks += 1


def test_the_commands_are_those_of_the_command_line(page, queue, shared_folder, home):
    _press(page, "Simulate")
    assert queue.words == []  # no run is chosen
    page._sidebar.run.value = "cold"
    _press(page, "Simulate")
    options = _parser().parse_args(queue.words)
    assert options.tests == [shared_folder / "duty_30min.csv.gz"]
    assert (options.motor, options.source) == (
        shared_folder / "motor.toml",
        str(home / "runs/cold"),
    )
    assert options.out == home / "simulated"
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert str(home / "runs/cold") in queue.words
    assert (options.to, options.out) == ("mat", home / "exported" / "cold")


def test_a_new_test_is_exported_with_the_parameters_of_a_run(page, queue, shared_folder, home):
    form = page.using
    form._tests.value = form._tests.options[1]
    page._sidebar.run.value = "cold"
    page._sidebar.tests.value = []
    _press(page, "Export")
    assert queue.words == []  # no test is chosen
    page._sidebar.tests.value = ["step_30min.csv.gz"]
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert (options.source, options.tests) == (
        home / "runs/cold",
        [shared_folder / "step_30min.csv.gz"],
    )
    assert options.out == home / "exported" / "cold_step_30min"
    assert (options.motor, options.corrected) == (None, False)

    options.out.mkdir(parents=True)  # as a first export leaves it
    form._motor.value = form._motor.options[1]
    form._corrected.value = True
    page._sidebar.tests.value = both = ["duty_30min.csv.gz", "step_30min.csv.gz"]
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert options.tests == [shared_folder / name for name in both]
    assert options.out == home / "exported" / "cold_duty_30min_and_1_more"
    assert (options.motor, options.corrected) == (shared_folder / "motor.toml", True)
    page._sidebar.tests.value = ["step_30min.csv.gz"]
    _press(page, "Export")
    assert _parser().parse_args(queue.words).out == home / "exported" / "cold_step_30min-2"
    form._tests.value = form._tests.options[0]
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert (options.tests, options.motor) == ([], None)


def test_what_was_exported_is_said_and_handed_out(page, home):
    written = home / "exported" / "cold_duty"
    written.mkdir(parents=True)
    (written / "prova.mat").write_bytes(b"MATLAB")
    one = {
        "files": [str(written / "prova.mat")], "test": "<b>", "title": "second order",
        "effects": [], "rmse_K": 0.3,
        "findings": [{"message": "<i>", "remedy": "Pass --corrected."}],
    }  # fmt: skip
    for output, num in ((one, 1), ({"exports": [one, one]}, 2)):
        made = page.using._show_exported(SimpleNamespace(output=output))
        assert len(made) == 2 * num
        said, files = made[:2]
        assert "<b>" not in said.object
        assert "<i>" not in said.object
        assert "Pass --corrected." in said.object
        assert files[0].callback().read() == b"MATLAB"


def test_only_files_of_their_folder_are_handed_out(page, home):
    (home / "simulated").mkdir()
    (home / "simulated" / "a_virtual.csv").write_text("time_s\n0\n")
    (home / "secret.csv").write_text("secret")
    rows = [
        {"test": "<b>", "network": "second", "effects": [], "rmse_K": None, "file": str(file)}
        for file in (home / "simulated" / "a_virtual.csv", home / "secret.csv")
    ]
    said, files = page.using._show_simulated(SimpleNamespace(output={"simulated": rows}))
    assert "<b>" not in said.object
    inside, outside = files
    assert inside.callback().read() == b"time_s\n0\n"
    assert b"secret" not in outside.callback().read().replace(b"secret.csv", b"")
