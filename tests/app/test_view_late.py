"""Tabs are rendered when they are first shown, and keep from then on what stands in them."""

import re
import time
from pathlib import Path

import pytest
from bokeh.document import Document
from panel.io.state import set_curdoc
from wire import until

from heatrun_view.store import Folder, RecordStore, UploadRoom
from heatrun_view.tabs.page import Page

WAIT_S = 1.0
"""Many times what it takes to render a tab."""


class Idle:
    """A queue that takes no command."""


def _children(document: Document, title: str) -> list[str]:
    (tab,) = (each for each in document.models if getattr(each, "title", None) == title)
    return [each.id for each in tab.child.children]


# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_a_tab_is_rendered_when_it_is_first_shown_and_stays(shared_folder: Path, tmp_path: Path):
    document = Document()
    with set_curdoc(document):
        room = UploadRoom(tmp_path, 1000)
        page = Page(Folder(shared_folder), tmp_path / "runs", room, RecordStore(), Idle())
        page.view.server_doc(document)
        assert _children(document, "Signals")
        assert not _children(document, "Calibration")
        page.calibrating._name.value = "mine"
        page._tabs.show(page.calibrating.view)
        assert "mine" in [getattr(each, "value", None) for each in document.models]
        rendered = {name: _children(document, name) for name in ("Signals", "Calibration")}
        page._tabs.show(page.signals.view)
        assert {name: _children(document, name) for name in rendered} == rendered
        assert all(rendered.values())
        page._tabs.show(page.calibrating.view)
        assert {name: _children(document, name) for name in rendered} == rendered
        assert not _children(document, "Discovery")


def test_what_was_chosen_typed_and_started_is_there_again(served, tab):
    def to(name: str) -> None:
        tab.locator(".bk-tab", has_text=name).click()

    tab.goto(f"{served.url}?test=duty_30min.csv.gz&test=step_30min.csv.gz")
    tab.locator(".bk-Figure").first.wait_for()
    assert tab.get_by_label("Name of the run").count() == 0
    to("Calibration")
    tab.get_by_label("Network").select_option(label="first order")
    tab.get_by_label("Name of the run").fill("mine")
    tab.locator("#main").get_by_label("step_30min.csv.gz").check()
    tab.get_by_role("button", name="Calibrate").click()
    tab.get_by_role("button", name="Cancel").wait_for()
    tab.get_by_label("Name of the run").evaluate("(each) => { each.is_same = true; }")
    to("Motor file")
    text = tab.get_by_label("Text")
    text.press("Control+End")
    text.press_sequentially("# half a wo")
    to("Signals")
    tab.locator(".bk-Figure").first.wait_for()
    progress = tab.get_by_text(re.compile(r"… \d+ %"))
    progress.wait_for(state="attached")
    before = progress.inner_text()
    progress.filter(has_not_text=before).wait_for(state="attached")

    to("Calibration")
    assert tab.get_by_label("Name of the run").evaluate("(each) => each.is_same") is True
    assert tab.get_by_label("Name of the run").input_value() == "mine"
    assert tab.get_by_label("Network").input_value() == "first order"
    assert tab.locator("#main").get_by_label("step_30min.csv.gz").is_checked()
    tab.get_by_role("button", name="Cancel").click()
    tab.get_by_text("Cancelled.").wait_for()
    to("Motor file")
    assert text.input_value().endswith("# half a wo")
    assert tab.problems == []


def test_a_tab_chosen_while_the_browser_still_builds_the_page_is_rendered_then(served, open_tab):
    tab = open_tab(served.url, is_built=False)
    (tabs,) = tab.models("panel.models.tabs.Tabs")
    titles = [each["attributes"]["title"] for each in tabs["attributes"]["tabs"]]
    tab.change(tabs["id"], "active", titles.index("Discovery"))
    time.sleep(WAIT_S)
    assert "Searches for physical effects" not in tab.document()
    tab.tell_built()
    until(lambda: "Searches for physical effects" in tab.document())
