"""What stands in prova.mat where a record or a motor is not of the plainest kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.export import simulate_variables, thesis_variables
from heatrun.export.variables import Corrections, Shaft
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from lptn import CopperLosses, Inputs, reference, second_order

N = 400
VALUES = {
    "Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625, "Rs0": 0.0062,
    "Tw_start": 22.0, "Tsr_start": 21.0,
}  # fmt: skip
MOTOR = Motor("reference", phase_resistance_ohm=0.0062)


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
    variables, notes = thesis_variables(gappy, VALUES, MOTOR, "second")
    line = np.interp(np.arange(9, 14), [9, 13], current[[9, 13]] ** 2)
    assert variables["Is"][9:14, 0] ** 2 == pytest.approx(line, rel=1e-14)
    assert np.array_equal(variables["Is"][13:, 0], current[13:])
    assert np.array_equal(variables["Pd"][:5, 0], np.full(5, losses[5]))
    assert any("3 missing samples of phase_current_A" in note for note in notes)
    assert any("5 missing samples of losses_W" in note for note in notes)


def test_missing_readings_stay_missing_and_are_said():
    gappy = record(winding_degC=with_gap(record()["winding_degC"], 3, 7))
    variables, notes = thesis_variables(gappy, VALUES, MOTOR, "second")
    assert np.flatnonzero(np.isnan(variables["Tw_m"])).tolist() == [3, 4, 5, 6]
    assert notes == ("Tw_m is NaN at 4 samples without a reading.",)
    assert np.isfinite(simulate_variables(variables).rmse(variables["Tw_m"]))


def test_a_coolant_that_is_the_sink_stands_in_te():
    cooled = record(coolant_degC=np.full(N, 55.0))
    variables, notes = thesis_variables(cooled, VALUES, replace(MOTOR, sink="coolant"), "second")
    assert np.all(variables["Te"] == 55.0)
    assert notes == ("Te holds coolant_degC, the sink of this motor.",)


def test_six_phases_are_in_the_reference_resistance():
    variables, notes = thesis_variables(record(), VALUES, replace(MOTOR, phases=6), "second")
    assert variables["Rrif"][0, 0] == 6 * 0.0062
    assert "6 times the phase resistance" in notes[0]


def test_losses_from_a_map_are_refused():
    with pytest.raises(InputError, match="measured total of the losses"):
        thesis_variables(record(), VALUES, replace(MOTOR, losses="map"), "second")


def test_an_unknown_resistance_is_left_out_of_the_first_order():
    values = {"Ceq": 12500.0, "Req": 0.132, "Tw_start": 22.0}
    unknown = replace(MOTOR, phase_resistance_ohm=None)
    variables, notes = thesis_variables(record(), values, unknown, "first")
    assert "Rrif" not in variables
    assert "Rrif is left out" in notes[0]
    assert np.all(np.isfinite(simulate_variables(variables).winding))


def test_corrections_of_losses_and_sink():
    found = Corrections.of({"power_gain": 0.02, "torque_offset": 0.5, "ambient_offset": 1.5,
                            "Ceq_w": 1.0})  # fmt: skip
    variables, _ = thesis_variables(record(), VALUES, MOTOR, "second")
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
    variables, _ = thesis_variables(coarse, VALUES, MOTOR, "second")
    course = simulate_variables(variables)
    fine = np.interp(np.arange(0.0, time[-1] + 0.1, 1.0)[:-1] + 0.5, time, losses)
    inputs = Inputs(
        step=np.asarray(1.0),
        current_squared=np.full(fine.size, 8100.0),
        losses=fine,
        ambient=np.full(fine.size, 20.0),
    )
    network = second_order(*(VALUES[n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")))
    exact = reference(
        network, CopperLosses(Rs0=np.asarray(0.0062)), inputs, {"winding": 22.0, "stator": 21.0}
    )
    at = time.astype(int)
    # both take means over steps of 1 s of losses that change by 0.75 W/s at most
    assert course.winding == pytest.approx(np.asarray(exact.temperature["winding"])[at], abs=1e-3)
