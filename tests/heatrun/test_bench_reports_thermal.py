"""Thermal Behaviour Analysis: losses, equilibrium, the network of a run, and its digits."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from msgspec import UNSET
from run_near_truth import INSTRUMENTS, TRUTH, run_near_truth, seal

from heatrun.errors import InputError
from heatrun.io.texts import LANGUAGES, Texts
from heatrun.readers.read import read_record
from heatrun.record.motor import EQUILIBRIA, Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.reports.certificate import at_end
from heatrun.reports.terminal import _at_end
from heatrun.results.model import WindingAtEnd
from heatrun.runs.equilibrium import SteadyRise, equilibria, equilibrium, steady_rise, stretches
from heatrun.runs.result import describe_test, with_network_rise
from heatrun.runs.run import open_run
from heatrun.simulation import simulate_file
from heatrun_reports import build_report, read_reference
from heatrun_reports.analysis.drive import split_losses
from heatrun_reports.document import document_content
from heatrun_reports.thermal import thermal_report

MOTOR = Motor("reference", phase_resistance_ohm=0.0062)


def held(name: str, time_s: np.ndarray, **channels) -> Record:
    """A record; a number is a channel that does not change."""
    columns = {key: np.broadcast_to(v, time_s.shape) for key, v in channels.items()}
    return Record(name, {"time_s": time_s, **columns})


def warming(*, tau_s: float, hours: float, noise_K: float = 0.1, rounding_K: float = 0.0) -> Record:
    """A rise of 80 K that settles with one time constant."""
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, 3600.0 * hours + 1.0, 2.0)
    winding = 20.0 + 80.0 * (1.0 - np.exp(-time_s / tau_s)) + noise_K * rng.normal(size=time_s.size)
    if rounding_K:
        winding = rounding_K * np.round(winding / rounding_K)
    return held("warming", time_s, winding_degC=winding, ambient_degC=20.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory, bench, generator):
    """A run that nobody writes into."""
    folder = tmp_path_factory.mktemp("near") / "run"
    return run_near_truth(folder, MOTOR, bench(generator.duty(600.0), seed=20))


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
    record = held("worksheet", np.array([0.0, 0.1]), phase_current_A=74.18334424, losses_W=521.843,
                  winding_degC=22.0)  # fmt: skip
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
    record = held("coarse", time_s, winding_degC=winding, ambient_degC=20.0)
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
    assert [drawing.caption[:25] for drawing in report.drawings] == ["All measured temperatures"]


def test_the_network_of_a_run_meets_the_truth_of_an_independent_simulator(run, bench, generator):
    record = bench(generator.duty(1800.0), seed=21)
    found = open_run(run).predict(record, motor=MOTOR)
    # noise of a 20 s mean: drift 0.2 K, rounding 1 K over 20 readings 0.06 K; parameters 0.5 %
    assert found.rmse_K < 0.5
    assert found.coverage_95() > 0.85
    assert found.is_held_out
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
    shown = {drawing.caption.split()[0] for drawing in report.drawings}
    assert {"Measured", "Heat", "Losses,"} <= shown
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
        open_run(run).predict(Record("amplified", amplified), motor=MOTOR)


def test_draws_leave_out_starts_and_keep_fixed_values(run):
    draws = open_run(run).draws().thin(50)
    values = draws.of_test(None)
    assert set(values) == {*TRUTH, *INSTRUMENTS}
    assert np.ptp(values["power_gain"]) == 0.0
    assert np.std(values["Ceq_w"]) > 0.0
    assert set(draws.of_test("duty")) == {*values, "Tw_start", "Tsr_start", "load_timing"}


DAMAGE = {
    "posterior": ("posterior_second.nc", lambda whole: b"no netcdf"),
    "format": ("model_second.toml", lambda whole: whole.replace(b"[losses]", b"[loss]")),
    "effect": ("model_second.toml",
               lambda whole: whole.replace(b"effects = []", b'effects = ["of_ours_alone"]', 1)),
}  # fmt: skip


@pytest.mark.parametrize("damage", [*DAMAGE, "missing"])
def test_a_damaged_run_is_an_error_of_ours(run, damage, tmp_path):
    run = Path(shutil.copytree(run, tmp_path / "run"))
    if damage == "missing":
        (run / "model_second.toml").unlink()
    else:
        name, spoil = DAMAGE[damage]
        (run / name).write_bytes(spoil((run / name).read_bytes()))
        seal(run)
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


BENCH = Path(__file__).parents[3] / "shared" / "bench" / "paderborn_profile24_heatrun_2p5s.csv.gz"


def two_loads(*, first_min: float = 73.0, second_min: float = 70.0, tau_min: float = 6.0) -> Record:
    """A rise of 100 K at 60 N m that settles, then at none to 37 K; a sample every 2 s."""
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, 60.0 * (first_min + second_min), 2.0)
    end_s, tau_s = 60.0 * first_min, 60.0 * tau_min
    is_first = time_s < end_s
    top = 100.0 * (1.0 - np.exp(-end_s / tau_s))
    after = 37.0 + (top - 37.0) * np.exp(-(time_s - end_s) / tau_s)
    rise = np.where(is_first, 100.0 * (1.0 - np.exp(-time_s / tau_s)), after)
    return held(
        "two_loads", time_s,
        torque_Nm=np.where(is_first, 60.0, 0.0) + 0.2 * rng.normal(size=time_s.size),
        speed_rpm=5500.0 + rng.normal(size=time_s.size),
        winding_degC=20.0 + rise + 0.05 * rng.normal(size=time_s.size), ambient_degC=20.0,
    )  # fmt: skip


def test_a_load_step_after_equilibrium_takes_nothing_back():
    record = two_loads()
    first, second = equilibria(record, MOTOR, "winding_degC")
    # after 40 min of 6 min the winding is within 100 exp(-40/6) = 0.13 K of its end
    held = (record.time_s > 2400.0) & (record.time_s < 4380.0)
    assert np.ptp(record["winding_degC"][held]) < 0.6  # with noise of 0.05 K, four times over
    assert first.is_reached is True
    # each stretch ends within two minutes of the step
    assert first.stretch.to_s == pytest.approx(4380.0, abs=120.0)
    assert second.stretch.from_s == pytest.approx(4380.0, abs=120.0)
    assert second.is_reached is True
    # 1000 exp(-t/6 min) K/h are 2 K/h after 37 min, and the line is laid over a third before
    assert first.first_reached_s is not None
    assert 2200.0 < first.first_reached_s < 4000.0
    report = build_report("thermal", MOTOR, record)
    assert "not reached" not in report.summary
    (row,) = [row for row in report.rows if row.name == "winding_equilibrium"]
    assert row.value == "reached"


def test_a_slow_part_is_not_reached_on_the_stretch_that_is_too_short_for_it():
    first, second = equilibria(two_loads(tau_min=40.0), MOTOR, "winding_degC")
    # 150 K/h exp(-73/40) are 24 K/h at the end
    assert first.is_reached is False
    assert second.is_reached is False


@pytest.mark.skipif(not BENCH.exists(), reason="the measured bench records are not here")
def test_a_measured_heat_run_is_reached_before_its_load_step():
    motor = Motor("PMSM", sink="coolant")
    first, *_ = equilibria(read_record(BENCH, motor), motor, "winding_degC")
    assert first.is_reached is True
    # held within 0.2 K from minute 40 on; the torque goes at 4392 s
    assert first.stretch.to_s == pytest.approx(4392.0, abs=120.0)
    assert max(map(abs, first.gradients_K_per_h)) < 0.5


def test_pulses_within_a_minute_are_one_load_and_a_drive_is_none():
    time_s = np.arange(0.0, 5400.0)
    pulses = np.where(time_s % 30.0 < 10.0, 80.0, 10.0)
    (whole,) = stretches(Record("pulses", {"time_s": time_s, "torque_Nm": pulses}), 1800.0)
    assert whole.length_s == pytest.approx(5399.0, abs=60.0)
    steps = np.repeat(np.random.default_rng(1).uniform(-50.0, 50.0, 45), 120)
    assert stretches(Record("drive", {"time_s": time_s, "torque_Nm": steps}), 1800.0) == ()


def test_a_change_of_speed_or_flow_or_a_gap_ends_a_stretch():
    time_s = np.arange(0.0, 7200.0)
    late = time_s >= 3600.0
    torque = np.full(time_s.size, 20.0)
    for channel in ("speed_rpm", "coolant_flow_L_per_min", "fan"):
        channels = {"time_s": time_s, "torque_Nm": torque, channel: np.where(late, 0.5, 1.0)}
        assert len(stretches(Record("changed", channels), 1800.0)) == 2
    away = (time_s < 3000.0) | (time_s > 4200.0)
    gap = Record("gap", {"time_s": time_s[away], "torque_Nm": torque[away]})
    assert [round(s.to_s) for s in stretches(gap, 1800.0)] == [3000, 7199]


def test_a_course_stopped_early_is_continued_to_its_steady_state():
    time_s = np.arange(0.0, 4500.0, 5.0)  # 75 min of a time constant of 50 min
    rng = np.random.default_rng(8)
    rise = 90.0 * (1.0 - np.exp(-time_s / 3000.0)) + 0.1 * rng.normal(size=time_s.size)
    found = steady_rise(time_s, rise)
    assert isinstance(found, SteadyRise)
    low, high = found.rise_95_K
    assert low < 90.0 < high
    assert high - low < 6.0  # 20 K are still to come: a fifth of them is left open at most
    assert found.tau_s == pytest.approx(3000.0, rel=0.05)
    later = np.array([6000.0, 9000.0, 60000.0])
    below, middle, above = found.course(later)
    truth = 90.0 * (1.0 - np.exp(-later / 3000.0))
    assert np.all((below < truth) & (truth < above))
    assert middle[-1] == pytest.approx(found.rise_K, abs=0.05)


def test_the_band_of_a_continued_course_holds_what_it_says():
    inside, told = 0, 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        length_s = 60.0 * rng.uniform(40.0, 120.0)
        time_s = np.arange(0.0, length_s, 10.0)
        tau_s = length_s * rng.uniform(0.3, 1.0)
        slow = 60.0 * (1.0 - np.exp(-time_s / tau_s))
        rise = slow + 8.0 * (1.0 - np.exp(-time_s / 100.0)) + 0.2 * rng.normal(size=time_s.size)
        found = steady_rise(time_s, rise)
        if isinstance(found, SteadyRise):
            told += 1
            inside += found.rise_95_K[0] <= 68.0 <= found.rise_95_K[1]
    assert told >= 50
    # 95 % of 60 less two standard deviations (1.7) of such a count
    assert inside / told > 0.88


def test_a_straight_course_is_continued_to_nothing():
    time_s = np.arange(0.0, 2400.0, 10.0)
    rise = 0.01 * time_s + 0.2 * np.random.default_rng(9).normal(size=time_s.size)
    assert "no bend" in str(steady_rise(time_s, rise))


def test_the_report_marks_what_is_extrapolated():
    time_s = np.arange(0.0, 4500.0, 5.0)
    rng = np.random.default_rng(8)
    winding = 20.0 + 90.0 * (1.0 - np.exp(-time_s / 3000.0)) + 0.1 * rng.normal(size=time_s.size)
    record = held("stopped", time_s, winding_degC=winding, torque_Nm=30.0, ambient_degC=20.0)
    report = build_report("thermal", MOTOR, record)
    (row,) = [row for row in report.rows if row.name == "winding_steady_degC"]
    assert "extrapolated" in row.label
    assert row.value == pytest.approx(110.0, abs=3.0)
    assert "95 %" in row.note
    assert any(name == "Extrapolated" for name, _ in report.definitions)
    (drawing,) = [each for each in report.drawings if each.caption.startswith("All")]
    assert "extrapolated" in drawing.caption
    axis, _ = drawing.draw().axes
    labels = axis.get_legend_handles_labels()[1]
    assert any("extrapolated" in label for label in labels)


def test_nothing_is_continued_where_the_load_is_not_known_to_be_held():
    record = two_loads(tau_min=40.0)
    bare = {name: record[name] for name in ("time_s", "winding_degC", "ambient_degC")}
    (found,) = equilibria(Record("bare", bare), MOTOR, "winding_degC")
    assert found.is_reached is False
    assert "held" in str(found.steady)


def test_the_network_of_a_run_continues_a_heat_run_to_its_rest(run, bench, generator):
    record = bench(generator.constant_load(2700.0), seed=22, name="stopped")
    report = build_report("thermal", MOTOR, record, run=run)
    machine = generator.reference_motor()
    current, speed = float(machine.current(0.55)), 0.7 * machine.rated_speed_rpm
    other = float(machine.other_loss(current, speed))
    # Tw = T0 + Req_sr (Pjs + Pol) + Req_w Pjs with Pjs = k (234.5 + Tw), solved for Tw
    k = float(machine.copper_loss_per_kelvin(current))
    own = (TRUTH["Req_sr"] + TRUTH["Req_w"]) * k
    rows = {row.name: row for row in report.rows}
    sink = float(np.mean(report.result.simulated.test.inputs.ambient[-30:]))
    winding = (sink + TRUTH["Req_sr"] * other + own * 234.5) / (1.0 - own)
    assert rows["winding_network_steady_degC"].value == pytest.approx(winding, abs=1.0)
    stator = winding - TRUTH["Req_w"] * k * (234.5 + winding)
    assert rows["stator_network_steady_degC"].value == pytest.approx(stator, abs=1.0)
    assert "extrapolated" in rows["winding_network_steady_degC"].label
    # one exponential of 30 min comes to the same within what it leaves open
    low, high = report.result.settled[-1].steady.rise_95_K
    assert low - 1.0 < winding - sink < high + 1.0
    # and what a calibration says of the test is the same
    described = describe_test(record, reduce(record, MOTOR), MOTOR, "calibration", 0.0)
    said = with_network_rise(described, report.result.simulated)
    assert said.equilibrium.network_K == pytest.approx(winding - sink, abs=1.0)
    low, high = said.equilibrium.network_95_K
    assert low < said.equilibrium.network_K < high
    assert "by IEC 60034-1:2010" in _at_end(said)
    assert "the network tends to a rise of" in _at_end(said)


OF_20_mOHM = Motor("m", phase_resistance_ohm=0.02)


@pytest.fixture(scope="module")
def printed():
    """Label, value, unit and note of the rows of a step of 80 A, read to 0.1 °C, one time constant
    of half an hour, stopped after 90 min; the rows of its tables too."""
    time_s = np.arange(0.0, 5400.0, 10.0)
    rise = 60.0 * (1.0 - np.exp(-time_s / 1800.0))
    noise = 0.2 * np.random.default_rng(3).standard_normal(time_s.size)
    record = held("step", time_s, winding_degC=np.round(20.0 + rise + noise, 1), ambient_degC=20.0,
                  phase_current_A=80.0, losses_W=612.3)  # fmt: skip
    report = thermal_report(OF_20_mOHM, record)
    content = document_content(report, {})
    tables = {t["title"]: {line[0]: line[1:] for line in t["lines"]} for t in content["tables"]}
    return {row[0]: row[1:] for row in content["rows"]}, tables, report


def test_losses_end_where_the_class_of_their_instruments_does(printed):
    rows, _, report = printed
    # 3 (80 A)^2 0.02 ohm (234.5 + 61)/(234.5 + 25) = 437.3 W, 61 degC on average; a current of
    # class 0.5 enters squared, so U = 2 * 2 * 0.005 * 437 = 8.7 W: one decimal
    value, _, note = rows["P_Js, loss of the winding, mean"]
    assert len(value.partition(".")[2]) == 1
    assert float(value) == pytest.approx(437.3, abs=0.5)
    assert note.startswith("± 8.7 W")
    # power of class 1: 2 * 0.01 * 612.3 = 12 W and 8.7 W together are 15 W
    assert "." not in rows["P_ol, other losses, mean"][0]
    assert rows["P_ol, other losses, mean"][2].startswith("± 15 W")
    (joule,) = [r for r in report.rows if r.name == "joule_mean_W"]
    assert joule.value != round(joule.value, 1)  # the JSON keeps every digit


def test_a_temperature_that_was_extrapolated_has_the_decimals_of_its_limits(printed):
    rows, _, _ = printed
    value, unit, note = rows["Winding in equilibrium, extrapolated"]
    assert unit == "°C"
    assert len(value.partition(".")[2]) == 1
    assert note.startswith("95 %: ")
    low = note.removeprefix("95 %: ").split(" ")[0]
    assert len(low.partition(".")[2]) == 1


def test_readings_keep_the_decimals_of_the_logger(printed):
    rows, tables, _ = printed
    winding = tables["Temperatures"]["winding [°C]"]
    # start, end, lowest, highest to the step of 0.1 °C, the mean one further
    assert all(len(winding[k].partition(".")[2]) == 1 for k in (0, 1, 2, 4))
    assert len(winding[3].partition(".")[2]) == 2
    assert rows["Winding, highest"][0] == winding[4]


def test_a_gradient_has_the_digits_of_its_standard_error(printed):
    _, tables, _ = printed
    _, _, gradient, error, *_ = tables["Gradients of the rise over the sink"]["winding [K/h]"]
    assert len(error.replace(".", "").lstrip("0")) == 2
    assert len(gradient.partition(".")[2]) == len(error.partition(".")[2])


def test_a_cool_down_is_not_what_a_test_settles_at():
    """An hour of warming by 80 K, an hour of cooling: what is told is of the load."""
    tau_s = 2000.0
    time_s = np.arange(0.0, 7200.0, 2.0)
    heats = time_s < 3600.0
    top = 80.0 * (1.0 - np.exp(-3600.0 / tau_s))
    rise = np.where(heats, 80.0 * (1.0 - np.exp(-time_s / tau_s)),
                    top * np.exp(-(time_s - 3600.0) / tau_s))  # fmt: skip
    noise = 0.1 * np.random.default_rng(5).normal(size=time_s.size)
    record = held("warmed and cooled", time_s, winding_degC=20.0 + rise + noise, ambient_degC=20.0,
                  phase_current_A=100.0 * heats, losses_W=500.0 * heats)  # fmt: skip
    found = describe_test(record, reduce(record, MOTOR), MOTOR, "calibration", 0.0).equilibrium
    assert isinstance(found, WindingAtEnd)
    assert found.to_s <= 3600.0
    assert found.gradient_K_per_h > 0.0
    assert found.continued_K == pytest.approx(80.0, abs=5.0)
    cooling = Record("cooled", {name: values[~heats] for name, values in record.channels.items()})
    said = describe_test(cooling, reduce(cooling, MOTOR), MOTOR, "calibration", 0.0)
    assert said.equilibrium is UNSET


@pytest.mark.parametrize(
    ("hours", "is_reached", "key"), [(1.0, False, "before"), (4.0, True, "reached")]
)
def test_a_run_says_whether_the_winding_had_settled(hours, is_reached, key):
    """By the same criterion, with the gradient's two standard errors, in every language."""
    bare = warming(tau_s=2000.0, hours=hours)
    one = np.ones(bare.time_s.size)
    load = {"phase_current_A": 100.0 * one, "losses_W": 500.0 * one}
    record = Record("warming", {**bare.channels, **load})
    said = describe_test(record, reduce(record, MOTOR), MOTOR, "calibration", 0.0)
    found = said.equilibrium
    assert isinstance(found, WindingAtEnd)
    assert found.is_reached is is_reached
    gradient = 80.0 * 3600.0 / 2000.0 * np.exp(-(hours - 0.2) * 3600.0 / 2000.0)
    assert 0.3 * gradient < found.gradient_K_per_h < 1.3 * gradient
    assert (found.continued_K is None) is is_reached
    if found.continued_95_K is not None:
        low, high = found.continued_95_K
        assert low - 2.0 < 80.0 < high + 2.0
    assert key in at_end(said)
    assert f"± {2.0 * found.gradient_se_K_per_h:.1g}"[:4] in at_end(said)
    assert all("warming" in at_end(said, Texts(language)) for language in LANGUAGES)
    swinging = Record(
        "duty", {**record.channels, "phase_current_A": 100.0 * (record.time_s % 600.0)}
    )
    duty = describe_test(swinging, reduce(record, MOTOR), MOTOR, "calibration", 0.0)
    assert duty.equilibrium is UNSET
    assert at_end(duty) == ""


@pytest.mark.parametrize("standard", EQUILIBRIA)
def test_each_standard_judges_by_its_own_change(standard):
    """A straight drift is within the limit at 0.9 of it, beyond it at 1.1, and open at it."""
    by, time_s = EQUILIBRIA[standard], np.arange(0.0, 7201.0, 2.0)
    machine = replace(MOTOR, equilibrium=standard)
    noise = 0.02 * np.random.default_rng(1).normal(size=time_s.size)
    for share, expected in ((0.9, True), (1.1, False), (1.0, None)):
        drift = 80.0 + share * by.K_per_h / 3600.0 * time_s
        record = held("drift", time_s, winding_degC=drift + noise, ambient_degC=20.0)
        found = equilibrium(record, machine, "winding_degC")
        assert found.is_reached is expected
        assert len(found.gradients_K_per_h) == by.num_intervals
    assert f"{by.K_per_h:g} K/h lie" in found.reason
    report = build_report("thermal", machine, record)
    (defined,) = [said for name, said in report.definitions if name == "Thermal equilibrium"]
    assert standard in defined
    say = Texts("it")
    say.again(defined)
    say.again(found.reason)
    assert not say.unknown
    (line,) = [line for line in report.tables[1].lines if line.name == "winding"]
    assert line.cells[5] is not None
