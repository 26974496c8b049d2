"""The form of the tab “Report”: the words that it hands to `heatrun report`."""

from __future__ import annotations

from pathlib import Path

import pytest

from heatrun.cli import _parser
from heatrun.errors import InputError
from heatrun_reports.build import check_use
from heatrun_view.store import Folder, RecordStore
from heatrun_view.tabs.page import Page
from heatrun_view.tabs.sidebar import NO_RUN
from heatrun_view.uploads import UploadRoom

# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")


class Told:
    """A queue that keeps the words it is given and takes no command."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def submit(self, words: list[str]) -> None:
        self.words = list(words)
        raise InputError("Nothing is run here.")


@pytest.fixture(scope="module")
def out(shared_folder: Path) -> Path:
    """A folder of one run."""
    out = shared_folder.parent / "runs"
    (out / "cold").mkdir(parents=True)
    (out / "cold" / "manifest.json").write_text("{}")
    return out


@pytest.fixture(scope="module")
def shared(shared_folder: Path, out: Path) -> Page:
    """A page with a motor file, two tests and one run, on which a test is chosen."""
    sent = shared_folder.parent / "sent"
    sent.mkdir()
    page = Page(Folder(shared_folder), out, UploadRoom(sent, 1000), RecordStore(), Told())
    page._sidebar.tests.value = ["duty_30min.csv.gz"]
    return page


@pytest.fixture
def page(shared: Page) -> Page:
    """The page with its form empty."""
    shared._sidebar.run.value = NO_RUN
    shared._sidebar.kind.value = "general"
    shared.reporting._reference.value = shared.reporting._reference.options[0]
    shared.reporting._problem.object = ""
    shared.reporting._job._queue.words = []
    return shared


def ordered(page: Page, kind: str, *, run: str | None = None, reference: str | None = None):
    """Return what the command makes of the form, filled in and started."""
    page._sidebar.kind.value = kind
    if run is not None:
        page._sidebar.run.value = run
    if reference is not None:
        page.reporting._reference.value = reference
    page.reporting._job.start.clicks += 1
    options = _parser().parse_args(page.reporting._job._queue.words)
    check_use(options.kind, options.run, options.reference is not None, {}, options.offset)
    return options


def test_a_selected_run_is_the_virtual_prototype(page, out):
    options = ordered(page, "virtual", run="cold")
    assert options.run == out / "cold"
    assert options.reference is None
    assert "cold" in str(page.reporting._reference.value)  # the form says with what it compares


def test_a_record_chosen_as_virtual_prototype_counts_before_the_selected_run(page, shared_folder):
    options = ordered(page, "virtual", run="cold", reference="step_30min.csv.gz")
    assert options.run is None
    assert options.reference == shared_folder / "step_30min.csv.gz"


def test_a_run_is_no_real_prototype(page, shared_folder):
    page._sidebar.run.value = "cold"
    page._sidebar.kind.value = "real"
    page.reporting._job.start.clicks += 1
    assert page.reporting._job._queue.words == []
    assert "Expected the record of the other prototype" in page.reporting._problem.object
    options = ordered(page, "real", reference="step_30min.csv.gz")
    assert (options.run, options.reference) == (None, shared_folder / "step_30min.csv.gz")


def test_without_run_and_record_the_form_names_both(page):
    page._sidebar.kind.value = "virtual"
    page.reporting._job.start.clicks += 1
    assert page.reporting._job._queue.words == []
    assert "select a run in the side panel" in page.reporting._problem.object


def test_a_thermal_report_shows_the_selected_run(page, out):
    assert ordered(page, "thermal", run="cold").run == out / "cold"
    assert ordered(page, "general").run is None
