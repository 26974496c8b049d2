"""Records at the edge of what a bench gives: checked, fitted or refused in words."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from heatrun import cli
from heatrun.checks import check_record
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
    sd = np.sqrt(np.diag(found.covariance))
    timing = found.values().get("load_timing[edge]")
    # by straight lines the load comes halfway between two samples
    assert timing == pytest.approx((0.5 - into) * step, abs=0.1 * step)
    for position, slot in enumerate(found.slots):
        if slot.name in TRUTH:
            z = float(slot.parameter.score(TRUTH[slot.name]))
            # four parameters at four standard errors: one false alarm in 4000
            assert abs(found.z[position] - z) < 4.0 * sd[position], slot.name


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


def test_a_record_at_a_millisecond_is_reduced_exactly(machine):
    record = simulated(1e-3, 2, (0, 120))
    blocks = reduce(record, machine)
    energy = float(np.sum(np.asarray(blocks.inputs.losses)) * float(blocks.inputs.step))
    time, losses = record.time_s, record["losses_W"]
    held = blocks.inputs.num_time * float(blocks.inputs.step) - time[-1]
    inside = float(np.sum(0.5 * np.diff(time) * (losses[1:] + losses[:-1])))
    expected = inside + held * losses[-1]
    # both sum 120,000 numbers: rounding alone
    assert energy == pytest.approx(expected, rel=1e-10)


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
    record = simulated(1.0, 10, (0, 100))
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
