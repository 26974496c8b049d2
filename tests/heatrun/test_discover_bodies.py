"""A discovery looks at the winding alone, and says so where more was measured."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest
from measured_machine import measured_record

import heatrun
from heatrun.bench.reduction import reduce
from heatrun.discovery.bodies import bodies_finding, bodies_sentence, unsearched_bodies
from heatrun.inference.model import Model


@pytest.fixture(scope="module")
def record(generator):
    return measured_record(generator, generator.duty(1800.0), 73)


def test_a_body_that_a_calibration_would_fit_is_said_to_be_left_out(record, motor):
    test = reduce(record, motor)
    model = Model.of("second", motor)
    assert unsearched_bodies(model, [test]) == ("stator_degC",)
    finding = bodies_finding(("stator_degC",))
    assert finding is not None
    assert "stator_degC took no part" in finding.message
    assert "heatrun calibrate --with" in finding.remedy
    assert "stator_degC was measured" in bodies_sentence(("stator_degC",))


def test_a_body_that_no_calibration_fits_is_not(record, motor):
    test = reduce(record, motor)
    assert unsearched_bodies(Model.of("first", motor), [test]) == ()
    held_against = replace(motor, sensors={"stator_degC": "none"})
    assert unsearched_bodies(Model.of("second", held_against), [test]) == ()
    alone = replace(test, bodies=())
    assert unsearched_bodies(Model.of("second", motor), [alone]) == ()
    assert bodies_sentence(()) == ""
    assert bodies_finding(()) is None


@pytest.mark.slow
def test_verdict_and_sheet_of_a_discovery_say_so(record, tmp_path):
    pd.DataFrame(record.channels).to_csv(tmp_path / "duty.csv", index=False)
    text = '[motor]\nname = "bench"\n[winding]\nphase_resistance_ohm = 0.0062\n'
    (tmp_path / "motor.toml").write_text(text)
    motor, test = tmp_path / "motor.toml", tmp_path / "duty.csv"
    found = heatrun.discover(motor, test, method="quick", out=tmp_path / "found")
    assert "the winding alone: stator_degC was measured" in found.result.sentence
    (finding,) = [f for f in found.run.findings if f.id == "bodies_not_searched"]
    assert finding.severity == "note"
