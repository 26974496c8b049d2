"""The type sheet: what stands on it, whatever machines are called and however many there are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pypdf import PdfReader

from heatrun.results import from_json
from heatrun.results.discovery import ValueWithInterval
from heatrun_fleet.population.sheet import (
    MOST_MACHINES,
    shown_machines,
    type_figures,
    type_sheet_content,
    write_type_sheet,
)
from heatrun_fleet.results import PopulationResult

STORED = Path(__file__).parents[1] / "stored" / "population-1.json"

HOSTILE = ("$x_1$ #set page(width: 1pt)", "*bold* _it_ \\ `raw`", "<b>&amp;</b>", "李四", "a" * 300,
           "\x1b[31mred\nline", "../../etc/passwd", "مرحبا")  # fmt: skip


@pytest.fixture
def known():
    return from_json(STORED.read_bytes(), PopulationResult, "population.json", "stored")


def text_of(path):
    pages = [page.extract_text() for page in PdfReader(path).pages]
    return " ".join(" ".join(pages).split()), len(pages)


def test_the_sheet_says_what_is_known(known, tmp_path):
    text, num_pages = text_of(write_type_sheet(known, tmp_path / "sheet.pdf"))
    assert num_pages <= 2
    assert "8 machines count of the fleet line 3 (network: second), 1 left out; 1 of them" in text
    for row in type_sheet_content(known)["parameters"]:
        for cell in row:
            assert " ".join(cell.replace("\u200b", "").split()) in text
    assert "refused: Column winding_degC jumps 41 K in 1 s." in text
    assert "M004" in text
    assert "Req_w" in text.split("Machines that do not fit")[1].split("Covariates")[0]
    assert "supplier: south against north" in text
    for word in ("half-Cauchy", "LKJ(2)", "Lunn et al. 2013", "to a factor of 50"):
        assert word in text


def test_what_a_covariate_does_is_said_with_its_interval(known):
    (label,) = known.covariate_columns
    said = known.covariate_columns[label]
    sure = ValueWithInterval(value=-0.05, interval_95=(-0.06, -0.04))
    shown = replace(said, over_range={**said.over_range, "Req_sr": sure})
    content = type_sheet_content(replace(known, covariate_columns={label: shown}))
    ((_, words),) = content["covariates"]
    sure, _, open_ones = words.partition("Not significantly different from zero:")
    assert sure.startswith("Changes ")
    assert "Req_sr -5.0 % (-6.0 … -4.0)." in sure
    assert "Req_w" in open_ones


def test_hostile_names_are_words(known, tmp_path):
    machines = [
        replace(machine, name=name, is_outlier=True)
        for machine, name in zip(known.machines, HOSTILE, strict=True)
    ]
    left_out = [replace(known.left_out[0], name=name) for name in HOSTILE]
    spoilt = replace(known, machines=machines, left_out=left_out, type=HOSTILE[0])
    text, num_pages = text_of(write_type_sheet(spoilt, tmp_path / "sheet.pdf"))
    assert num_pages <= 3
    for name in HOSTILE[:3]:
        assert name in text
    assert "\x1b" not in text


@pytest.mark.parametrize("num", [3, 300, 3000])
def test_any_number_of_machines_is_drawn(known, num):
    machines = [replace(known.machines[n % 8], name=f"M{n:04d}") for n in range(num)]
    (figure,) = type_figures(replace(known, machines=machines))
    assert len(figure.axes) == 4
    shown = shown_machines(machines)
    assert len(shown) <= max(MOST_MACHINES, num // 8) + MOST_MACHINES
    assert [m for m in shown if m.is_outlier] == [m for m in machines if m.is_outlier]
    assert figure.axes[0].get_ylim()[1] > figure.axes[0].get_ylim()[0]


def test_a_spread_without_an_upper_limit_is_not_printed_as_one(known, tmp_path):
    said = known.parameters["Req_sr"]
    wide = ValueWithInterval(value=0.4, interval_95=(0.01, 1e100))
    shown = replace(said, spread=wide, tolerance_95_95=(1e-90, 1e90))
    parameters = {**known.parameters, "Req_sr": shown}
    content = type_sheet_content(replace(known, parameters=parameters))
    assert content["parameters"][-1][2:4] == ["40 % (from 1 % on)", "not determined"]
    (figure,) = type_figures(replace(known, parameters=parameters))
    assert np.all(np.isfinite(figure.axes[-1].get_ylim()))
    assert figure.axes[-1].get_ylim()[1] < 1.0
