"""Default priors follow the scale of the machine; starts, masses and the quick fit."""

from dataclasses import replace

import numpy as np
import pytest
from heat_runs import MOTOR, changed, heat_run
from recovered import holds, log_sd
from scipy.signal import lfilter

from heatrun.checks.quick_fit import quick_fit
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.model.scale import BODY, TAKING_PART, one_node, scale_of_tests
from heatrun.motor.file import parse_motor
from heatrun.posterior.fit_checks import fit_findings
from heatrun.posterior.identifiability import extended
from heatrun.posterior.posterior import normal_draws
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.simulation import predict_values

NETWORK = {"Ceq_w": 1, "Ceq_sr": 1, "Req_w": -1, "Req_sr": -1}
"""Power of the size that each parameter grows with."""


def sized(duty, motor, size):
    """The record of a machine with `size` times the losses and capacities at the same course."""
    channels = {**duty.channels, "losses_W": size * duty["losses_W"]}
    record = Record("sized", channels)
    machine = replace(motor, phase_resistance_ohm=size * motor.phase_resistance_ohm)
    return machine, reduce(record, machine)


@pytest.mark.parametrize("size", [1e-3, 1e3])  # reference: 1 kW of losses
def test_the_fit_is_the_same_at_every_size(duty, motor, truth, size):
    machine, test = sized(duty, motor, size)
    model = Model.of("second", machine).scaled(machine, [test])
    found = fit(Problem.of(model, machine, [test]))
    true = {name: truth[name] * size**power for name, power in NETWORK.items()}
    holds(found, true)
    for name in NETWORK:
        parameter = found.slots[found.problem.parameters.index(name)].parameter
        low, high = parameter.prior_interval_95()
        assert low < true[name] < high, name


def test_what_the_user_states_is_left(duty, motor):
    machine, test = sized(duty, motor, 1e3)
    stated = replace(machine, parameters={"Ceq_sr": ParameterOverride(value=2e4, relative_sd=0.1)})
    model = Model.of("second", stated).scaled(stated, [test])
    by_name = {s.name: s.parameter for s in Problem.of(model, stated, [test]).parameters.slots}
    assert by_name["Ceq_sr"].centre == 2e4
    assert by_name["Ceq_w"].centre > 1e5


def test_a_prior_that_the_tests_contradict_is_a_finding_with_both(duty, motor):
    machine, test = sized(duty, motor, 1.0)
    stated = replace(
        machine, parameters={"Ceq_w": ParameterOverride(value=3000.0, relative_sd=0.3)}
    )
    found = fit(Problem.of(Model.of("second", stated), stated, [test]))
    (finding,) = [
        each for each in fit_findings(normal_draws(found), []) if each.id == "prior_conflict"
    ]
    assert "Ceq_w" in finding.message
    assert "stated in the motor file" in finding.message
    assert finding.values["prior_sd"] < -2.0


def test_a_test_without_heat_has_no_scale(duty, motor):
    cold = Record("cold", {**duty.channels, "winding_degC": duty["ambient_degC"]})
    assert scale_of_tests([reduce(cold, motor)]) is None


AMBIENT = 22.0


def warmed(time, losses, in_winding, C_w, C_sr, R_w, R_sr, *, above_K=(0.0, 0.0), lag_s=0.0):
    """A record of two nodes by Euler steps of 2 s, a share of the losses in the winding."""
    winding, stator = AMBIENT + above_K[0], AMBIENT + above_K[1]
    sensor, read = winding, []
    for watts in losses:
        read.append(sensor)
        to_stator = (winding - stator) / R_w
        sensor += min(2.0 / lag_s, 1.0) * (winding - sensor) if lag_s else 0.0
        winding += 2.0 * (in_winding * watts - to_stator) / C_w
        to_sink = (stator - AMBIENT) / R_sr
        stator += 2.0 * ((1.0 - in_winding) * watts + to_stator - to_sink) / C_sr
        sensor = sensor if lag_s else winding
    return Record("warmed", {
        "time_s": time, "phase_current_A": np.sqrt(losses), "losses_W": losses,
        "ambient_degC": np.full(time.size, AMBIENT), "winding_degC": np.array(read),
    })  # fmt: skip


def test_a_test_that_starts_warm_does_not_hide_how_fast_the_winding_is(motor):
    """Forty minutes near the end of a heat run, then an hour of cooling: 1 K/min at 400 W."""
    network = {"C_w": 900.0, "C_sr": 11_000.0, "R_w": 0.08, "R_sr": 0.13}
    time = np.arange(0.0, 6000.0, 2.0)
    losses = np.where(time < 2400.0, 400.0, 0.0)
    above_K = 400.0 * (0.08 + 0.13) - 6.0, 400.0 * 0.13 - 6.0
    test = reduce(warmed(time, losses, 0.6, **network, above_K=above_K), motor)
    found = priors("second", motor, test)
    for name, true in network.items():
        low, high = found[f"{name[0]}eq{name[1:]}"].prior_interval_95()
        assert low < true < high, name


@pytest.mark.parametrize("lag_s", [0.0, 30.0, 90.0])
def test_a_load_that_goes_tells_the_scale_however_late_a_sensor_shows_it(motor, lag_s):
    """A coil, whose winding is most of it: 0.2 W of standby are left, and it is no load step."""
    time = np.arange(0.0, 7200.0, 2.0)
    losses = np.where(time < 3600.0, 300.0, 0.2 + 0.1 * np.sin(time / 50.0))
    record = warmed(time, losses, 1.0, 4000.0, 6000.0, 0.15, 0.22, lag_s=lag_s)
    scale = scale_of_tests([reduce(record, motor)])
    assert scale is not None
    assert 4000.0 / 3.0 < scale.capacity < 3.0 * 4000.0


def test_pulses_of_the_winding_do_not_hide_the_body(motor):
    """An S3 duty of 10 min: the winding swings, and the machine behind it is ten times as large."""
    time = np.arange(0.0, 4500.0, 2.0)
    watts = np.where((time % 600.0 < 300.0) & (time < 3600.0), 170.0, 0.0)
    record = warmed(time, watts, 0.65, 126.0, 1286.0, 0.52, 0.5)
    found = one_node([reduce(changed(record, phase_current_A=0.02 * np.sqrt(watts)), motor)])
    assert found is not None
    capacity, resistance = found
    assert 1412.0 / 3.0 < capacity < 1.5 * 1412.0
    assert 0.4 < resistance < 1.1


def test_the_resistance_of_a_coil_is_open_to_eddies_unless_stated(duty, motor):
    """One phase: alternating current may meet more, no more than the losses hold."""
    ohm = motor.phase_resistance_ohm
    stated = {"Rs0": ParameterOverride(value=ohm, relative_sd=0.01)}
    coil = replace(motor, phases=1)
    copper = coil.copper_loss_W(duty["phase_current_A"], duty["winding_degC"])
    direct = Record(duty.name, {**duty.channels, "losses_W": copper})
    for machine, record, more, sd in (
        (motor, duty, 0.0, 0.01),
        (coil, duty, 0.1, 0.051),
        (replace(coil, losses="map"), direct, 0.1, 0.051),
        (coil, direct, 0.0, 0.01),
        (replace(coil, parameters=stated), duty, 0.0, 0.01),
    ):
        slots = Problem.of(Model.of("second", machine), machine, [reduce(record, machine)])
        (prior,) = [s.parameter for s in slots.parameters.slots if s.name == "Rs0"]
        assert prior.centre == pytest.approx(ohm * (1.0 + more), rel=2e-3)
        assert prior.sd == pytest.approx(sd, rel=0.02)


def fitted_with(motor, test, **masses):
    machine = replace(motor, **masses)
    model = Model.of("second", machine).scaled(machine, [test])
    return fit(Problem.of(model, machine, [test]))


@pytest.fixture(scope="module")
def short(duty, motor):
    first = {name: values[duty["time_s"] < 150.0] for name, values in duty.channels.items()}
    return reduce(Record("short", first), motor)


def test_a_short_test_is_helped_by_the_mass(short, motor, truth):
    mass = truth["Ceq_sr"] / (TAKING_PART * BODY) * 1.3  # the machine is not as is assumed
    alone, helped = (fitted_with(motor, short, mass_kg=kg) for kg in (None, mass))
    assert log_sd(helped, "Ceq_sr") < 0.6 * log_sd(alone, "Ceq_sr")
    holds(helped, {"Ceq_sr": truth["Ceq_sr"]}, sds=2.5)
    basis = priors("second", helped.problem.motor, short)["Ceq_sr"].basis
    assert f"kg at {BODY:g} J/(kg K)" in basis


def test_a_mass_that_the_test_contradicts_is_a_finding(duty, motor, truth):
    """Pounds, or the mass of the whole drive."""
    found = fitted_with(motor, reduce(duty, motor), mass_kg=8.0 * truth["Ceq_sr"] / BODY)
    findings = [f for f in fit_findings(normal_draws(found), []) if f.id == "prior_conflict"]
    assert [f for f in findings if "Ceq_sr" in f.message and "J/(kg K)" in f.message]


def priors(order, machine, test):
    model = Model.of(order, machine).scaled(machine, [test])
    slots = Problem.of(model, machine, [test]).parameters.slots
    return {slot.name: slot.parameter for slot in slots}


def test_each_mass_goes_to_its_nodes(short, motor):
    machine = replace(motor, mass_kg=10.0, conductor_mass_kg=2.0)
    second, four = priors("second", machine, short), priors("four", machine, short)
    assert second["Ceq_w"].centre == pytest.approx(1.15 * 385.0 * 2.0)
    assert second["Ceq_sr"].centre == pytest.approx(0.85 * 460.0 * 8.0)
    assert four["Ceq_tooth"].centre == pytest.approx(0.85 * 460.0 * 8.0 / 3.0)
    assert four["Ceq_tooth"].sd > second["Ceq_sr"].sd  # of several the sum is known
    assert "the winding changes by" in priors("first", machine, short)["Ceq"].basis
    aluminium = replace(machine, resistance_coefficient_degC=225.0)
    assert priors("second", aluminium, short)["Ceq_w"].centre == pytest.approx(1.15 * 897.0 * 2.0)
    stated = replace(
        machine, parameters={"Ceq_sr": ParameterOverride(value=900.0, relative_sd=0.1)}
    )
    assert priors("second", stated, short)["Ceq_sr"].centre == 900.0


def test_masses_are_read_and_judged():
    text = '[motor]\nname = "m"\nmass_kg = 12\n[winding]\nconductor_mass_kg = {}\n'
    motor = parse_motor(text.format(1.5).encode(), "motor.toml")
    assert (motor.mass_kg, motor.conductor_mass_kg) == (12.0, 1.5)
    with pytest.raises(InputError, match="conductor_mass_kg below mass_kg, got 15 of 12 kg"):
        parse_motor(text.format(15).encode(), "motor.toml")
    with pytest.raises(InputError, match="above 0"):
        parse_motor(text.format(0).encode(), "motor.toml")


DELAY_S = 6.8
LAG_S = 15.0


@pytest.fixture(scope="module")
def exact(bench, generator):
    """A load step from a soaked machine, logged from its first second, without noise."""
    quiet = {"drift_sd_K": 0.0, "white_sd_K": 0.01, "resolution_K": 0.0, "ambient_sd_K": 0.0,
             "ambient_resolution_K": 0.0, "power_noise": 0.0, "power_floor_W": 0.0,
             "current_sd_A": 0.0}  # fmt: skip
    record = bench(generator.constant_load(1860.0, torque=0.9), seed=31, **quiet)
    kept = record.time_s >= 60.0
    channels = {name: values[kept] for name, values in record.channels.items()}
    return replace(record, channels={**channels, "time_s": channels["time_s"] - 60.0})


def late(record):
    """The record with its temperature written 6.8 s late."""
    winding = np.interp(record.time_s - DELAY_S, record.time_s, record["winding_degC"])
    return replace(record, channels={**record.channels, "winding_degC": winding})


def lagging(record):
    """The record with a thermometer that follows with a time constant of 15 s."""
    winding = record["winding_degC"].copy()
    for i in range(1, winding.size):
        share = 1.0 - np.exp(-(record.time_s[i] - record.time_s[i - 1]) / LAG_S)
        between = 0.5 * (record["winding_degC"][i] + record["winding_degC"][i - 1])
        winding[i] = winding[i - 1] + share * (between - winding[i - 1])
    return replace(record, channels={**record.channels, "winding_degC": winding})


@pytest.mark.parametrize(
    ("spoilt", "effect", "value"),
    [
        (late, "time_shift", {"time_shift.d": DELAY_S}),
        (lagging, "sensor_lag", {"sensor_lag.tau": LAG_S}),
    ],
)
def test_a_late_reading_does_not_move_the_start(spoilt, effect, value, exact, motor, truth):
    record = spoilt(exact)
    known = replace(motor, effects=(effect,))
    found = predict_values(known, {**truth, "Rs0": 0.0062, **value}, record, "second")
    true_start = float(exact["winding_degC"][0])
    # samples joined by straight lines put the step half a second off, and the reading with it
    slope = (exact["winding_degC"][20] - true_start) / 20.0
    half_a_sample = 0.5 * slope
    # a ruler through the first readings of a late sensor is more than twice as far off
    assert abs(reduce(record, motor).start_degC - true_start) > 2.0 * half_a_sample
    assert float(found.values["Tw_start"][0]) == pytest.approx(true_start, abs=half_a_sample)
    assert float(found.values["Tsr_start"][0]) == pytest.approx(true_start, abs=half_a_sample)
    assert found.rmse_K < half_a_sample


def test_a_test_without_a_winding_starts_soaked_at_the_sink(exact, motor, truth):
    bare = {n: v for n, v in exact.channels.items() if n != "winding_degC"}
    found = predict_values(motor, {**truth, "Rs0": 0.0062}, replace(exact, channels=bare), "second")
    sink = float(exact["ambient_degC"][0])
    assert float(found.values["Tw_start"][0]) == pytest.approx(sink, abs=0.05)
    assert np.isnan(found.rmse_K)


def test_readings_after_the_first_blocks_are_not_read(exact, motor, truth):
    values = {**truth, "Rs0": 0.0062}
    winding = exact["winding_degC"].copy()
    winding[exact.time_s > 60.0] += 5.0
    moved = replace(exact, channels={**exact.channels, "winding_degC": winding})
    one, two = (predict_values(motor, values, record, "second") for record in (exact, moved))
    assert np.array_equal(one.median, two.median)


def test_a_measured_stator_starts_where_its_sensor_says(exact, motor, truth):
    """Winding and stator 1.5 K above the sink: not soaked to the end, and both are measured."""
    channels = {**exact.channels, "ambient_degC": exact["ambient_degC"] - 1.5}
    stator = np.full_like(exact["winding_degC"], exact["winding_degC"][0])
    warm = replace(exact, channels={**channels, "stator_degC": stator})
    found = predict_values(motor, {**truth, "Rs0": 0.0062}, warm, "second")
    assert float(found.values["Tsr_start"][0]) == pytest.approx(stator[0], abs=0.2)


def blocks(load_until_s: float, load_A: float = 100.0):
    time_s = np.arange(0.0, 3600.0, 2.0)
    is_on = (time_s > 300.0) & (time_s < load_until_s)
    level = np.where(time_s < 1200.0, 0.6 * load_A, load_A)
    current = np.where(is_on, level, 0.0)
    channels = {
        "time_s": time_s,
        "phase_current_A": current,
        "losses_W": 0.04 * current**2,
        "ambient_degC": np.full(time_s.size, 20.0),
        "winding_degC": 20.0 + 0.01 * time_s,
    }
    return reduce(Record("t", channels), Motor("M"))


@pytest.mark.parametrize(
    ("load_until_s", "current_A"),
    [(4000.0, 100.0), (2400.0, 100.0), (1100.0, 60.0)],
    ids=["loaded to the end", "a cool-down behind it", "the first level only"],
)
def test_the_last_load_goes_on_though_a_cool_down_came_behind_it(load_until_s, current_A):
    longer = extended(blocks(load_until_s), 7200.0)
    added = slice(-100, None)
    np.testing.assert_allclose(longer.inputs.current_squared[added], current_A**2, rtol=0.01)
    np.testing.assert_allclose(longer.inputs.losses[added], 0.04 * current_A**2, rtol=0.01)
    assert longer.duration_s == pytest.approx(7200.0, abs=40.0)
    assert longer.measured.size == longer.weight.shape[0] == longer.count.size


def test_a_test_that_only_cools_goes_on_cooling():
    longer = extended(blocks(0.0), 7200.0)
    assert np.all(np.asarray(longer.inputs.losses) == 0.0)


C_w, C_sr, R_w, R_sr = 666.75, 15060.1, 0.14485, 0.11625
STATES = np.array(
    [[-1.0 / (C_w * R_w), 1.0 / (C_w * R_w)],
     [1.0 / (C_sr * R_w), -(1.0 / R_w + 1.0 / R_sr) / C_sr]]
)  # fmt: skip
FAST, SLOW = np.sort(-1.0 / np.linalg.eigvals(STATES))


@pytest.mark.parametrize("seed", range(3))
def test_an_hour_tells_both_time_constants_and_the_winding(seed):
    found = quick_fit(heat_run(seed, step_s=1.0), MOTOR)
    assert found is not None
    assert found.taus_s[0] == pytest.approx(FAST, rel=0.05)
    assert abs(np.log(found.tau_s / SLOW)) < 3.0 * max(found.log_sd, 0.01)
    # a joule in the winding, before any of it has left; one in the body, which shows later
    at_once = found.response_K_per_J.sum(axis=1)
    assert at_once[0] == pytest.approx(1.0 / C_w, rel=0.1)
    assert at_once[1] == pytest.approx(0.0, abs=0.01 / C_w)


def test_a_short_test_leaves_the_slow_time_constant_open():
    sds = [quick_fit(heat_run(1, minutes, step_s=1.0), MOTOR) for minutes in (12.0, 30.0, 60.0)]
    first, second, last = (found.log_sd for found in sds if found is not None)
    assert first > 0.4 > 0.1 > second > last


def test_a_sensor_that_lags_does_not_move_the_slow_time_constant():
    record = heat_run(2, step_s=1.0, rounding=0.1)
    lag = np.exp(-1.0 / 25.0)
    rise = lfilter([1.0 - lag], [1.0, -lag], record["winding_degC"] - record["winding_degC"][0])
    late = changed(record, winding_degC=record["winding_degC"][0] + np.asarray(rise))
    found = quick_fit(late, MOTOR)
    assert found is not None
    assert found.tau_s == pytest.approx(SLOW, rel=0.05)


def test_what_is_left_out_is_predicted_within_its_doubt():
    record = heat_run(3, step_s=1.0, rounding=0.1)
    hidden = (record.time_s > 1500.0) & (record.time_s < 2100.0)
    wrong = changed(record, winding_degC=np.where(hidden, 50.0, record["winding_degC"]))
    found = quick_fit(wrong, MOTOR, left_out_s=[(1500.0, 2100.0)])
    assert found is not None
    true = np.interp(found.time_s, record.time_s, record["winding_degC"])
    inside = (found.time_s > 1500.0) & (found.time_s < 2100.0)
    off = np.abs(found.fitted_degC - true)[inside]
    doubt = 3.0 * np.hypot(found.rms_K, np.max(found.sd_K[inside]))
    # the resistance in there is that of the readings beside it, some kelvins off
    assert np.max(off) < doubt + 0.05 * np.ptp(true[inside])


def test_the_times_of_a_quick_fit_are_those_of_its_readings():
    """Not of the blank ones before."""
    whole = heat_run(1, step_s=1.0)
    blank = np.where(whole.time_s < 600.0, np.nan, whole["winding_degC"])
    found = quick_fit(changed(whole, winding_degC=blank), MOTOR)
    half = 0.5 * (found.time_s[1] - found.time_s[0])
    assert found.time_s[0] - half == pytest.approx(600.0)
    assert found.time_s[-1] + half == pytest.approx(whole.time_s[-1])


def test_a_course_of_no_network_is_not_fitted():
    record = heat_run(4, step_s=1.0)
    noise = np.random.default_rng(0).uniform(20.0, 90.0, record.time_s.size)
    assert quick_fit(changed(record, winding_degC=noise), MOTOR) is None
    assert quick_fit(changed(record, winding_degC=np.full(noise.size, 40.0)), MOTOR) is None


def test_the_resistance_of_copper_rises_as_its_tables_say():
    # IEC 60034-1: (235 + T2)/(235 + T1); 20 degC to 75 degC is 1.2157
    motor = Motor("m", resistance_coefficient_degC=235.0, reference_temperature_degC=20.0)
    assert motor.resistance_ratio(np.array(75.0)) == pytest.approx(1.21569, rel=1e-5)
    assert motor.resistance_ratio(np.array(20.0)) == 1.0


def test_the_loss_is_that_of_all_phases():
    motor = Motor("m", phases=3, phase_resistance_ohm=0.2, reference_temperature_degC=25.0)
    loss = motor.copper_loss_W(np.array([10.0, -10.0]), np.array([25.0, 154.75]))
    np.testing.assert_allclose(loss, [60.0, 90.0])


def test_no_loss_is_made_up_without_a_resistance():
    with pytest.raises(ValueError, match="phase_resistance_ohm"):
        Motor("m").copper_loss_W(np.ones(1), np.ones(1))
