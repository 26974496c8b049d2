"""Results as text for the terminal."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from heatrun.reports.terminal import discovery_text, result_text
from heatrun.results import DiscoveryResult, FitResult, from_json
from heatrun.results.derived import DerivedFigure
from heatrun.runs.run import Run

STORED = Path(__file__).parents[1] / "stored"


def test_a_large_capacity_has_no_exponent():
    stored = from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "stored")
    second = stored.models["second"]
    large = replace(
        second.parameters["Ceq_sr"], value=151234.0, sd=2600.0, interval_95=(146123.0, 156321.0)
    )
    models = {"second": replace(second, parameters={"Ceq_sr": large})}
    said = result_text(replace(stored, models=models))
    assert re.search(r"Ceq_sr +151230 J/K +95 % 146100 … 156300 ", said)


def test_a_run_at_the_prompt_is_one_line():
    stored = from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "stored")
    said = repr(Run(Path("results") / "runs" / "demo", stored))
    first = stored.tests[0]
    assert said.startswith(f"<Run {Path('results', 'runs', 'demo')}: {stored.motor.name}; ")
    assert "second order" in said
    assert f"{first.name} ({first.role})" in said
    assert len(said) < 300


def test_figures_of_long_names_stand_below_each_other():
    stored = from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "stored")
    second = stored.models["second"]
    entry = second.parameters["Ceq_w"]
    models = {"four": replace(second, parameters={"Ceq_tooth": entry, "Req_winding_tooth": entry})}
    lines = result_text(replace(stored, models=models)).splitlines()
    assert len({line.index("95 %") for line in lines if line.startswith(("  Ceq", "  Req"))}) == 1


def test_a_rating_that_was_asked_for_is_told_or_refused():
    stored = from_json((STORED / "fit-1.json").read_bytes(), FitResult, "fit.json", "stored")
    current = DerivedFigure(
        value=140.279, unit="A", sd=0.74, interval_95=(139.608, 142.139), condition="S2-30, class F"
    )
    no_class = DerivedFigure(refused="no insulation class")
    told = {
        "continuous_current_A": no_class,
        "S2-30_current_A": current,
        "S3-40_current_A": no_class,
    }
    models = {"second": replace(stored.models["second"], derived=told)}
    said = result_text(replace(stored, models=models)).splitlines()
    assert "  S2-30_current_A: 140.3 A  95 % 139.6 … 142.1   S2-30, class F" in said
    assert "  S3-40_current_A: refused, no insulation class" in said
    assert not any("continuous_current_A" in line for line in said)  # nobody asked for it


def test_what_is_missing_is_said_to_be_missing():
    """Below figures of the model after, watts without a word read as what is still missing."""
    stored = from_json(
        (STORED / "discovery-2.json").read_bytes(), DiscoveryResult, "discovery.json", "stored"
    )
    span = stored.where[0]
    lines = discovery_text(replace(stored, where=(span,) * 8)).splitlines()
    place = lines.index("What the network alone misses, with 95 % intervals:")
    assert all(line.startswith(f"  {span.test}, ") for line in lines[place + 1 : place + 7])
    assert lines[place + 7] == "  and 2 more in discovery.pdf"
    assert "alone misses" not in discovery_text(replace(stored, where=()))
