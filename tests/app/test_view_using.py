"""The tab “Simulate and export”: the commands that it starts, and what it hands out of them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from heatrun.cli import _parser
from heatrun.errors import InputError
from heatrun_view.store import Folder, RecordStore
from heatrun_view.tabs.page import Page
from heatrun_view.uploads import UploadRoom

# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")


class Told:
    """A queue that keeps the words it is given and takes no command."""

    words: list[str] = []  # noqa: RUF012

    def submit(self, words: list[str]) -> None:
        self.words = list(words)
        raise InputError("Nothing is run here.")


@pytest.fixture
def queue() -> Told:
    return Told()


@pytest.fixture
def page(folder: Path, tmp_path: Path, queue: Told) -> Page:
    (tmp_path / "runs" / "cold").mkdir(parents=True)
    (tmp_path / "runs" / "cold" / "manifest.json").write_text("{}")
    (tmp_path / "sent").mkdir()
    sent = UploadRoom(tmp_path / "sent", 1000)
    page = Page(Folder(folder), tmp_path / "runs", sent, RecordStore(), queue)
    page._sidebar.tests.value = ["duty_30min.csv.gz"]
    return page


def _press(page: Page, name: str) -> None:
    (button,) = page.using.view.select(lambda each: getattr(each, "name", "") == name)
    button.clicks += 1


def test_the_commands_are_those_of_the_command_line(page, queue, folder, tmp_path):
    _press(page, "Simulate")
    assert queue.words == []  # no run is chosen
    page._sidebar.run.value = "cold"
    _press(page, "Simulate")
    options = _parser().parse_args(queue.words)
    assert options.tests == [folder / "duty_30min.csv.gz"]
    assert (options.motor, options.source) == (folder / "motor.toml", str(tmp_path / "runs/cold"))
    assert options.out == tmp_path / "simulated"
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert str(tmp_path / "runs/cold") in queue.words
    assert (options.to, options.out) == ("mat", tmp_path / "exported" / "cold")


def test_a_new_test_is_exported_with_the_parameters_of_a_run(page, queue, folder, tmp_path):
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
        tmp_path / "runs/cold",
        [folder / "step_30min.csv.gz"],
    )
    assert options.out == tmp_path / "exported" / "cold_step_30min"
    assert (options.motor, options.corrected) == (None, False)

    options.out.mkdir(parents=True)  # as a first export leaves it
    form._motor.value = form._motor.options[1]
    form._corrected.value = True
    page._sidebar.tests.value = ["duty_30min.csv.gz", "step_30min.csv.gz"]
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert options.tests == [folder / "duty_30min.csv.gz", folder / "step_30min.csv.gz"]
    assert options.out == tmp_path / "exported" / "cold_duty_30min_and_1_more"
    assert (options.motor, options.corrected) == (folder / "motor.toml", True)
    page._sidebar.tests.value = ["step_30min.csv.gz"]
    _press(page, "Export")
    assert _parser().parse_args(queue.words).out == tmp_path / "exported" / "cold_step_30min-2"
    form._tests.value = form._tests.options[0]
    _press(page, "Export")
    options = _parser().parse_args(queue.words)
    assert (options.tests, options.motor) == ([], None)


def test_what_was_exported_is_said_and_handed_out(page, tmp_path):
    written = tmp_path / "exported" / "cold_duty"
    written.mkdir(parents=True)
    (written / "prova.mat").write_bytes(b"MATLAB")
    one = {
        "files": [str(written / "prova.mat")], "test": "<b>", "title": "second order",
        "effects": [], "rmse_K": 0.3,
        "findings": [{"message": "<i>", "remedy": "Pass --corrected."}],
    }  # fmt: skip
    for output, num in ((one, 1), ({"exports": [one, one]}, 2)):
        made: list = []
        page.using._show_exported(SimpleNamespace(output=output), made)
        assert len(made) == 2 * num
        said, files = made[:2]
        assert "<b>" not in said.object
        assert "<i>" not in said.object
        assert "Pass --corrected." in said.object
        assert files[0].callback().read() == b"MATLAB"


def test_only_files_of_their_folder_are_handed_out(page, tmp_path):
    (tmp_path / "simulated").mkdir()
    (tmp_path / "simulated" / "a_virtual.csv").write_text("time_s\n0\n")
    (tmp_path / "secret.csv").write_text("secret")
    rows = [
        {"test": "<b>", "network": "second", "effects": [], "rmse_K": None, "file": str(file)}
        for file in (tmp_path / "simulated" / "a_virtual.csv", tmp_path / "secret.csv")
    ]
    shown: list = []

    class Place:
        def __setitem__(self, key: slice, value: list) -> None:
            shown.extend(value)

    page.using._show_simulated(SimpleNamespace(output={"simulated": rows}), Place())
    said, files = shown
    assert "<b>" not in said.object
    inside, outside = files
    assert inside.callback().read() == b"time_s\n0\n"
    assert b"secret" not in outside.callback().read().replace(b"secret.csv", b"")
