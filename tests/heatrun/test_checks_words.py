"""What a finding says fits the record: what is known, how long it is, what is missing."""

from __future__ import annotations

from dataclasses import replace

from heat_runs import CLEAN, LINK, MOTOR, changed, heat_run, named, without

from heatrun.checks import check_record, excitation
from heatrun.checks.quick_fit import quick_fit
from heatrun.checks.suspicion.which_unit import read_as
from heatrun.readers.joined import parts_of
from heatrun.record.motor import PartsOfTest
from heatrun.record.record import ColumnReading, Finding
from heatrun.record.stretch import Stretch, cut


def test_a_long_test_is_not_called_too_short_for_its_length(monkeypatch):
    """Sixty minutes, a constant of some 900 s known to a factor of 1.6: four of them, not two."""
    record = heat_run(4, 60.0, step_s=1.0)
    quick = quick_fit(record, MOTOR)
    assert quick is not None
    unsure = replace(quick, taus_s=(60.0, 900.0), log_sd=0.5)
    monkeypatch.setattr(excitation, "quick_fit", lambda *_: unsure)
    monkeypatch.setattr(excitation, "settling_constants", lambda *_: 0.0)
    (finding,) = named(check_record(record, MOTOR), "too_short")
    assert finding.severity == "warning"
    assert "at least two" not in finding.message
    assert "between 331 and 2446 s" in finding.message


def test_reader_findings_come_first():
    own = Finding("reader", "note", "Seen by the reader.")
    found = check_record(replace(CLEAN, findings=(own,)), MOTOR)
    assert found[0] == replace(own, test="run")
    assert len(found) > 1


def test_a_missing_loss_is_told_beside_the_power_of_the_link():
    record = without(without(LINK, "losses_W"), "phase_current_A")
    motor = replace(MOTOR, losses="map")  # of which the copper loss is no part
    found = {f.where: f.remedy for f in named(check_record(record, motor), "missing_channel")}
    assert "torque_Nm" in found["run, losses_W"]
    assert "[constants] speed_rpm = 0" in found["run, losses_W"]
    assert "dc_current_A is not" in found["run, phase_current_A"]
    plain = named(check_record(without(CLEAN, "losses_W"), MOTOR), "missing_channel")
    assert "torque_Nm" not in plain[0].remedy


def test_a_test_of_seconds_is_told_that_it_is_short():
    cooling = heat_run(start=90.0, currents=(0.0, 0.0), minutes=0.12)
    (finding,) = named(check_record(cooling, MOTOR), "no_heating")
    assert finding.severity == "error"
    assert "lasts 7 s" in finding.message


def test_a_measured_stator_is_not_called_unknown():
    warm = heat_run(start=35.0)
    (alone,) = named(check_record(warm, MOTOR), "start_not_in_equilibrium")
    assert "is then unknown" in alone.message
    known = changed(warm, stator_degC=warm["winding_degC"])
    (beside,) = named(check_record(known, MOTOR), "start_not_in_equilibrium")
    assert "the stator" not in beside.message
    assert "Map `stator_degC`" not in beside.remedy


def test_a_test_that_is_cut_while_warm_is_told_how_its_stator_can_be_known():
    (finding,) = named(
        check_record(cut(CLEAN, Stretch(1800.0), "asked for"), MOTOR), "cut_while_warm"
    )
    assert "is not simulated" in finding.message
    assert "mask = [[60, 1800]] under [tests.NAME]" in finding.remedy
    begin = parts_of(CLEAN, replace(MOTOR, tests={"run": PartsOfTest(mask=((60.0, 1800.0),))}))
    assert not named(check_record(begin[0], MOTOR), "cut_while_warm")


def test_coolant_replaces_ambient_where_it_is_the_sink():
    record = changed(without(CLEAN, "ambient_degC"), coolant_degC=CLEAN["ambient_degC"])
    assert named(check_record(record, MOTOR), "missing_channel")
    cooled = replace(MOTOR, sink="coolant")
    assert not [f for f in check_record(record, cooled) if f.severity != "note"]


def test_a_plain_ampere_is_not_said_to_be_stated_as_rms():
    current = ColumnReading("phase_current_A", "I [A]", "A_rms", "stated", "[columns]", "t.csv")
    assert read_as(current).endswith("a plain A counts as rms")
    peak = replace(current, unit="A_peak")
    assert read_as(peak) == "A_peak, as the file or [columns] states"
    assert read_as(replace(current, unit_from="assumed")) == "A_rms, assumed, no unit given"
