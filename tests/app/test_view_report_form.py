"""The form of the tab “Report”: the words that it hands to `heatrun report`."""

from __future__ import annotations

from pathlib import Path

import pytest

from heatrun.app.folder import Folder
from heatrun.app.store import RecordStore
from heatrun.app.tabs.page import Page
from heatrun.app.uploads import UploadRoom
from heatrun.cli import _parser
from heatrun.errors import InputError
from heatrun.reports.bench_tests.build import check_use

# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")


class Told:
    """A queue that keeps the words it is given and takes no command."""

    def __init__(self) -> None:
        self.words: list[str] = []

    def submit(self, words: list[str]) -> None:
        self.words = list(words)
        raise InputError("Nothing is run here.")


@pytest.fixture
def page(folder: Path, tmp_path: Path) -> Page:
    """A page with a motor file, two tests and one run, on which a test is chosen."""
    out = tmp_path / "runs"
    (out / "cold").mkdir(parents=True)
    (out / "cold" / "manifest.json").write_text("{}")
    page = Page(Folder(folder), out, UploadRoom(tmp_path / "sent", 1000), RecordStore(), Told())
    page._sidebar.tests.value = ["duty_30min.csv.gz"]
    return page


@pytest.fixture(autouse=True)
def sent(tmp_path: Path) -> None:
    (tmp_path / "sent").mkdir()


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


def test_a_selected_run_is_the_virtual_prototype(page, tmp_path):
    options = ordered(page, "virtual", run="cold")
    assert options.run == tmp_path / "runs" / "cold"
    assert options.reference is None
    assert "cold" in str(page.reporting._reference.value)  # the form says with what it compares


def test_a_record_chosen_as_virtual_prototype_counts_before_the_selected_run(page, folder):
    options = ordered(page, "virtual", run="cold", reference="step_30min.csv.gz")
    assert options.run is None
    assert options.reference == folder / "step_30min.csv.gz"


def test_a_run_is_no_real_prototype(page, folder):
    page._sidebar.run.value = "cold"
    page._sidebar.kind.value = "real"
    page.reporting._job.start.clicks += 1
    assert page.reporting._job._queue.words == []
    assert "Expected the record of the other prototype" in page.reporting._problem.object
    options = ordered(page, "real", reference="step_30min.csv.gz")
    assert (options.run, options.reference) == (None, folder / "step_30min.csv.gz")


def test_without_run_and_record_the_form_names_both(page):
    page._sidebar.kind.value = "virtual"
    page.reporting._job.start.clicks += 1
    assert page.reporting._job._queue.words == []
    assert "select a run on the left" in page.reporting._problem.object


def test_a_thermal_report_shows_the_selected_run(page, tmp_path):
    assert ordered(page, "thermal", run="cold").run == tmp_path / "runs" / "cold"
    assert ordered(page, "general").run is None
