"""What stands in prova.mat and network.mat, against hand-made records, and what is refused."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from run_near_truth import TRUTH

import heatrun
from heatrun.errors import InputError
from heatrun.export import (
    Corrections,
    mat_bytes,
    network_variables,
    simulate_network,
    simulate_variables,
    thesis_variables,
)
from heatrun.export.mat import _is_same
from heatrun.export.network_file import corrected_network, known_laws
from heatrun.export.variables import Shaft
from heatrun.model.catalogue import all_effects
from heatrun.model.model import Model
from heatrun.model.network_text import network_named
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from lptn import EFFECTS, CopperLosses, Inputs, SpeedLoss, reference, second_order
from lptn.effects.heat_paths import CoolingStep, SpeedCooling

MOTOR = Motor("bench", phase_resistance_ohm=0.0062)
VALUES = {
    "Ceq_w": 600.0, "Ceq_sr": 15000.0, "Req_w": 0.15, "Req_sr": 0.12, "Rs0": 0.006,
    "Tw_start": 20.0, "Tsr_start": 20.0, "speed_cooling.g": 0.5, "speed_cooling.m": 0.8,
}  # fmt: skip


def constant(num=3001, step=1.0, **channels):
    t = step * np.arange(num)
    driven = {"phase_current_A": 100.0, "losses_W": 400.0, "ambient_degC": 20.0,
              "winding_degC": 20.0}  # fmt: skip
    return Record("steady", {"time_s": t} | {
        name: np.broadcast_to(np.asarray(value, float), t.shape).copy()
        for name, value in (driven | channels).items()
    })  # fmt: skip


def variables(record, effects=(), *, values=(), motor=MOTOR):
    model = Model.of("second", motor, effects)
    return network_variables(
        record, VALUES | dict(values), motor, model, rated_speed=100.0 * np.pi, rated_current=100.0
    )


def test_the_file_reads_back_as_data():
    record = constant(num=5, speed_rpm=3000.0)
    content = mat_bytes(variables(record, (SpeedCooling,), values={"sensor_offset": 0.25})[0])
    found = scipy.io.loadmat(io.BytesIO(content), simplify_cells=True)
    assert list(found["nodes"]) == ["winding", "stator"]
    assert found["links"].tolist() == [["stator", "ambient"], ["winding", "stator"]]
    assert found["resistance"].tolist() == [0.12, 0.15]
    assert found["capacitance"].tolist() == [600.0, 15000.0]
    assert found["share"].tolist() == [0.0, 1.0]
    assert [found[n] for n in ("copper_node", "sink", "losses")] == [
        "winding",
        "ambient",
        "balance",
    ]
    assert (found["Rs0"], found["phases"], found["B"], found["Tref"]) == (0.006, 3, 234.5, 25.0)
    assert found["sensor"] == {"node": "winding", "gain": 0.0, "offset": 0.25}
    assert found["rated_speed_rpm"] == pytest.approx(3000.0, rel=1e-15)
    (effect,) = np.atleast_1d(found["effects"])
    assert effect["parameters"] == {"g": 0.5, "m": 0.8}
    assert effect["units"] == {"g": "1", "m": "1"}
    assert list(effect["link"]) == ["stator", "ambient"]


def test_a_long_test_ends_where_the_balance_says():
    """At rated speed the conductance to the sink is 1.5/Req_sr; hand calculation."""
    record = constant(num=1801, step=10.0, speed_rpm=3000.0)
    course = simulate_network(mat_bytes(variables(record, (SpeedCooling,))[0]))
    stator = 20.0 + 400.0 * 0.12 / 1.5
    k = 3 * 0.006 * 100.0**2 / (234.5 + 25.0)
    # Pjs = k (B + Tw) flows through Req_w
    winding = (stator + 0.15 * k * 234.5) / (1.0 - 0.15 * k)
    # eight slow time constants (Ceq Req/1.5 = 1250 s) leave 32 K e^-14
    assert course.temperature["stator"][-1] == pytest.approx(stator, abs=1e-3)
    assert course.sensed[-1] == pytest.approx(winding, abs=1e-3)


def test_the_script_holds_the_law_of_every_effect_of_the_catalogue():
    of_networks = {SpeedLoss.card.id}
    assert known_laws() == {kind.card.id for kind in EFFECTS} | of_networks


def test_an_effect_of_the_users_own_is_refused_by_name():
    shaft_fan = all_effects([Path(__file__).with_name("shaft_fan.py")])[-1]
    with pytest.raises(InputError, match=r"not that of shaft_fan, which comes from a file after"):
        variables(constant(num=50, speed_rpm=3000.0), (shaft_fan,), values={"shaft_fan.g": 0.5})


def test_a_channel_that_an_effect_needs_is_asked_for():
    with pytest.raises(InputError, match="effect speed_cooling needs speed_rpm"):
        variables(constant(num=50), (SpeedCooling,))


def test_a_capacitance_that_is_none_is_refused():
    with pytest.raises(InputError, match="above 0, got Ceq_w = -1 J/K"):
        variables(constant(num=50), values={"Ceq_w": -1.0})


def test_a_map_has_its_own_name_for_the_losses():
    found, _ = variables(constant(num=50), motor=replace(MOTOR, losses="map"))
    assert "Pd" not in found
    assert (found["losses"], found["Pol"][0, 0]) == ("map", 400.0)


def test_a_coolant_flow_counts_over_its_largest_value():
    flow = np.linspace(0.0, 8.0, 50)
    found, notes = variables(constant(num=50, coolant_flow_L_per_min=flow))
    np.testing.assert_allclose(found["fan"].ravel(), flow / 8.0, rtol=1e-15)
    assert any("over its largest value, 8" in note for note in notes)


def test_one_node_without_copper_has_no_resistance():
    values = {"Ceq": 1e4, "Req": 0.1}
    model = Model.of("first", MOTOR)
    found, notes = network_variables(
        constant(num=50), {**values, "Tw_start": 20.0}, MOTOR, model,
        rated_speed=1.0, rated_current=1.0,
    )  # fmt: skip
    assert found["Rs0"] == 0.0
    assert any("Rs0 is 0" in note for note in notes)
    assert found["nodes"].tolist() == [["winding"]]
    course = simulate_network(mat_bytes(found))
    # 400 W into 10 kJ/K through 0.1 K/W: rise R P (1 - e^(-t/1000 s))
    rise = 40.0 * -np.expm1(-course.time / 1000.0)
    np.testing.assert_allclose(course.sensed - 20.0, rise, atol=1e-6)


def test_a_load_that_comes_later_takes_the_speed_with_it():
    speed = 100.0 * np.arange(50.0)
    before, _ = variables(constant(num=50, speed_rpm=speed))
    after = corrected_network(before, Corrections(load_timing=0.5, power_gain=0.1), None)
    np.testing.assert_allclose(after["speed_rpm"][1:].ravel(), speed[1:] - 50.0, rtol=1e-12)
    np.testing.assert_allclose(after["Pd"], 440.0, rtol=1e-12)
    assert np.array_equal(after["Tw_m"], before["Tw_m"])


def test_time_counts_from_the_first_sample():
    late = constant(num=601)
    shifted = Record("late", {**late.channels, "time_s": late.time_s + 500.0})
    step = {"cooling_step.k": 2.0, "cooling_step.t_star": 300.0}
    courses = [simulate_network(mat_bytes(variables(r, (CoolingStep,), values=step)[0]))
               for r in (late, shifted)]  # fmt: skip
    np.testing.assert_allclose(courses[0].sensed, courses[1].sensed, atol=1e-9)
    assert courses[1].time[0] == 500.0


def test_the_built_in_networks_are_told_by_their_parts(tmp_path):
    second = network_named("second")
    text = Path(heatrun.__file__).parent / "model/networks/second.toml"
    own = tmp_path / "own.toml"
    own.write_text(text.read_text().replace("value = 500.0", "value = 800.0"))
    assert _is_same(network_named(str(own)), second)
    own.write_text(text.read_text().replace('other = "stator"', 'other = "winding"'))
    assert not _is_same(network_named(str(own)), second)


N = 400
OF_THE_THESIS = TRUTH | {"Tw_start": 22.0, "Tsr_start": 21.0}
REFERENCE = Motor("reference", phase_resistance_ohm=0.0062)


def record(**channels):
    time = np.arange(N) * 0.5
    plain = {
        "time_s": time,
        "phase_current_A": np.where(time < 60.0, 0.0, 100.0),
        "losses_W": np.where(time < 60.0, 0.0, 800.0),
        "ambient_degC": 20.0 + time / 100.0,
        "winding_degC": 22.0 + time / 4.0,
    }
    return Record("test", {**plain, **channels})


def with_gap(values, start, stop):
    values = values.copy()
    values[start:stop] = np.nan
    return values


def test_missing_inputs_are_bridged_as_in_a_fit_and_said():
    current = np.linspace(50.0, 100.0, N)
    losses = np.linspace(100.0, 300.0, N)
    gappy = record(phase_current_A=with_gap(current, 10, 13), losses_W=with_gap(losses, 0, 5))
    variables, notes = thesis_variables(gappy, OF_THE_THESIS, REFERENCE, "second")
    line = np.interp(np.arange(9, 14), [9, 13], current[[9, 13]] ** 2)
    assert variables["Is"][9:14, 0] ** 2 == pytest.approx(line, rel=1e-14)
    assert np.array_equal(variables["Is"][13:, 0], current[13:])
    assert np.array_equal(variables["Pd"][:5, 0], np.full(5, losses[5]))
    assert any("3 missing samples of phase_current_A" in note for note in notes)
    assert any("5 missing samples of losses_W" in note for note in notes)


def test_missing_readings_stay_missing_and_are_said():
    gappy = record(winding_degC=with_gap(record()["winding_degC"], 3, 7))
    variables, notes = thesis_variables(gappy, OF_THE_THESIS, REFERENCE, "second")
    assert np.flatnonzero(np.isnan(variables["Tw_m"])).tolist() == [3, 4, 5, 6]
    assert notes == ("Tw_m is NaN at 4 samples without a reading.",)
    course = simulate_variables(variables)
    assert np.isfinite(course.rmse(course.sensed))


def test_a_coolant_that_is_the_sink_stands_in_te():
    cooled = record(coolant_degC=np.full(N, 55.0))
    machine = replace(REFERENCE, sink="coolant")
    variables, notes = thesis_variables(cooled, OF_THE_THESIS, machine, "second")
    assert np.all(variables["Te"] == 55.0)
    assert notes == ("Te holds coolant_degC, the sink of this motor.",)


def test_six_phases_are_in_the_reference_resistance():
    six = replace(REFERENCE, phases=6)
    variables, notes = thesis_variables(record(), OF_THE_THESIS, six, "second")
    assert variables["Rrif"][0, 0] == 6 * 0.0062
    assert "6 times the phase resistance" in notes[0]


def test_losses_from_a_map_are_refused():
    with pytest.raises(InputError, match="measured total of the losses"):
        thesis_variables(record(), OF_THE_THESIS, replace(REFERENCE, losses="map"), "second")


def test_an_unknown_resistance_is_left_out_of_the_first_order():
    values = {"Ceq": 12500.0, "Req": 0.132, "Tw_start": 22.0}
    unknown = replace(REFERENCE, phase_resistance_ohm=None)
    variables, notes = thesis_variables(record(), values, unknown, "first")
    assert "Rrif" not in variables
    assert "Rrif is left out" in notes[0]
    assert np.all(np.isfinite(simulate_variables(variables).sensed))


def test_corrections_of_losses_and_sink():
    found = Corrections.of({"power_gain": 0.02, "torque_offset": 0.5, "ambient_offset": 1.5,
                            "Ceq_w": 1.0})  # fmt: skip
    variables, _ = thesis_variables(record(), OF_THE_THESIS, REFERENCE, "second")
    corrected = found.applied(variables, Shaft(np.full(N, 3000.0)))
    watts = 0.5 * 3000.0 * 2.0 * np.pi / 60.0
    assert corrected["Pd"] == pytest.approx(1.02 * variables["Pd"] - watts, rel=1e-14)
    assert np.array_equal(corrected["Te"], variables["Te"] + 1.5)
    assert np.array_equal(corrected["Tw_m"], variables["Tw_m"])


def test_a_coarse_and_uneven_record_is_simulated_on_finer_steps():
    """Against the adaptive solver on the same straight lines between samples."""
    time = np.cumsum(np.tile([20.0, 45.0, 5.0, 130.0], 12))
    time = time - time[0]
    losses = 500.0 + 300.0 * np.sin(time / 400.0)
    coarse = Record("coarse", {
        "time_s": time, "phase_current_A": np.full(time.size, 90.0), "losses_W": losses,
        "ambient_degC": np.full(time.size, 20.0), "winding_degC": np.full(time.size, 22.0),
    })  # fmt: skip
    variables, _ = thesis_variables(coarse, OF_THE_THESIS, REFERENCE, "second")
    course = simulate_variables(variables)
    fine = np.interp(np.arange(0.0, time[-1] + 0.1, 1.0)[:-1] + 0.5, time, losses)
    of_load = {"current_squared": np.full(fine.size, 8100.0), "losses": fine}
    inputs = Inputs(step=np.asarray(1.0), ambient=np.full(fine.size, 20.0), **of_load)
    network = second_order(*(OF_THE_THESIS[n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")))
    exact = reference(
        network, CopperLosses(Rs0=np.asarray(0.0062)), inputs, {"winding": 22.0, "stator": 21.0}
    )
    at = time.astype(int)
    # both take means over steps of 1 s of losses that change by 0.75 W/s at most
    assert course.sensed == pytest.approx(np.asarray(exact.temperature["winding"])[at], abs=1e-3)
