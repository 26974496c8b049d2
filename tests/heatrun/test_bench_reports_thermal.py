"""Thermal Behaviour Analysis: split of the losses, equilibrium, the network of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from run_near_truth import INSTRUMENTS, TRUTH, run_near_truth, seal

from heatrun.errors import InputError
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.runs.run import open_run
from heatrun.simulation import simulate_file
from heatrun_reports import build_report, read_reference
from heatrun_reports.analysis.drive import split_losses
from heatrun_reports.analysis.equilibrium import equilibrium
from heatrun_reports.simulated import simulate_run

MOTOR = Motor("reference", phase_resistance_ohm=0.0062)


def warming(*, tau_s: float, hours: float, noise_K: float = 0.1, rounding_K: float = 0.0) -> Record:
    """A rise of 80 K that settles with one time constant."""
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, 3600.0 * hours + 1.0, 2.0)
    winding = 20.0 + 80.0 * (1.0 - np.exp(-time_s / tau_s)) + noise_K * rng.normal(size=time_s.size)
    if rounding_K:
        winding = rounding_K * np.round(winding / rounding_K)
    return Record(
        "warming",
        {"time_s": time_s, "winding_degC": winding, "ambient_degC": np.full(time_s.size, 20.0)},
    )


@pytest.fixture
def run(tmp_path, bench, generator):
    return run_near_truth(tmp_path / "run", MOTOR, bench(generator.duty(600.0), seed=20))


def test_rises_stand_beside_temperatures():
    record = warming(tau_s=600.0, hours=1.0, noise_K=0.0)
    ambient = np.linspace(20.0, 25.0, record.time_s.size)
    moving = Record("moving", {**record.channels, "ambient_degC": ambient})
    report = build_report("thermal", MOTOR, moving)
    rows = {row.name: row for row in report.rows}
    winding = moving["winding_degC"]
    assert rows["winding_end_rise_K"].value == pytest.approx(winding[-1] - 25.0)
    assert rows["winding_highest_rise_K"].value == pytest.approx(np.max(winding - ambient))
    assert rows["winding_highest_rise_K"].unit == "K"
    assert "over ambient" in rows["winding_highest_rise_K"].label
    lines = {line.name: line for line in report.tables[0].lines}
    assert lines["winding over ambient"].unit == "K"
    assert "ambient over ambient" not in lines
    assert len(report.drawings[0].draw().axes) == 2
    hidden = Record("no sink", {k: v for k, v in record.channels.items() if k != "ambient_degC"})
    report = build_report("thermal", MOTOR, hidden)
    assert not any("rise_K" in row.name for row in report.rows)
    assert len(report.drawings[0].draw().axes) == 1


def test_the_losses_split_as_the_thesis_has_it():
    # line 12 of the published worksheet: 74.18334424 A at 22 degC and 521.843 W
    record = Record(
        "worksheet",
        {
            "time_s": np.array([0.0, 0.1]),
            "phase_current_A": np.full(2, 74.18334424),
            "losses_W": np.full(2, 521.843),
            "winding_degC": np.array([22.0, 22.0]),
        },
    )
    split = split_losses(record, MOTOR)
    # R = 0.0062 (234.5 + 22)/(234.5 + 25) = 0.00612832 ohm; 3 I^2 R = 101.1756 W
    assert split.joule_W == pytest.approx(101.1756, abs=1e-4)
    assert split.other_W == pytest.approx(521.843 - 101.1756, abs=1e-4)


@pytest.mark.parametrize(
    ("tau_s", "hours", "expected"),
    [
        # gradients are 80/tau exp(-t/tau): 0.0 K/h after 4 h of 15 min ...
        (900.0, 4.0, True),
        # ... and 80 * 2 exp(-3) = 8 to 22 K/h over the last hour of 1.5 h of 30 min
        (1800.0, 1.5, False),
        # half an hour is enough to see that 160 exp(-0.8) K/h are too many, a third of one is not
        (1800.0, 0.5, False),
        (1800.0, 0.33, None),
    ],
)
def test_equilibrium_of_an_exponential(tau_s, hours, expected):
    found = equilibrium(warming(tau_s=tau_s, hours=hours), MOTOR, "winding_degC")
    assert found.is_reached is expected


def test_gradients_are_those_of_the_exponential():
    found = equilibrium(warming(tau_s=1800.0, hours=1.5), MOTOR, "winding_degC")
    # least squares over a quarter of an hour, half a time constant: the slope at the middle,
    # 160 exp(-t/tau) K/h at 67.5 and 82.5 min, within 1 %, and noise of 0.1 K over 450 samples
    for gradient, middle_min in zip(found.gradients_K_per_h, (67.5, 82.5), strict=True):
        assert gradient == pytest.approx(160.0 * np.exp(-middle_min / 30.0), rel=0.02)


def test_the_moment_of_equilibrium_is_told_even_if_the_load_goes_afterwards():
    record = warming(tau_s=600.0, hours=3.0)
    cold = np.where(record.time_s > 7200.0, 60.0 * (1 - np.exp(-(record.time_s - 7200) / 600)), 0.0)
    cooled = Record("cooled", {**record.channels, "winding_degC": record["winding_degC"] - cold})
    found = equilibrium(cooled, MOTOR, "winding_degC")
    assert found.is_reached is False
    # the slope is 480 exp(-t/10 min) K/h; the mean over the first of two quarter hours that end at
    # e is 248 exp(-(e - 30 min)/10 min) K/h, which is 2 at 78 min; it is looked for every 5 min,
    # and its standard error comes on top
    assert found.first_reached_s is not None
    assert 4690.0 <= found.first_reached_s <= 5400.0


def test_coarse_readings_leave_equilibrium_undecided_rather_than_wrong():
    # 1.5 K in the last hour, written in whole degrees: one step or two, 0 to 3 K/h by their place
    rng = np.random.default_rng(7)
    time_s = np.arange(0.0, 7200.0, 10.0)
    winding = np.round(100.2 + 1.5 * time_s / 3600.0 + 0.02 * rng.normal(size=time_s.size))
    record = Record(
        "coarse",
        {"time_s": time_s, "winding_degC": winding, "ambient_degC": np.full(time_s.size, 20.0)},
    )
    found = equilibrium(record, MOTOR, "winding_degC")
    assert found.is_reached is None
    assert min(found.errors_K_per_h) > 0.3  # a step of 1 K in half an hour


def test_a_report_without_a_temperature_of_the_machine_says_what_to_map():
    record = Record("cold", {"time_s": np.arange(5.0), "ambient_degC": np.full(5, 20.0)})
    with pytest.raises(InputError, match="winding_degC"):
        build_report("thermal", MOTOR, record)


def test_a_report_without_resistance_keeps_the_temperatures_and_says_why():
    report = build_report("thermal", Motor("bare"), warming(tau_s=600.0, hours=0.2))
    assert "no_loss_split" in {f.id for f in report.findings}
    assert {drawing.name for drawing in report.drawings} == {"temperatures"}


def test_the_network_of_a_run_meets_the_truth_of_an_independent_simulator(run, bench, generator):
    record = bench(generator.duty(1800.0), seed=21)
    simulated = simulate_run(run, record, MOTOR)
    found = simulated.prediction
    # noise of a 20 s mean: drift 0.2 K, rounding 1 K over 20 readings 0.06 K; parameters 0.5 %
    assert found.rmse_K < 0.5
    assert found.coverage_95() > 0.85
    assert not simulated.is_seen
    truth = generator.simulate(
        generator.reference_motor(), generator.duty(1800.0), sample_s=1.0, steps_per_sample=20
    )
    stator = np.interp(found.time_s, truth.time_s, truth.stator_degC)
    low, high = found.nodes_95["stator"]
    assert np.mean((stator >= low) & (stator <= high)) > 0.9
    # what the winding gives to the stator is (Tw - Tsr)/Req_w by definition
    flow = (found.nodes["winding"] - found.nodes["stator"]) / TRUTH["Req_w"]
    assert found.flows["winding", "stator"] == pytest.approx(flow, abs=0.02 * np.max(flow))


def test_the_thermal_report_shows_the_run_and_the_virtual_one_compares(run, bench, generator):
    record = bench(generator.duty(1800.0), seed=21)
    report = build_report("thermal", MOTOR, record, run=run)
    names = {row.name for row in report.rows}
    assert {"rmse_K", "coverage_percent", "stator_end_degC", "P_ws_end_W", "P_se_end_W"} <= names
    assert {"against", "flows", "losses"} <= {drawing.name for drawing in report.drawings}
    for drawing in report.drawings:
        assert drawing.draw().axes
    assert any("heatrun sheet" in text for _, text in report.definitions)
    virtual = build_report("virtual", MOTOR, record, run=run, tolerances={"winding_degC": 1.0})
    (winding,) = virtual.result.judged
    assert winding.verdict == "agrees"
    assert winding.share_in_band is not None
    assert winding.share_in_band > 0.85


def test_a_run_that_another_test_drives_beyond_all_temperatures_is_refused(run, bench, generator):
    record = bench(generator.duty(1800.0), seed=21)
    amplified = {**record.channels, "losses_W": 1000.0 * record["losses_W"]}  # mW taken for W
    with pytest.raises(InputError, match="copper melts"):
        simulate_run(run, Record("amplified", amplified), MOTOR)


def test_draws_leave_out_starts_and_keep_fixed_values(run):
    draws = open_run(run).draws().thin(50)
    values = draws.of_test(None)
    assert set(values) == {*TRUTH, *INSTRUMENTS}
    assert np.ptp(values["power_gain"]) == 0.0
    assert np.std(values["Ceq_w"]) > 0.0
    assert set(draws.of_test("duty")) == {*values, "Tw_start", "Tsr_start", "load_timing"}


@pytest.mark.parametrize("damage", ["posterior", "format", "effect", "missing"])
def test_a_damaged_run_is_an_error_of_ours(run, damage):
    text = (run / "model_second.toml").read_text("utf-8")
    if damage == "posterior":
        (run / "posterior_second.nc").write_bytes(b"no netcdf")
        seal(run)
    elif damage == "format":
        (run / "model_second.toml").write_text(text.replace("[losses]", "[loss]"), "utf-8")
        seal(run)
    elif damage == "effect":
        (run / "model_second.toml").write_text(
            text.replace("effects = []", 'effects = ["of_ours_alone"]', 1), "utf-8"
        )
        seal(run)
    else:
        (run / "model_second.toml").unlink()
    with pytest.raises(InputError, match=r"run|of_ours_alone"):
        open_run(run).draws()


def test_a_simulated_record_carries_its_band_along(run, bench, generator, tmp_path):
    record = bench(generator.duty(1800.0), seed=21)
    test = tmp_path / "bench.csv"
    pd.DataFrame(dict(record.channels)).to_csv(test, index=False)
    made = simulate_file(MOTOR, str(run), test, "second", tmp_path, seed=0)
    assert made["no_bands"] == ""
    reference = read_reference(Path(made["file"]), MOTOR)
    assert set(reference.bands) == {"winding_degC", "stator_degC"}
    low, high = reference.bands["winding_degC"]
    # noise of 0.2 K alone gives 0.8 K, parameters of 0.5 % at most a few more
    assert np.all((high - low > 0.5) & (high - low < 6.0))
    found = build_report("virtual", MOTOR, read_record(test, MOTOR), reference=reference).result
    assert found.pair.offset.offset_s == reference.starts_at_s
    (winding,) = found.judged
    # the start is read to 1 K, so it is off by up to 0.5 K, which the stator keeps for half an hour
    assert winding.bias == pytest.approx(0.0, abs=0.6)
    assert winding.share_in_band is not None
    assert winding.share_in_band > 0.6  # of 2 s means, whose rounding is not in a band of 20 s
