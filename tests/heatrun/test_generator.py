"""The simulated bench obeys physics and its own statistics, and borrows from no package."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.linalg import expm

STILL_AIR = {"drift_K_per_h": 0.0, "swing_K": 0.0}


def test_it_imports_numpy_and_the_standard_library_alone(generator: ModuleType) -> None:
    assert generator.__file__ is not None
    imported: set[str] = set()
    for path in Path(generator.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                imported.add(str(node.module).partition(".")[0])
    assert imported - sys.stdlib_module_names == {"numpy"}


@pytest.mark.parametrize("profile", ["constant_load", "staircase", "duty", "drive_cycle"])
def test_energy_balance_closes(generator: ModuleType, profile: str) -> None:
    machine = generator.reference_motor()
    truth = generator.simulate(
        machine, getattr(generator, profile)(1800.0), sample_s=0.05, steps_per_sample=1
    )
    outward = (truth.stator_degC - truth.ambient_degC) / machine.Req_sr
    # Kinks of the profile lie on multiples of 0.1 s, the ends of Simpson's parabolas.
    supplied, lost = (simpson(flow, dx=0.05) for flow in (truth.losses_W, outward))
    stored = machine.Ceq_w * (truth.winding_degC[-1] - truth.winding_degC[0])
    stored += machine.Ceq_sr * (truth.stator_degC[-1] - truth.stator_degC[0])
    assert supplied > 3e5
    # What is left is the error of Simpson's rule where sqrt-like currents start from zero.
    assert abs(supplied - lost - stored) < 1e-6 * supplied


def test_steady_state_is_the_closed_form(generator: ModuleType) -> None:
    machine, room = generator.reference_motor(), generator.Room(20.0, **STILL_AIR)
    # 30 000 s are 16 slow time constants of 1833 s: 1e-7 of a rise of 120 K is left.
    truth = generator.simulate(
        machine, generator.constant_load(30060.0), room=room, sample_s=1.0, steps_per_sample=4
    )
    current, other = truth.current_A[-1], truth.other_loss_W[-1]
    k = 3.0 * current**2 * 0.0062 / (234.5 + 25.0)
    both = machine.Req_w + machine.Req_sr
    winding = (20.0 + k * 234.5 * both + other * machine.Req_sr) / (1.0 - k * both)
    stator = 20.0 + machine.Req_sr * (other + k * (234.5 + winding))
    assert truth.winding_degC[-1] == pytest.approx(winding, abs=5e-5)
    assert truth.stator_degC[-1] == pytest.approx(stator, abs=5e-5)


def test_a_constant_load_follows_the_matrix_exponential(generator: ModuleType) -> None:
    machine, room = generator.reference_motor(), generator.Room(20.0, **STILL_AIR)
    truth = generator.simulate(machine, generator.constant_load(1800.0), room=room)
    ramped = 640  # all ramps have ended at 64 s
    k = 3.0 * truth.current_A[-1] ** 2 * 0.0062 / 259.5
    C_w, C_sr, R_w, R_sr = machine.Ceq_w, machine.Ceq_sr, machine.Req_w, machine.Req_sr
    other = truth.other_loss_W[-1]
    rates = np.array(
        [
            [(k - 1 / R_w) / C_w, 1 / R_w / C_w, k * 234.5 / C_w],
            [1 / R_w / C_sr, -(1 / R_w + 1 / R_sr) / C_sr, (other + 20.0 / R_sr) / C_sr],
            [0.0, 0.0, 0.0],
        ]
    )
    start = [truth.winding_degC[ramped], truth.stator_degC[ramped], 1.0]
    winding, stator, _ = expm(rates * (truth.time_s[-1] - truth.time_s[ramped])) @ start
    # Rounding of 70 000 steps at 100 degC: sqrt(70 000) 1e-14 K each way, and some to spare.
    assert truth.winding_degC[-1] == pytest.approx(winding, abs=1e-9)
    assert truth.stator_degC[-1] == pytest.approx(stator, abs=1e-9)


@pytest.mark.parametrize("profile", ["duty", "drive_cycle"])
def test_halving_the_step_changes_nothing_that_matters(generator: ModuleType, profile: str) -> None:
    machine, load = generator.reference_motor(), getattr(generator, profile)(1800.0)
    whole = generator.simulate(machine, load)
    half = generator.simulate(machine, load, steps_per_sample=8)
    assert np.abs(whole.winding_degC - half.winding_degC).max() < 1e-5
    assert np.abs(whole.stator_degC - half.stator_degC).max() < 1e-5


def test_the_published_working_point_lies_on_the_loss_law(generator: ModuleType) -> None:
    machine = generator.reference_motor()
    copper = machine.copper_loss_per_kelvin(74.18334424) * (234.5 + 22.0)
    assert copper == pytest.approx(101.175595, abs=5e-7)  # the sheet's digits
    # The sheet's Pol scatters by 5 W from sample to sample around 420 W.
    assert machine.other_loss(74.18334424, 4100.0) == pytest.approx(420.0, abs=5.0)


@pytest.mark.parametrize("duration_s", [1800.0, 5400.0])
def test_duty_moves_current_and_speed_apart(generator: ModuleType, duration_s: float) -> None:
    load = generator.duty(duration_s)
    truth = generator.simulate(generator.reference_motor(), load)
    assert load.duration_s == truth.time_s[-1] == duration_s
    loaded = truth.losses_W > 1.0
    # Neither explains half of the other's variance, while each covers most of its range alone.
    assert np.corrcoef(truth.current_A[loaded], truth.speed_rpm[loaded])[0, 1] ** 2 < 0.5
    assert np.ptp(truth.current_A[np.isclose(truth.speed_rpm, 3000.0)]) > 100.0
    assert np.ptp(truth.speed_rpm[np.isclose(truth.current_A, 94.7, atol=0.1)]) > 3000.0
    spinning = loaded & (truth.current_A == 0.0)
    standing = (truth.losses_W == 0.0) & (truth.time_s > 60.0)
    assert spinning.mean() > 0.05
    assert standing.mean() > 0.15


def test_impossible_requests_are_refused(generator: ModuleType) -> None:
    with pytest.raises(ValueError, match="Ask for a longer duration"):
        generator.duty(300.0)
    with pytest.raises(ValueError, match="no multiple of the sample time"):
        generator.simulate(generator.reference_motor(), generator.constant_load(100.05))


def resting(generator: ModuleType, duration_s: float):
    load = generator.Profile((generator.Segment(duration_s, 0.0, 0.0),))
    return generator.simulate(generator.reference_motor(), load)


@pytest.mark.slow
def test_the_slow_sensor_error_has_its_size_and_its_memory(generator: ModuleType) -> None:
    truth = resting(generator, 20000.0)
    slow = generator.Instruments(drift_sd_K=0.2, drift_time_s=20.0, white_sd_K=0.0, resolution_K=0)
    columns = generator.measure(truth, np.random.default_rng(5), slow)
    error = columns["Tw_m"] - truth.winding_degC
    # 20 000 s hold 20 000/(2 * 20) = 500 independent values of the process and 1000 of its square.
    assert abs(error.mean()) < 4.0 * 0.2 / np.sqrt(500.0)
    assert abs(np.mean(error**2) / 0.2**2 - 1.0) < 4.0 * np.sqrt(2.0 / 1000.0)
    lagged = np.mean(error[200:] * error[:-200]) / np.mean(error**2)
    # After one correlation time, 1/e; its standard error is at most sqrt(1/500).
    assert abs(lagged - np.exp(-1.0)) < 4.0 / np.sqrt(500.0)


def test_instrument_errors_act_one_by_one(generator: ModuleType) -> None:
    truth = generator.simulate(generator.reference_motor(), generator.constant_load(300.0))

    def measured(**errors: float) -> dict[str, np.ndarray]:
        instruments = generator.Instruments(**errors)
        return generator.measure(truth, np.random.default_rng(3), instruments)

    fine, plain = measured(resolution_K=0.0), measured()
    cut, gained = measured(truncates=True), measured(power_gain_error=0.05)
    shifted = measured(resolution_K=0.0, offset_K=0.7)
    assert np.array_equal(plain["Tw_m"], np.round(fine["Tw_m"]))
    assert np.array_equal(cut["Tw_m"], np.floor(fine["Tw_m"]))
    np.testing.assert_allclose(shifted["Tw_m"] - fine["Tw_m"], 0.7, rtol=1e-12)
    # Differences of numbers near 700 W carry a rounding of 1e-13 W.
    np.testing.assert_allclose(gained["Pd"] - plain["Pd"], 0.05 * truth.losses_W, atol=1e-12)
    for name in ("Is", "Te", "speed_rpm"):
        assert np.array_equal(gained[name], plain[name])
    assert not np.array_equal(generator.measure(truth, np.random.default_rng(4))["Pd"], plain["Pd"])


def test_random_motors_span_a_decade_and_none_burns_or_stays_cold(generator: ModuleType) -> None:
    rng = np.random.default_rng(11)
    motors = [generator.random_motor(rng) for _ in range(200)]
    assert motors[0] == generator.random_motor(np.random.default_rng(11))
    capacities = np.array([motor.Ceq_sr for motor in motors])
    assert capacities.max() / capacities.min() > 10.0
    for motor in motors[:40]:
        truth = generator.simulate(
            motor, generator.constant_load(3600.0), sample_s=1.0, steps_per_sample=2
        )
        assert 60.0 < truth.winding_degC[-1] < 250.0, motor
