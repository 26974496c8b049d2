"""Records at the edge of what a bench gives: checked, fitted or refused in words."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from recovered import holds, sd
from scipy.linalg import expm

from heatrun import cli
from heatrun.checks import check_record
from heatrun.checks.figures import COPPER_SHARE, EFFICIENCY, LENGTH_S, RARE
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

TRUTH = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}
RS0, B, T_REF = 0.0062, 234.5, 25.0


def simulated(step, minutes, currents, *, ambient=20.0, values=TRUTH, pol=300.0, noise=0.1,
              into=0.5):  # fmt: skip
    """A record of steps of current by matrix exponentials.

    Samples lie at the share `into` of the intervals of constant current: 0.5 is where straight
    lines between samples put the jumps, 0 has them on the samples.
    """
    num = int(minutes * 60.0 / step)
    current = np.repeat(currents, -(-num // len(currents)))[:num].astype(float)
    state = np.array([ambient, ambient, 1.0])  # stator, winding, one
    stator, winding = np.empty(num), np.empty(num)
    flow, losses = {}, np.empty(num)
    on = current > 0
    for index in range(num):
        k = 3 * RS0 / (B + T_REF) * current[index] ** 2
        key = (current[index], on[index])
        if key not in flow:
            C_w, C_s, R_w, R_s = (values[n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
            other = pol if on[index] else 0.0
            A = np.array(
                [
                    [-(1 / R_w + 1 / R_s) / C_s, 1 / R_w / C_s, (other + ambient / R_s) / C_s],
                    [1 / R_w / C_w, (k - 1 / R_w) / C_w, k * B / C_w],
                    [0.0, 0.0, 0.0],
                ]
            )
            flow[key] = expm(A * into * step), expm(A * (1.0 - into) * step)
        before, after = flow[key]
        state = before @ state
        stator[index], winding[index] = state[:2]
        losses[index] = (pol if on[index] else 0.0) + k * (B + state[1])
        state = after @ state
    rng = np.random.default_rng(4)
    return Record(
        "edge",
        {
            "time_s": step * np.arange(num),
            "phase_current_A": current,
            "losses_W": losses,
            "ambient_degC": np.full(num, ambient) + 0.02 * rng.standard_normal(num),
            "winding_degC": winding + noise * rng.standard_normal(num),
        },
    )


@pytest.fixture(scope="module")
def machine():
    return Motor("edge", phase_resistance_ohm=RS0)


def errors_of(record, machine):
    return {f.id for f in check_record(record, machine) if f.severity == "error"}


LOADS = (0, 100, 60, 120, 0, 80, 110, 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("step", "ambient", "into"),
    [
        (1.0, -40.0, 0.5),
        (10.0, 20.0, 0.0),
        pytest.param(10.0, 20.0, 0.5, marks=pytest.mark.slow),
        pytest.param(10.0, 20.0, 1.0, marks=pytest.mark.slow),
    ],
    ids=["cold", "jumps_on_samples", "jumps_between_samples", "jumps_after_samples"],
)
def test_a_cold_chamber_and_a_slow_logger_are_fitted(step, ambient, into, machine):
    record = simulated(step, 90, LOADS, ambient=ambient, into=into)
    assert errors_of(record, machine) == set()
    found = fit(Problem.of(Model.of("second", machine), machine, [reduce(record, machine)]))
    timing = found.values().get("load_timing[edge]")
    # by straight lines the load comes halfway between two samples
    assert timing == pytest.approx((0.5 - into) * step, abs=0.1 * step)
    # four parameters at four standard errors: one false alarm in 4000
    holds(found, TRUTH, sds=4.0)


@pytest.mark.slow
def test_gaps_of_one_sample_change_nothing_but_a_little(machine):
    whole = simulated(1.0, 60, LOADS)
    kept = np.ones(whole.time_s.size, dtype=bool)
    kept[100::200] = False
    holed = Record("edge", {name: values[kept] for name, values in whole.channels.items()})
    assert errors_of(holed, machine) == set()
    model = Model.of("second", machine)
    one, two = (
        fit(Problem.of(model, machine, [reduce(record, machine)])) for record in (whole, holed)
    )
    sd = np.sqrt(np.diag(one.covariance))[: one.z.size]
    network = [i for i, slot in enumerate(one.slots) if slot.name in TRUTH]
    # 18 of 3600 readings are missing: the estimate moves by a small part of its uncertainty
    assert np.all(np.abs(one.z - two.z)[network] < 0.3 * sd[network])


@pytest.mark.parametrize(
    ("make", "ids"),
    [
        (lambda: simulated(1.0, 60, (0,), pol=0.0), "no current, no losses"),
        (lambda: simulated(60.0, 60, LOADS), "a sample each minute"),
        (lambda: simulated(1e-3, 0.05, (0, 120)), "three seconds at a millisecond"),
    ],
    ids=["nothing_happens", "a_minute", "a_millisecond"],
)
def test_records_that_say_too_little_are_said_to(make, ids, machine):
    findings = check_record(make(), machine)
    graver = [f for f in findings if f.severity in ("error", "warning")]
    assert graver, ids
    assert all(f.message for f in graver)


@pytest.fixture
def command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "motor.toml").write_text(
        f'[motor]\nname = "edge"\n[winding]\nphase_resistance_ohm = {RS0}\n'
    )

    def call(record, parameters, *more):
        pd.DataFrame(dict(record.channels)).to_csv(tmp_path / "test.csv", index=False)
        (tmp_path / "p.toml").write_text("".join(f"{n} = {v}\n" for n, v in parameters.items()))
        code = cli.main(["simulate", "motor.toml", "p.toml", "test.csv", "--json", *more])
        captured = capsys.readouterr()
        return code, json.loads(captured.out), captured.err

    return call


def test_a_winding_faster_than_the_record_is_refused_in_words(command):
    code, out, err = command(simulated(10.0, 30, LOADS), {**TRUTH, "Ceq_w": 1.0})
    assert code == 1
    assert "longer than the fastest node allows" in out["error"]["problem"]
    assert "higher rate" in err


def test_a_thermal_runaway_is_said(command):
    record = simulated(1.0, 30, LOADS)
    current = np.where(record.time_s > 60.0, 800.0, 0.0)
    away = Record("edge", {**record.channels, "phase_current_A": current})
    code, out, _ = command(away, TRUTH)
    assert code == 1
    assert "where copper melts" in out["error"]["problem"]
    assert "At 800 A it runs away" in out["error"]["problem"]


def test_a_virtual_record_follows_the_exact_one(command, tmp_path):
    record = simulated(1.0, 30, LOADS, noise=0.0)
    code, out, _ = command(record, TRUTH)
    assert code == 0
    # the start is read off the first samples, and steps of 2 s smear the jumps of the load
    assert out["simulated"][0]["rmse_K"] < 0.1


PLANT = {"Ceq_w": 60e3, "Ceq_sr": 2.4e6, "Req_w": 0.01, "Req_sr": 0.006}
PERIOD_S, DAYS = 1800.0, 5
LOSSES_W, OHM = (400.0, 1500.0), 0.02


def logged(seed):
    """Load in straight lines between samples, a constant resistance; exact at samples."""
    rng = np.random.default_rng(seed)
    time_s = PERIOD_S * np.arange(DAYS * 48)
    current = np.repeat(rng.choice([0.0, 120.0, 200.0, 260.0], time_s.size // 6 + 1), 6)
    current = np.abs(current[: time_s.size] + 5.0 * rng.standard_normal(time_s.size))
    other = np.where(current > 50.0, LOSSES_W[1], LOSSES_W[0])
    copper = 3.0 * OHM * current**2
    C_w, C_s, R_w, R_s = PLANT.values()
    A = np.zeros((6, 6))  # winding, stator over ambient; two heats and their slopes
    A[0, :2] = [-1.0 / (C_w * R_w), 1.0 / (C_w * R_w)]
    A[1, :2] = [1.0 / (C_s * R_w), -1.0 / (C_s * R_w) - 1.0 / (C_s * R_s)]
    A[0, 2], A[1, 3], A[2, 4], A[3, 5] = 1.0 / C_w, 1.0 / C_s, 1.0, 1.0
    step = expm(A * PERIOD_S)
    state, rise = np.zeros(2), np.zeros(time_s.size)
    for i in range(1, time_s.size):
        heat = np.array([copper[i - 1], other[i - 1]])
        slope = (np.array([copper[i], other[i]]) - heat) / PERIOD_S
        state = (step @ np.concatenate([state, heat, slope]))[:2]
        rise[i] = state[0]
    channels = {
        "time_s": time_s, "phase_current_A": np.sqrt(copper / (3.0 * OHM)),
        "losses_W": copper + other, "ambient_degC": np.full(time_s.size, 25.0),
        "winding_degC": np.round(25.0 + rise + 0.1 * rng.standard_normal(time_s.size), 1),
    }  # fmt: skip
    return Record("plant", channels)


# a coefficient so large that the resistance does not change, as in the simulation
SLOW_MOTOR = Motor("m", phase_resistance_ohm=OHM, resistance_coefficient_degC=1e9)


def test_days_have_no_more_steps_than_half_a_day_and_shorter_records_have_short_ones():
    days = reduce(logged(3), SLOW_MOTOR)
    assert 7_000 < days.inputs.num_time < 9_000
    first = replace(logged(3), channels={k: v[:20] for k, v in logged(3).channels.items()})
    assert float(reduce(first, SLOW_MOTOR).inputs.step) == 5.0


@pytest.mark.slow
def test_half_hours_over_days_are_fitted():
    found = fit(
        Problem.of(Model.of("second", SLOW_MOTOR), SLOW_MOTOR, [reduce(logged(3), SLOW_MOTOR)])
    )
    holds(found, PLANT)
    assert sd(found, "Req_sr") < 0.1


CHANNELS = (
    "time_s", "phase_current_A", "losses_W", "ambient_degC", "coolant_degC", "winding_degC",
    "stator_degC", "speed_rpm",
)  # fmt: skip
MOTORS = (
    Motor("balance", phase_resistance_ohm=0.0062),
    Motor("unknown resistance"),
    Motor("map", losses="map", sink="coolant", phase_resistance_ohm=0.0062),
)

ANY = st.floats(allow_nan=True, allow_infinity=True)
SPECIAL = st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e308, -1e308, 5e-324, 20.0, 850.0])
MODERATE = st.floats(-100.0, 1000.0)


@st.composite
def records(draw):
    num = draw(st.integers(0, 80))
    keep = draw(st.sets(st.sampled_from(CHANNELS), min_size=4)) | {"time_s"}
    elements = draw(st.sampled_from([ANY, SPECIAL, MODERATE, ANY | SPECIAL | MODERATE]))
    channels = {name: draw(hnp.arrays(float, num, elements=elements)) for name in sorted(keep)}
    if draw(st.booleans()):
        channels["time_s"] = np.arange(num) * draw(st.floats(1e-3, 100.0))
    return Record("any", channels)


@given(records(), st.sampled_from(MOTORS))
def test_no_record_stops_the_checks(record, motor):
    for finding in check_record(record, motor):
        assert finding.severity in ("error", "warning", "note")
        assert finding.message
        assert finding.test == "any"


@pytest.mark.parametrize("num", [0, 1, 2, 3])
@pytest.mark.parametrize("value", [np.nan, np.inf, 25.0])
def test_tiny_record_is_an_error_not_a_crash(num, value):
    channels = {name: np.full(num, value) for name in CHANNELS}
    channels["time_s"] = np.arange(float(num))
    found = check_record(Record("tiny", channels), MOTORS[0])
    assert "too_few_samples" in {f.id for f in found if f.severity == "error"}


def test_the_smallest_numbers_have_a_cost():
    assert COPPER_SHARE.cost(5e-324) == EFFICIENCY.cost(5e-324) == RARE
    assert LENGTH_S.cost(5e-324) > LENGTH_S.cost(1.0) > RARE


def test_columns_of_different_length_and_no_clock_are_errors():
    columns = {name: np.zeros(50) for name in CHANNELS}
    uneven = Record("uneven", columns | {"winding_degC": np.zeros(49)})
    clockless = Record("clockless", {k: v for k, v in columns.items() if k != "time_s"})
    for record, word in ((uneven, "winding_degC"), (clockless, "time_s")):
        (finding,) = check_record(record, MOTORS[0])
        assert (finding.id, finding.severity) == ("missing_channel", "error")
        assert word in finding.message


def long_record(num):
    """A warm-up of so many samples with noise."""
    rng = np.random.default_rng(5)
    time_s = np.arange(num) * 0.1
    current = 100.0 + 50.0 * np.sin(time_s / 300.0)
    heat = 3.0 * 0.0062 * current**2 + 200.0
    return Record(
        "long",
        {
            "time_s": time_s,
            "phase_current_A": current,
            "losses_W": heat + rng.standard_normal(num),
            "ambient_degC": 22.0 + 0.02 * rng.standard_normal(num),
            "winding_degC": np.round(22.0 + 100.0 * -np.expm1(-time_s / 1800.0)),
            "speed_rpm": np.full(num, 3000.0),
        },
    )


def test_a_million_samples_are_checked_without_a_loop_over_them(num_calls):
    short, long = long_record(100_000), long_record(1_000_000)
    check_record(short, MOTORS[0])  # what is imported at first is called once
    few = num_calls(lambda: check_record(short, MOTORS[0]))
    assert 100 < num_calls(lambda: check_record(long, MOTORS[0])) < 2 * few
