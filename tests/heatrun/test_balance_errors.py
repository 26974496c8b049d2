"""What the inputs of a test tell of its torque and powers, at load and at standstill."""

from dataclasses import replace

import numpy as np
import pytest
from heat_runs import changed, checked
from measured_machine import measured_record
from recovered import holds, sd

from heatrun.checks import check_record, current_scale_unchecked, standstill_losses
from heatrun.export import Corrections
from heatrun.fit.fit import fit
from heatrun.model.bodies import corrected_losses, shaft_errors
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.posterior.driven import virtual_record
from heatrun.posterior.posterior import normal_draws
from heatrun.posterior.predict import predict
from heatrun.record.balance_errors import Told, together, told_by_inputs
from heatrun.record.derive import BY_CONSTANTS
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import ColumnReading, Record
from heatrun.record.reduction import reduce
from heatrun.runs.machine import tested as seen_in

GAIN = 0.05
NUM_LOADS = 16
LENGTH_S = 5400.0
"""Of all tests, so that they share what is compiled [s]."""


@pytest.fixture(scope="module")
def driven(generator):
    """A staircase, with a torque of the scale of the electrical power."""
    return measured_record(
        generator, generator.staircase(LENGTH_S), 82, "driven", stator=False, shaft_gain=0.0
    )


@pytest.fixture(scope="module")
def both_ways(generator):
    """Loads that last for some minutes, as a motor more often than not, and 5 % off in torque."""
    rng = np.random.default_rng(6)
    loads = [
        generator.Segment(float(length), float(torque), float(speed))
        for length, torque, speed in zip(
            rng.integers(120, 500, NUM_LOADS), rng.uniform(-0.6, 0.9, NUM_LOADS),
            rng.uniform(0.3, 1.0, NUM_LOADS), strict=True,
        )
    ]  # fmt: skip
    rest_s = LENGTH_S - 60.0 - sum(load.duration_s for load in loads)
    rests = [generator.Segment(length, 0.0, 0.0) for length in (60.0, rest_s)]
    profile = generator.Profile((rests[0], *loads, rests[1]))
    return measured_record(generator, profile, 83, "both ways", stator=False, shaft_gain=GAIN)


def without_readings(record):
    """The record, its winding held at the reading after a minute."""
    winding = record["winding_degC"].copy()
    winding[60:] = winding[60]
    return changed(record, winding_degC=winding)


def fitted(motor, *records):
    tests = [reduce(record, motor) for record in records]
    return fit(Problem.of(Model.of("second", motor), motor, tests))


def errors(posterior, record, motor, **known):
    """RMSE of the held-out prediction [K], and share of the readings inside its 95 % band [1]."""
    test = replace(reduce(without_readings(record), motor), **known)
    found = predict(posterior, test)
    measured = reduce(record, motor).measured
    low, high = found.total["95"]
    inside = float(np.mean((measured >= low) & (measured <= high)))
    return float(np.sqrt(np.mean((measured - found.median) ** 2))), inside


@pytest.fixture(scope="module")
def calibrated(driven, motor):
    return normal_draws(fitted(motor, driven))


def test_a_held_out_test_takes_its_gain_from_its_own_inputs(calibrated, both_ways, motor):
    rmse_K, inside = errors(calibrated, both_ways, motor)
    assert rmse_K < 1.5  # 0.9 K
    assert inside > 0.9
    rmse_K, inside = errors(calibrated, both_ways, motor, told=())
    assert rmse_K > 5.0
    assert inside < 0.5


def test_a_fitted_test_has_its_own_gain_and_leaves_the_shared_one(driven, both_ways, motor, truth):
    found = fitted(motor, driven, both_ways)
    values = found.values()
    assert values["own_shaft_power_gain[both ways]"] == pytest.approx(GAIN, abs=0.002)
    assert abs(values["shaft_power_gain"]) < 0.01
    holds(found, truth)


def test_the_temperature_of_the_winding_is_not_looked_at(both_ways, motor):
    assert told_by_inputs(both_ways, motor) == told_by_inputs(without_readings(both_ways), motor)


def finding(record, motor):
    (found,) = checked(record, motor, "shaft_power_disagrees")
    return found


@pytest.mark.parametrize(
    ("said", "is_own", "words"),
    [
        (None, True, "takes shaft_power_gain = 0.0"),
        (ParameterOverride(sd=0.01), True, "fixed = 0"),
        (ParameterOverride(value=-0.02), True, "takes shaft_power_gain"),
        (ParameterOverride(fixed=0.0), False, "The motor file holds shaft_power_gain at 0"),
        (ParameterOverride(sd=0.03), False, ""),  # the prior allows for it
        (ParameterOverride(value=0.05), False, ""),
    ],
)
def test_the_motor_file_may_state_otherwise(said, is_own, words, both_ways, motor):
    if said is not None:
        motor = replace(motor, parameters={"shaft_power_gain": said})
    assert bool(reduce(both_ways, motor).told) == is_own
    if words:
        assert words in finding(both_ways, motor).sentence()
    else:
        assert told_by_inputs(both_ways, motor) == ()


def with_errors(record, *, watts=0.0, torque_Nm=0.0, way=1.0):
    """The record with errors of power and torque, and with another direction of rotation."""
    speed, torque = way * record["speed_rpm"], way * record["torque_Nm"]
    losses = record["losses_W"] + watts - torque_Nm * speed * np.pi / 30.0
    return changed(record, speed_rpm=speed, torque_Nm=torque + torque_Nm, losses_W=losses)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({}, {}),
        ({"watts": -70.0}, {"shaft_power_offset": -70.0}),
        ({"torque_Nm": 1.4}, {"torque_offset": -1.4}),
        ({"torque_Nm": 0.07}, {}),  # the prior allows for it
        ({"way": True}, {}),
        ({"way": True, "torque_Nm": 0.4}, {"torque_offset": -0.4}),
    ],
)
def test_standstill_and_both_directions_of_rotation_show_offsets(wrong, told, driven, motor):
    turns = np.where(driven.time_s // 230.0 % 2 < 1, 1.0, -1.0)
    record = with_errors(driven, **{**wrong, **({"way": turns} if "way" in wrong else {})})
    found = {each.name: each.mean for each in reduce(record, motor).told}
    assert found == pytest.approx(told, rel=0.01)


def test_a_held_out_test_takes_the_zero_of_its_torque(calibrated, driven, motor):
    record = with_errors(driven, torque_Nm=1.4)
    rmse_K, inside = errors(calibrated, record, motor)
    assert rmse_K < 1.5
    assert inside > 0.9
    assert errors(calibrated, record, motor, told=())[0] > 5.0


def test_what_several_tests_tell_of_one_instrument_is_held_against_each_other():
    """One zero of the torque: the test that shows it well helps the one that shows it badly."""

    def told(mean, sd, name="torque_offset"):
        return Told(name, mean, sd, 0.1, "")

    well, badly, other = told(-1.40, 0.01), told(-1.10, 0.3), told(0.05, 0.01, "shaft_power_gain")
    one, two = together([(well, other), (badly,)])
    assert one[1] == pytest.approx(other)
    assert one[0].mean == pytest.approx(-1.40, abs=0.005)
    assert two[0].mean == pytest.approx(-1.40, abs=0.01)
    assert two[0].sd == pytest.approx(0.03, rel=0.02)  # a zero drifts by 0.02, that of each test
    # a zero that was set in between
    (first,), (second,) = together([(well,), (told(-0.2, 0.01),)])
    assert (first.mean, second.mean) == pytest.approx((-1.4, -0.2), abs=0.01)
    assert together([(badly,), ()]) == [(badly,), ()]
    # draws at one value, as of a run whose losses count as known, tell it without a scatter
    (exact,), (again,) = together([(told(0.3, 0.0),), (well,)])
    assert exact.mean == pytest.approx(0.3, abs=0.01)
    assert 0.0 < exact.sd < well.sd
    assert np.isfinite(again.mean)


def test_a_held_out_test_is_told_its_zero_by_the_fitted_ones_too(driven, motor):
    off = with_errors(driven, torque_Nm=1.4)
    posterior = normal_draws(fitted(motor, off))
    alone = reduce(without_readings(replace(off, name="other")), motor)
    (told,) = alone.told
    poor = replace(alone, told=(told._replace(sd=20.0 * told.sd, mean=told.mean + 10.0 * told.sd),))
    seen = predict(posterior, poor).values["own_torque_offset"]
    assert float(np.mean(seen)) == pytest.approx(-1.4, abs=0.03)
    assert float(np.std(seen)) < 0.3 * poor.told[0].sd


def test_losses_below_zero_are_not_told_beside_the_error_that_makes_them_so(driven, motor):
    def severities(torque_Nm):
        found = check_record(with_errors(driven, torque_Nm=torque_Nm), motor)
        return {f.severity for f in found if f.id in ("losses_negative", "losses_below_copper")}

    assert severities(4.0) == set()
    held = replace(motor, parameters={"torque_offset": ParameterOverride(fixed=0.0)})
    assert "error" in {f.severity for f in check_record(with_errors(driven, torque_Nm=4.0), held)}


def test_losses_of_zero_or_less_are_said_in_words(driven, motor):
    record = changed(driven, losses_W=-np.abs(driven["losses_W"]))
    (finding, *_) = checked(record, motor, "losses_below_copper")
    assert "they are zero or less" in finding.message


def test_an_export_is_corrected_by_the_tests_own_errors():
    values = {"shaft_power_gain": 0.001, "own_shaft_power_gain": 0.05, "torque_offset": 0.2}
    corrections = Corrections.of(values)
    assert (corrections.shaft_power_gain, corrections.torque_offset) == (0.05, 0.2)


@pytest.mark.parametrize("wrong", [{}, {"watts": -70.0}, {"torque_Nm": 1.4}])
def test_the_losses_of_ratings_are_without_the_tests_own_errors(wrong, driven, motor):
    spoilt, right = (reduce(with_errors(driven, **w), motor) for w in (wrong, {}))
    np.testing.assert_allclose(corrected_losses(spoilt), right.inputs.losses, atol=5.0)
    loads = [float(seen_in([test]).loaded.losses) for test in (spoilt, right)]
    assert loads[0] == pytest.approx(loads[1], abs=5.0)


LATE_GAIN = 0.015


@pytest.fixture(scope="module")
def record(generator):
    """A staircase as a motor, and after it as a generator."""
    up = generator.staircase(0.5 * LENGTH_S)
    down = [replace(segment, torque=-segment.torque) for segment in up.segments]
    profile = generator.Profile((*up.segments, *down))
    return measured_record(generator, profile, 81, stator=False, shaft_gain=LATE_GAIN)


@pytest.fixture(scope="module")
def found(record, motor):
    return fitted(motor, record)


def test_the_gain_is_found_with_the_torque_and_explained_by_nothing_without(
    found, record, motor, truth
):
    holds(found, truth | {"shaft_power_gain": LATE_GAIN})
    assert sd(found, "shaft_power_gain") < 0.3  # of the prior
    channels = {name: v for name, v in record.channels.items() if name != "torque_Nm"}
    blind = fitted(motor, replace(record, channels=channels))
    assert "shaft_power_gain" not in blind.problem.parameters.names
    assert float(blind.noise.heat) > 3.0 * float(found.noise.heat)


def test_a_map_of_losses_knows_no_mechanical_power(record, motor):
    model = Model.of("second", replace(motor, losses="map"))
    names = Problem.of(model, replace(motor, losses="map"), [reduce(record, motor)]).parameters
    assert "shaft_power_gain" not in names.names


MOTOR = Motor("reference", phase_resistance_ohm=0.02)
STANDS_S = 900.0


def locked(minutes: float = 15.0, *, current_gain: float = 1.0, power_gain: float = 1.0) -> Record:
    """A winding that warms from 20 to 50 degC under 60 A at standstill, then turns under 80 A."""
    rng = np.random.default_rng(4)
    time_s = np.arange(0.0, 2400.0)
    stands = time_s < 60.0 * minutes
    winding = 20.0 + 30.0 * (1.0 - np.exp(-time_s / 600.0))
    current = np.where(stands, 60.0, 80.0)
    # copper at 25 degC with B = 234.5: 3 * 0.02 * (234.5 + T)/259.5 * I^2
    copper = 3.0 * 0.02 * (234.5 + winding) / 259.5 * current**2
    return Record(
        "locked",
        {
            "time_s": time_s,
            "phase_current_A": current_gain * current + 0.1 * rng.standard_normal(time_s.size),
            "losses_W": power_gain * (copper + np.where(stands, 0.0, 150.0)),
            "ambient_degC": np.full(time_s.size, 20.0),
            "winding_degC": winding,
            "speed_rpm": np.where(stands, 0.0, 3000.0) + 0.2 * rng.standard_normal(time_s.size),
        },
    )


def seen(record: Record, motor: Motor = MOTOR):
    return list(standstill_losses(record, motor))


def test_a_standstill_that_agrees_says_how_well_it_checks_the_scales():
    (finding,) = seen(locked())
    assert finding.severity == "note"
    assert finding.values["ratio"] == pytest.approx(1.0, abs=0.002)
    # by hand: power 1 %, twice 0.5 % of current, Rs0 1 %; sensor hypot(1 K, 5 % of 16 K) at 36 degC
    # 1.28/271 = 0.47 %; offset of the power meter 0.05 % of 540 W in 227 W = 0.12 %
    assert finding.values["ratio_sd"] == pytest.approx(0.0180, rel=0.03)
    assert finding.values["current_A"] == pytest.approx(60.0, rel=1e-3)
    assert "allow 3.6 % (95 %)" in finding.message


@pytest.mark.parametrize("gain", [0.97, 1.03])
def test_a_current_off_by_three_percent_is_seen_twice_as_large(gain):
    (finding,) = seen(locked(current_gain=gain))
    assert finding.severity == "warning"
    assert finding.values["ratio"] == pytest.approx(1.0 / gain**2, abs=0.002)
    assert f"reading 3.0 % too {'low' if gain < 1 else 'high'}" in finding.remedy


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        (0.5, "half that of one phase"),
        (2.0 / 3.0, "one phase beside two, as between terminals of a delta"),
        (1.5, "one phase and two beside each other"),
        (2.0, "two phases in series, as between terminals of a star"),
    ],
)
def test_a_standstill_tells_of_what_the_stated_resistance_is(stated, said):
    """Losses, or voltages times currents, over three squared currents are ohms of one phase."""
    motor = replace(MOTOR, phase_resistance_ohm=stated * 0.02)
    by_voltage = seen(with_voltages(1.0), replace(motor, losses="map"))
    # too large a resistance makes more copper loss than all losses, which another check tells
    for (finding,) in (by_voltage, seen(locked(), motor) if stated < 1.0 else by_voltage):
        assert finding.severity == "warning"
        assert finding.values["ratio"] == pytest.approx(1.0 / stated, rel=0.002)
        assert finding.values["phase_ohm"] == pytest.approx(0.02, rel=0.002)
        assert f"0.02 ohm per phase explains this, and {stated * 0.02:.3g} ohm" in finding.remedy
        assert said in finding.remedy
        assert "Or compare phase_current_A" in finding.remedy
    for other in (replace(motor, phase_resistance_ohm=0.8 * 0.02),
                  replace(motor, phases=1, phase_resistance_ohm=0.75 * 0.02)):  # fmt: skip
        (finding,) = seen(locked(), other)
        assert finding.severity == "warning"
        assert "ohm per phase" not in finding.remedy


@pytest.mark.parametrize(("power_gain", "said"), [(1e3, "1000 times it"), (1e-3, "1/1000 of it"),
                                                  (0.0, "0 % of it")])  # fmt: skip
def test_a_wrong_unit_is_said_as_a_factor_and_not_in_thousands_of_per_cent(power_gain, said):
    for finding in seen(locked(power_gain=power_gain)):
        assert said in finding.message
        assert finding.remedy.startswith("Check the units of ")
        assert "too high" not in finding.remedy
        assert "Leads" not in finding.remedy


@pytest.mark.parametrize(("power_gain", "severity"), [(1.5, "note"), (0.8, "warning")])
def test_a_rotor_said_to_be_locked_may_take_its_part_under_alternating_current(
    power_gain, severity
):
    record = locked(power_gain=power_gain)
    (finding,) = seen(replace(record, notes=(f"speed_rpm = 0 {BY_CONSTANTS}",)))
    assert finding.severity == severity
    assert ("alternating current" in finding.remedy) == (severity == "note")


def test_a_current_off_by_one_percent_is_within_the_instruments():
    assert [f.severity for f in seen(locked(current_gain=0.99))] == ["note"]


def test_a_resistance_known_better_or_worse_moves_the_limit():
    known = replace(MOTOR, parameters={"Rs0": ParameterOverride(relative_sd=0.002)})
    guessed = replace(MOTOR, parameters={"Rs0": ParameterOverride(relative_sd=0.2)})
    record = locked(power_gain=1.034)
    assert [f.severity for f in seen(record, known)] == ["warning"]
    assert [f.severity for f in seen(record)] == ["note"]
    assert [f.severity for f in seen(locked(power_gain=1.2), guessed)] == ["note"]


@pytest.mark.parametrize(
    ("record", "motor"),
    [
        (locked(minutes=2.0), MOTOR),
        (locked(), replace(MOTOR, losses="map")),
        (locked(), replace(MOTOR, phase_resistance_ohm=None)),
        (Record("no speed", {k: v for k, v in locked().channels.items() if k != "speed_rpm"}),
         MOTOR),
    ],
    ids=["two minutes", "losses from a map", "no resistance", "no speed"],
)  # fmt: skip
def test_what_no_copper_loss_can_be_held_against_is_left_alone(record, motor):
    assert seen(record, motor) == []


def test_losses_behind_an_inverter_hold_its_own_too():
    record = locked()
    read = {**record.channels, "dc_power_W": record["losses_W"] * 1.1,
            "torque_Nm": np.zeros(2400)}  # fmt: skip
    mapping = tuple(
        ColumnReading(name, name, "", "derived" if name == "losses_W" else "stated", "", "a.csv")
        for name in read
    )
    assert seen(Record("inverter", read, mapping=mapping)) == []


def with_voltages(volts_per_volt: float) -> Record:
    """Voltages of the same winding: u = R(T) i in d, the amplitude is sqrt(2) times 60 A."""
    record = locked()
    resistance = 0.02 * (234.5 + record["winding_degC"]) / 259.5
    i_d = np.where(record.time_s < STANDS_S, 60.0 * np.sqrt(2.0), 0.0)
    nothing = np.zeros(i_d.size)
    axes = {"u_d_V": volts_per_volt * resistance * i_d, "u_q_V": nothing, "i_d_A": i_d,
            "i_q_A": nothing}  # fmt: skip
    return replace(record, channels={**record.channels, **axes})


def test_voltage_over_current_is_checked_too_also_for_losses_from_a_map():
    both = seen(with_voltages(1.05))
    assert [f.severity for f in both] == ["note", "warning"]
    assert both[1].values["ratio"] == pytest.approx(1.05, abs=1e-6)
    assert "1 % per 1 %" in both[1].remedy
    (alone,) = seen(with_voltages(1.0), replace(MOTOR, losses="map"))
    assert alone.severity == "note"


def test_a_calibration_without_a_standstill_says_once_what_it_cannot_see():
    short = locked(minutes=2.0)
    (finding,) = current_scale_unchecked(MOTOR, [short, short])
    assert (finding.id, finding.severity) == ("current_scale_unchecked", "note")
    assert "2 %" in finding.message
    assert "standstill" in finding.remedy
    assert not list(current_scale_unchecked(MOTOR, [short, locked()]))
    assert not list(current_scale_unchecked(MOTOR, [short, locked(current_gain=0.9)]))
    assert not list(current_scale_unchecked(replace(MOTOR, phase_resistance_ohm=None), [short]))


def test_a_wrong_zero_of_the_torque_puts_nothing_in_at_standstill(record, motor):
    """Where the speed is told; else the offset is of the power itself."""
    test = reduce(record, motor)
    (of_torque,) = (each for each in shaft_errors(motor, [test]) if "offset" in each.name)
    assert of_torque.name == "torque_offset"
    power, speed = (np.abs(v) for v in (test.inputs.shaft_power, test.inputs.speed))
    assert of_torque.sd * np.max(speed) == pytest.approx(1e-3 * np.max(power))
    means = {name: each for name, each in test.means.items() if name != "speed"}
    (of_power,) = (e for e in shaft_errors(motor, [replace(test, means=means)]) if e.unit == "W")
    assert of_power.name == "shaft_power_offset"


def test_a_test_that_tells_no_speed_is_predicted_without_the_zero_of_the_torque(
    found, record, motor
):
    posterior = normal_draws(found)
    assert "torque_offset" in posterior.values()
    channels = {n: v for n, v in record.channels.items() if n not in ("speed_rpm", "torque_Nm")}
    silent = replace(record, channels=channels, name="silent")
    prediction = predict(posterior, reduce(silent, motor))
    assert "torque_offset" not in prediction.values
    assert np.all(np.isfinite(virtual_record(prediction, silent, motor)["winding_degC"]))
