"""The tab of fleets: what stands in it, what is read for it, and how it looks in a browser."""

import json
import math
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from playwright.sync_api import expect

import heatrun
from heatrun.errors import InputError
from heatrun_view.fleets import Fleet, columns, details, fleets_under, headline, intervals
from heatrun_view.runs import runs_under
from heatrun_view.store import Folder
from heatrun_view.tabs.fleet import FOUND, ODD, POOR, FleetTab

pytest.importorskip("pyarrow")
from rows_of_machines import machine, refused, write_rows

from heatrun_fleet.rows import part_bytes

# The page runs on Panel 1.6 too, which knows only the names that 2.0 will drop.
pytestmark = pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")

HOSTILE = "<img src=x onerror=window.hacked=1>"
NUM, ODD_ONE = 16, 5


def _rows() -> list[dict]:
    rows = [machine(i, covariates={"supplier": "north" if i % 2 else "south"}) for i in range(NUM)]
    rows[ODD_ONE] = machine(ODD_ONE, shift=(0.0, 0.0, 0.0, 0.5))
    warned = json.dumps([{"id": "misfit", "severity": "warning", "message": HOSTILE, "where": "",
                          "remedy": "", "test": ""}])  # fmt: skip
    rows[2] = machine(2, findings=warned, inputs=_inputs("duty_30min.csv.gz"))
    rows[3] = machine(3, inputs=_inputs("elsewhere/gone.csv"))
    return [*rows, refused(NUM, "No losses."), machine(NUM + 1, is_converged=False),
            machine(NUM + 2, machine=HOSTILE, type=HOSTILE)]  # fmt: skip


def _inputs(test: str) -> list[dict]:
    return [{"role": role, "path": path, "sha256": "0" * 64}
            for role, path in (("motor", "motor.toml"), ("calibration", test))]  # fmt: skip


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a fleet, its population, a motor file and a test."""
    folder = tmp_path_factory.mktemp("line")
    data = Path(__file__).parents[2] / "data" / "synthetic"
    for name in ("motor.toml", "duty_30min.csv.gz"):
        shutil.copy(data / name, folder)
    write_rows(folder / "out", _rows())
    heatrun.population(folder / "out", out=folder / "population", type="A")
    return folder


@pytest.fixture
def tab(shown: Path):
    asked: list = []
    found = FleetTab(shown, lambda names, motor: asked.append((names, motor)))
    assert found.list_fleets()
    return SimpleNamespace(tab=found, asked=asked)


def _names(tab: FleetTab) -> list[str]:
    return [tab._source.data["machine"][place] for place in tab._filter.indices]


def test_intervals_are_those_of_the_rows():
    row = machine(0)
    sd = np.sqrt(np.diag(np.reshape(row["log_covariance"], (4, 4))))
    for name, mean, one in zip(row["parameters"], row["log_mean"], sd, strict=True):
        low, value, high = intervals(row)[name]
        np.testing.assert_allclose(
            [low, value, high], np.exp(mean + 1.959964 * one * np.array([-1, 0, 1])), rtol=1e-12
        )
    assert intervals(refused(1, "No losses.")) == {}


def test_a_machine_that_is_unlike_its_type_stands_at_the_end_of_its_strip(shown):
    (fleet,) = fleets_under(shown)
    rows, sisters = fleet.rows(), fleet.sisters()
    data = columns(rows, sisters)
    assert data["verdict"][ODD_ONE] == "does not fit its type"
    assert data["outlier"][ODD_ONE] > 0.9
    assert data["strip"][ODD_ONE][9:] == [100, 100, 100]  # Req_sr, the last of the four
    assert all(0 < place < 100 for place in data["strip"][0][9:])
    assert data["strip"][NUM] == []  # refused
    assert data["value_0"][NUM] == -math.inf
    assert data["text_0"][NUM] == ""
    assert data["warnings"][2] == 1
    assert data["covariates"][1] == "north"
    words = headline(rows, sisters, fleet.is_whole)
    assert f"{NUM + 3} machines" in words
    assert "1 refused" in words
    assert "1 does not fit its type" in words


def test_all_of_a_machine_is_said_and_escaped(shown):
    (fleet,) = fleets_under(shown)
    rows, sisters = fleet.rows(), fleet.sisters()
    odd = details(rows[ODD_ONE], sisters[rows[ODD_ONE]["machine"]])
    assert "given its sisters" in odd
    assert "different: Req_sr" in odd
    assert "No losses." in details(rows[NUM], None)
    for row in (rows[2], rows[-1]):
        assert "<img" not in details(row, None)
        assert "&lt;img" in details(row, None)
    assert "heatrun calibrate motor.toml duty_30min.csv.gz" in details(rows[2], None)


def test_the_table_is_narrowed_down(tab):
    page = tab.tab
    assert len(_names(page)) == NUM + 3
    page._which.value = ODD
    assert _names(page) == [f"M{ODD_ONE:03d}"]
    assert page._grid.height < 100  # as high as its rows
    page._which.value = FOUND
    assert _names(page) == ["M002", f"M{NUM:03d}"]
    page._which.value = POOR
    assert _names(page) == [f"M{NUM:03d}", f"M{NUM + 1:03d}"]
    page._which.value = "all machines"
    page._text.value = "NORTH"
    assert len(_names(page)) == NUM // 2 - 2  # the odd one and the third name no supplier
    page._text.value = ""
    page._type.value = HOSTILE
    assert _names(page) == [HOSTILE]


def test_the_tests_of_the_chosen_machine_are_shown(tab):
    page = tab.tab
    assert not page._button.visible
    page._source.selected.indices = [2]
    assert page._button.visible
    page._button.clicks += 1
    assert tab.asked == [(["duty_30min.csv.gz"], "motor.toml")]
    page._source.selected.indices = [3]
    page._button.clicks += 1
    assert len(tab.asked) == 1
    assert "no longer there" in page._details.object


def test_a_fleet_in_the_making_is_shown_as_far_as_it_is(tmp_path):
    parts = tmp_path / "out" / "parts"
    parts.mkdir(parents=True)
    old, new = machine(1, rmse_K=1.0), machine(1, rmse_K=2.0)
    (parts / "f.parquet").write_bytes(part_bytes([old]))
    os.utime(parts / "f.parquet", (1.0, 1.0))
    page = FleetTab(tmp_path.resolve(), lambda names, motor: None)
    assert page.list_fleets()
    assert "being worked out" in page._said.object
    (parts / "a.parquet").write_bytes(part_bytes([new, machine(0)]))
    page.look(at_once=True)
    assert _names(page) == ["M000", "M001"]
    assert page._source.data["rmse"][1] == 2.0  # of another run, since, of the same machine
    write_rows(tmp_path / "out", [new, machine(0)])
    page.look(at_once=True)
    assert "being worked out" not in page._said.object
    assert _names(page) == ["M001", "M000"]  # in the order of the fleet file


@pytest.mark.parametrize("content", [b"", b"PAR1 no table", b"time_s\n0\n"])
def test_a_damaged_file_is_said(tmp_path, content):
    (tmp_path / "machines.parquet").write_bytes(content)
    page = FleetTab(tmp_path.resolve(), lambda names, motor: None)
    assert page.list_fleets()
    assert "machines.parquet" in page._said.object
    with pytest.raises(InputError, match="Expected"):
        page.fleets[0].rows()


def test_a_population_of_other_rows_says_nothing_of_these(shown, tmp_path):
    shutil.copytree(shown / "population", tmp_path / "population")
    write_rows(tmp_path / "out", _rows()[:-1])
    (fleet,) = fleets_under(tmp_path.resolve())
    assert fleet.populations
    assert fleet.sisters() == {}
    assert Fleet(shown / "out", shown).sisters()


def test_links_out_of_the_folder_are_not_followed(shown, tmp_path):
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "machines.parquet").symlink_to(shown / "out" / "machines.parquet")
    assert fleets_under((tmp_path / "bench").resolve()) == []


def test_a_fleet_is_no_run_and_its_files_are_no_tests(shown):
    assert runs_under([(shown, shown)]) == []
    assert Folder(shown).list().tests == ("duty_30min.csv.gz",)


def test_a_fleet_in_a_browser(shown, tmp_path, served_class, warm, browser):
    folder = tmp_path / "line"
    shutil.copytree(shown, folder)
    server = served_class(folder, warm=warm)
    try:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(120_000)
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", lambda said: problems.append(said.text) if said.type == "warning" else 0)
        page.goto(server.url)
        page.wait_for_function("() => window.Bokeh?.documents[0]?.is_idle")
        page.locator(".bk-tab", has_text="Fleet").click()
        rows = page.locator(".slick-row")
        rows.first.wait_for()
        page.locator(".slick-header-column", has_text="P(outlier)").click()
        page.locator(".slick-header-column", has_text="P(outlier)").click()  # the largest first
        rows.nth(0).get_by_text(f"M{ODD_ONE:03d}").wait_for()
        expect(rows.nth(0).locator("svg circle")).to_have_count(4)
        rows.nth(0).locator(".slick-cell").first.click()
        page.get_by_text("different: Req_sr").wait_for()
        page.get_by_label("Name or covariate holds").fill("<img")
        page.keyboard.press("Enter")
        page.get_by_text("Choose a machine in the table.").wait_for()
        rows.nth(0).get_by_text(HOSTILE).first.wait_for()
        rows.nth(0).locator(".slick-cell").first.click()
        page.locator("h3", has_text=HOSTILE).wait_for()
        assert page.evaluate("window.hacked") is None
        page.get_by_label("Name or covariate holds").fill("M002")
        page.keyboard.press("Enter")
        rows.nth(0).get_by_text("M002").wait_for()
        rows.nth(0).locator(".slick-cell").first.click()
        page.get_by_role("button", name="Show its tests").click()
        page.locator(".bk-Figure").first.wait_for()
        expect(page.get_by_label("duty_30min.csv.gz").first).to_be_checked()
        assert problems == []
    finally:
        server.close()
