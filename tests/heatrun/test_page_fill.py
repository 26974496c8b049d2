"""Pages of the reports are filled: no last page that is nearly empty, figures not too small."""

from __future__ import annotations

from pathlib import Path

import pytest
from page_fill import fill_of_pages

from heatrun.motor.file import load_motor
from heatrun.reports.pdf import HEIGHTS, filling_height, typeset
from heatrun_reports import make_report
from heatrun_reports.document import TEMPLATE
from heatrun_reports.prototypes.report import make_prototypes_report

SYNTHETIC = Path(__file__).parents[2] / "data" / "synthetic"
PROTOTYPES = SYNTHETIC / "prototypes"
BENCH = PROTOTYPES / "Test_2024_03_05_001.csv.gz"
ROAD = PROTOTYPES / "Road_2024_03_05_001.csv.gz"

ENOUGH = 0.5
"""Share of the height of a last page that has to be used."""


@pytest.mark.parametrize(
    ("kind", "reference", "num_pages"),
    [("general", None, 2), ("energy", None, 2), ("real", ROAD, 3)],
)
def test_the_last_page_of_a_report_of_the_bundled_drive_is_filled(
    kind, reference, num_pages, tmp_path
):
    motor = load_motor(PROTOTYPES / "motor.toml")
    (outcome,) = make_report(kind, motor, [BENCH], tmp_path, reference=reference)
    pages = fill_of_pages(outcome.pdf)
    assert len(pages) <= num_pages
    assert min(pages) >= ENOUGH


def test_the_last_page_of_the_thermal_report_is_filled(tmp_path):
    motor = load_motor(SYNTHETIC / "motor.toml")
    (outcome,) = make_report("thermal", motor, [SYNTHETIC / "step_90min.csv.gz"], tmp_path)
    assert min(fill_of_pages(outcome.pdf)) >= ENOUGH


def test_the_last_page_of_the_report_on_prototypes_is_filled(tmp_path):
    motor = load_motor(PROTOTYPES / "motor.toml")
    outcome = make_prototypes_report(motor, [("semi-real", BENCH), ("real", ROAD)], tmp_path)
    assert min(fill_of_pages(outcome.pdf)) >= ENOUGH


def _content(num_tables: int) -> dict:
    table = {"title": "t", "head": ["", "a"], "lines": [["x", "1"]] * 10, "notes": []}
    return {
        "version": "", "title": "t", "heading": "h", "test": "test", "summary": "s", "meta": [],
        "rows": [["a", "1", "W", ""]], "tables": [table] * num_tables,
        "captions": ["c"] * 3, "findings": [], "definitions": [["d", "e"]],
        "labels": dict.fromkeys(("findings", "definitions", "page", "of"), "l"), "remark": "",
    }  # fmt: skip


def test_figures_are_drawn_lower_or_higher_for_the_sake_of_the_last_page():
    # three figures of 3 in and the head go just beyond a page of 11.7 in less its margins
    lower = filling_height(TEMPLATE, _content(0), [(7.2, 3.0)] * 3)
    assert min(HEIGHTS) <= lower < 1.0
    # of three of 4.4 in the third has a page for itself and fills 0.4 of it
    higher = filling_height(TEMPLATE, _content(0), [(7.2, 4.4)] * 3)
    assert 1.0 < higher <= max(HEIGHTS)


def test_where_nothing_is_drawn_the_heights_are_left_alone(tmp_path):
    content = {**_content(6), "captions": []}
    assert filling_height(TEMPLATE, content, []) == 1.0
    assert typeset(TEMPLATE, content, [], tmp_path / "a.pdf").exists()
