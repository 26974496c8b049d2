"""Two prototypes on one manoeuvre: offset and bias come back, and verdicts by tolerances."""

import gzip
import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from heatrun.errors import InputError, UsageError
from heatrun.io.texts import Texts
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import Record
from heatrun_reports import Reference, build_report, read_reference
from heatrun_reports.analysis.general_information import parse_tolerances
from heatrun_reports.analysis.pair import pair_records
from heatrun_reports.analysis.validation import Validation, validate
from heatrun_reports.validation_report import validation_report

PROTOTYPES = Path(__file__).parents[2] / "data" / "synthetic" / "prototypes"
MOTOR = Motor("reference", phase_resistance_ohm=0.0062)
CORNERS_S = [0, 60, 65, 200, 204, 380, 390, 520, 523, 700]
POWER_W = [0, 0, 8000, 8000, -3000, -3000, 5000, 5000, 500, 500]


def manoeuvre(
    offset_s: float = 0.0, *, step_s: float = 1.0, bias_K: float = 0.0, seed: int = 1, **more: float
) -> Record:
    """One drive as a logger that started `offset_s` before it sees it."""
    rng = np.random.default_rng(seed)
    clock = np.arange(0.0, 650.0, step_s)
    moment = clock - offset_s
    power = np.interp(moment, CORNERS_S, POWER_W) + more.get("power_zero_W", 0.0)
    winding = 30.0 + 25.0 * (1.0 - np.exp(-np.clip(moment - 60.0, 0.0, None) / 150.0))
    return Record(
        f"logger_{seed}",
        {
            "time_s": clock,
            "dc_power_W": power + 20.0 * rng.normal(size=clock.size),
            "winding_degC": winding + bias_K + 0.1 * rng.normal(size=clock.size),
        },
    )


@pytest.mark.parametrize("offset_s", [12.3, -40.0, 0.0])
def test_a_known_offset_and_a_known_bias_come_back(offset_s):
    test, other = manoeuvre(), manoeuvre(offset_s, bias_K=2.0, seed=2)
    found = validate(test, Reference(other), MOTOR)
    # A logger that started 12.3 s earlier must be moved back by them.
    assert found.pair.offset.offset_s == pytest.approx(-offset_s, abs=found.pair.offset.sd_s)
    assert found.pair.offset.sd_s < 0.6  # two stamps of 1 s: sqrt(2/12)
    winding = of(found, "winding_degC")
    # standard error of the mean of two noises of 0.1 K over 600 samples: 0.006 K
    assert winding.bias == pytest.approx(-2.0, abs=0.03)
    assert winding.rmse == pytest.approx(2.0, abs=0.03)
    # 2 K on a rise of 25 K, and 1.4 K by the two sensors: above both
    assert winding.verdict == "biased"


def test_the_offset_does_not_depend_on_bias_and_scale():
    other = manoeuvre(12.3, seed=2)
    scaled = Record("scaled", {**other.channels, "dc_power_W": 0.7 * other["dc_power_W"] + 900.0})
    plain = pair_records(manoeuvre(), other, MOTOR).offset.offset_s
    assert pair_records(manoeuvre(), scaled, MOTOR).offset.offset_s == pytest.approx(
        plain, abs=0.05  # the refinement stops at a hundredth of the 1 s step
    )  # fmt: skip


def test_a_tolerance_decides_between_agrees_biased_and_differs():
    test, other = manoeuvre(), manoeuvre(bias_K=2.0, seed=2)

    def verdict(tolerance: float) -> str:
        found = of(confronted(test, other, MOTOR, winding_degC=tolerance), "winding_degC")
        assert found.tolerance.decided_by == "given"
        return found.verdict

    assert verdict(3.0) == "agrees"
    assert verdict(1.0) == "biased"  # off by 2 K, spread by 0.14 K
    assert verdict(0.05) == "differs"


def test_the_energies_of_a_power_are_compared():
    test, other = manoeuvre(), manoeuvre(power_zero_W=360.0, seed=2)
    power = of(confronted(test, other, MOTOR), "dc_power_W")
    assert power.energy_kWh is not None
    # 360 W over the 649 s in common; noise of 28 W over 650 samples: 1.1 W of it
    assert power.energy_kWh[1] - power.energy_kWh[0] == pytest.approx(360 * 649 / 3.6e6, rel=0.01)
    assert power.bias == pytest.approx(-360.0, abs=4.0)


def test_a_finer_record_is_averaged_over_the_samples_of_the_coarser():
    found = pair_records(manoeuvre(step_s=0.1), manoeuvre(12.3, seed=2), MOTOR)
    assert "the test is averaged" in found.method
    assert found.offset.offset_s == pytest.approx(-12.3, abs=found.offset.sd_s)
    assert float(np.median(np.diff(found.time_s))) == pytest.approx(1.0)


NOISE = np.random.default_rng(3).normal(size=650)
SECONDS = np.arange(650.0)


@pytest.mark.parametrize(
    ("other", "offset_s", "said"),
    [
        (manoeuvre(seed=2), 1e4, "do not overlap"),
        (Record("noise", {"time_s": SECONDS, "dc_power_W": NOISE}), None,
         "records of one manoeuvre"),
        (Record("other", {"time_s": SECONDS, "torque_Nm": SECONDS}), None,
         "a signal that both records hold"),
    ],
    ids=["no time in common", "another manoeuvre", "no common signal"],
)  # fmt: skip
def test_records_that_cannot_be_compared_are_refused(other, offset_s, said):
    with pytest.raises(InputError, match=said):
        validate(manoeuvre(), Reference(other), MOTOR, offset_s=offset_s)


def test_a_manoeuvre_that_repeats_is_ambiguous_and_said():
    clock = np.arange(0.0, 1200.0)
    wave = Record("wave", {"time_s": clock, "dc_power_W": 1000.0 * np.sin(clock / 20.0)})
    later = Record("later", {"time_s": clock, "dc_power_W": 1000.0 * np.sin((clock - 0.4) / 20.0)})
    found = pair_records(wave, later, MOTOR)
    (doubt,) = [each for each in found.findings if each.id == "offset_ambiguous"]
    assert f"nearly as well as {found.offset.offset_s:+.1f} s" in doubt.message


def drift(name: str, rng: np.random.Generator, noise_K: float) -> Record:
    """A slow course of 4 K under white noise, a sample every 10 s for an hour."""
    clock = np.arange(0.0, 3600.0, 10.0)
    course = 30.0 + 4.0 * np.sin(clock / 1500.0) + noise_K * rng.normal(size=clock.size)
    return Record(name, {"time_s": clock, "winding_degC": course})


def test_a_slow_signal_alone_leaves_the_offset_uncertain_and_said():
    rng = np.random.default_rng(4)
    # noise of 0.7 K against a slope of 4/1500 K/s over 360 samples
    found = pair_records(drift("one", rng, 0.7), drift("two", rng, 0.7), MOTOR)
    assert found.offset.sd_s > 5.0
    assert abs(found.offset.offset_s) < 4.0 * found.offset.sd_s
    assert "offset_uncertain" in {f.id for f in found.findings}


@pytest.mark.slow
def test_the_stated_uncertainty_of_the_offset_is_that_of_its_errors():
    scores = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        found = pair_records(drift("one", rng, 0.5), drift("two", rng, 0.5), MOTOR).offset
        scores.append(found.offset_s / found.sd_s)
    # 95 % of the standard deviations of 40 scores lie in 0.78 ... 1.22 where the truth is 1; the
    # likelihood counts noise that is in both records once, so a third more is allowed above
    assert 0.78 < np.std(scores) < 1.6


def test_a_tolerance_for_a_signal_that_is_not_shared_is_said():
    found = validate(
        manoeuvre(), Reference(manoeuvre(seed=2)), MOTOR, tolerances={"torque_Nm": 1.0}
    )
    assert "tolerance_not_used" in {f.id for f in found.findings}


@pytest.mark.parametrize("text", ["winding_degC", "winding_degC=", "winding_degC=-1", "T=3"])
def test_a_tolerance_that_is_none_is_wrong_use(text):
    with pytest.raises(UsageError, match="--tolerance"):
        parse_tolerances([text])


def test_the_bundled_prototypes_give_back_what_was_hidden_in_the_logger():
    truth = json.loads((PROTOTYPES / "truth.json").read_text("utf-8"))["road_logger"]
    motor = load_motor(PROTOTYPES / "motor.toml")
    test = read_record(PROTOTYPES / "Test_2024_03_05_001.csv.gz", motor)
    other = read_reference(PROTOTYPES / "Road_2024_03_05_001.csv.gz", motor)
    report = build_report("real", motor, test, reference=other)
    found = report.result.pair.offset
    assert found.offset_s == pytest.approx(-truth["started_earlier_s"], abs=found.sd_s)
    signals = {s.channel: s for s in report.result.signals}
    # readings rounded to 1 K with noise of 0.2 K, 1026 of them; slow enough to hang together
    assert signals["winding_degC"].bias == pytest.approx(-truth["winding_reads_high_K"], abs=0.1)
    # noise of 0.3 A over 1026 samples, and ramps of 100 A/s seen at two rates
    assert signals["dc_current_A"].bias == pytest.approx(-truth["current_zero_A"], abs=0.1)
    assert signals["winding_degC"].verdict == "biased"
    assert signals["vehicle_speed_km_per_h"].verdict == "agrees"
    # 3 K on a rise of 17 K, and 8 % of energy, do not agree
    for name, verdict in (("energy_kWh", "differs"), ("consumption_Wh_per_km", "differs"),
                          ("distance_km", "agrees")):  # fmt: skip
        assert figure(report.result, name).verdict == verdict
    assert not report.summary.startswith("Agrees")
    assert "winding (biased)" in report.summary
    assert "energy (differs by +7.7 %)" in report.summary


def test_the_bundled_prototypes_can_be_made_again_and_match_their_checksums(tmp_path):
    words = [sys.executable, "-B", PROTOTYPES / "generate.py", "--out", tmp_path]
    subprocess.run(words, check=True, capture_output=True)
    page = (PROTOTYPES / "README.md").read_text("utf-8")
    stated = dict(re.findall(r"\| `([^`]+)` \| `([0-9a-f]{64})` \|", page))
    assert {path.name for path in tmp_path.iterdir()} == set(stated)
    for name, digest in stated.items():
        made, kept = (tmp_path / name).read_bytes(), (PROTOTYPES / name).read_bytes()
        assert hashlib.sha256(kept).hexdigest() == digest, name
        if name.endswith(".gz"):  # another build of zlib packs the same text differently
            made, kept = gzip.decompress(made), gzip.decompress(kept)
        assert made == kept, name


def test_what_drove_a_simulation_is_no_evidence(tmp_path):
    test = manoeuvre()
    drive = {"phase_current_A": 50.0 + 0.01 * test["dc_power_W"], "losses_W": test["dc_power_W"]}
    test = Record("bench", {**test.channels, **drive, "ambient_degC": np.full(650, 20.0)})
    columns = {
        **{n: test[n] for n in ("time_s", "phase_current_A", "losses_W", "ambient_degC")},
        "winding_degC": test["winding_degC"] + 1.0,
        "winding_95_low_degC": test["winding_degC"] - 1.0,
        "winding_95_high_degC": test["winding_degC"] + np.where(np.arange(650) < 325, 1.0, -0.5),
        "copper_loss_W": np.zeros(650),
        "other_loss_W": np.zeros(650),
    }
    path = tmp_path / "bench_virtual.csv"
    rows = np.stack(list(columns.values()), 1)[2:]  # such a file begins after its first step
    np.savetxt(path, rows, delimiter=",", comments="", header=",".join(columns), fmt="%.6f")
    motor = Motor("mapped", columns={"winding_degC": "T_w [degC]"})  # of the bench's own file
    found = validate(test, read_reference(path, motor), motor)
    assert found.pair.offset.offset_s == 2.0  # a reader counts time from the first sample
    verdicts = {s.channel: s.verdict for s in found.signals}
    assert verdicts["losses_W"] == verdicts["phase_current_A"] == "input"
    winding = of(found, "winding_degC")
    assert winding.bias == pytest.approx(-1.0, abs=1e-6)  # as written to six decimals
    assert winding.share_in_band == pytest.approx(0.5, abs=0.01)  # half of the samples by make
    assert [s.channel for s in found.judged] == ["winding_degC"]


CAR = Motor("car", phase_resistance_ohm=0.0062)
CLOCK = np.arange(0.0, 1201.0)
"""20 minutes, a sample a second."""


def drive(
    name: str, *, rise_K: float = 17.0, bias_K: float = 0.0, power_gain: float = 1.0, seed: int = 1
) -> Record:
    """2 kW and 36 km/h for 20 minutes, a winding that warms in a straight line from 20 °C."""
    rng = np.random.default_rng(seed)
    power = np.where((CLOCK > 60.0) & (CLOCK < 1140.0), 2000.0, 0.0)
    return Record(
        name,
        {
            "time_s": CLOCK,
            "dc_power_W": power_gain * power,
            "vehicle_speed_km_per_h": np.where(power > 0.0, 36.0, 0.0),
            "ambient_degC": 20.0 + 0.001 * rng.normal(size=CLOCK.size),
            "winding_degC": 20.0 + bias_K + rise_K * CLOCK / 1200.0
            + 0.001 * rng.normal(size=CLOCK.size),
        },
    )  # fmt: skip


def confronted(test: Record, other: Record, motor: Motor = CAR, **tolerances: float) -> Validation:
    return validate(test, Reference(other), motor, tolerances=tolerances, offset_s=0.0)


def of(found: Validation, channel: str):
    return next(s for s in found.signals if s.channel == channel)


def figure(found: Validation, name: str):
    return next(f for f in found.figures if f.name == name)


def test_without_a_vehicle_energies_are_compared_and_no_distance_is_named():
    pumps = []
    for name in ("a", "b"):
        channels = dict(drive(name).channels)
        del channels["vehicle_speed_km_per_h"]
        pumps.append(Record(name, channels))
    report = validation_report("real", Motor("pump"), pumps[0], Reference(pumps[1]), offset_s=0.0)
    assert [one.name for one in report.result.figures] == [
        "energy_kWh", "energy_without_regeneration_kWh"
    ]  # fmt: skip
    notes = {row.name: row.note for row in report.rows}
    assert notes["num_figures_judged"] == "energy"
    titles = [table.title for table in report.tables]
    assert titles == ["Signal by signal", "Energy over the time in common"]
    for language in ("de", "it"):
        say = Texts(language)
        assert all(say.again(title) != title for title in titles)


def test_a_large_rise_is_judged_by_its_share():
    found = of(confronted(drive("a", rise_K=100.0), drive("b", rise_K=100.0)), "winding_degC")
    # 5 % of the rise that is exceeded for a twentieth of the time: 0.05 * 0.95 * 100 K
    assert found.tolerance.value == pytest.approx(4.75, abs=0.01)
    assert found.tolerance.decided_by == "rise"
    assert "95.0 K" in found.tolerance.basis


def test_a_small_rise_is_judged_by_the_uncertainty_of_both_sensors():
    found = of(confronted(drive("a"), drive("b")), "winding_degC")
    # offset 0.5 K and 0.5 % of 0.95 * 17 K of rise for each of two sensors, k = 2
    u = np.sqrt(2.0) * np.hypot(0.5, 0.005 * 0.95 * 17.0)
    assert found.tolerance.value == pytest.approx(2.0 * u, abs=0.01)
    assert found.tolerance.decided_by == "uncertainty"


def test_the_sensor_class_of_the_motor_file_and_the_step_of_the_readings_count():
    better = Motor("car", parameters={"sensor_offset": ParameterOverride(sd=0.1)})
    coarse = drive("coarse")
    steps = np.round(coarse["winding_degC"])
    rounded = Record("coarse", {**coarse.channels, "winding_degC": steps})
    found = of(confronted(drive("a"), rounded, better), "winding_degC")
    # 0.1 K and 0.5 % of the rise twice, and 1/12 of a squared step of 1 K: k = 2
    u = np.sqrt(2.0 * (0.1**2 + (0.005 * 0.95 * 17.0) ** 2) + 1.0 / 12.0)
    # or 5 % of 16.15 K: 0.81 K
    assert 2.0 * u < 0.05 * 0.95 * 17.0
    assert found.tolerance.decided_by == "rise"
    assert f"combined uncertainty {2.0 * u:.2g} K" in found.tolerance.basis


@pytest.mark.parametrize(
    ("bias_K", "verdict"), [(1.0, "agrees"), (-3.0, "biased"), (3.0, "biased")]
)
def test_a_bias_is_judged_on_a_rise_of_17_kelvin(bias_K, verdict):
    found = confronted(drive("a", bias_K=bias_K), drive("b", seed=2))
    assert of(found, "winding_degC").verdict == verdict


def test_the_band_of_a_simulation_takes_the_place_of_its_sensor():
    other = drive("simulated")
    course = other["winding_degC"]
    bands = {"winding_degC": (course - 1.96, course + 1.96)}
    reference = Reference(other, bands=bands, starts_at_s=0.0)
    found = validate(drive("test"), reference, CAR, offset_s=0.0)
    # a band of 1 K standard deviation, and the test's own sensor
    u = np.sqrt(1.0**2 + 0.5**2 + (0.005 * 0.95 * 17.0) ** 2)
    assert of(found, "winding_degC").tolerance.value == pytest.approx(2.0 * u, abs=0.01)


@pytest.mark.parametrize(("gain", "verdict"), [(1.04, "agrees"), (1.077, "differs")])
def test_energy_and_consumption_are_judged_by_their_share(gain, verdict):
    found = confronted(drive("a", power_gain=gain), drive("b"))
    energy, consumption = figure(found, "energy_kWh"), figure(found, "consumption_Wh_per_km")
    # 2 kW over 1080 s with ramps of a second at either end: 0.6 kWh; 36 km/h over 1080 s
    assert energy.reference == pytest.approx(0.6, rel=2e-3)
    assert energy.difference_percent == pytest.approx(100.0 * (gain - 1.0), abs=1e-6)
    assert consumption.reference == pytest.approx(2000.0 / 36.0)
    assert energy.verdict == consumption.verdict == verdict
    assert figure(found, "distance_km").test == pytest.approx(10.8, rel=2e-3)


def test_an_absolute_tolerance_of_energy_can_be_given():
    found = confronted(drive("a", power_gain=1.04), drive("b"), energy_kWh=0.01)
    assert figure(found, "energy_kWh").verdict == "differs"  # 0.024 kWh apart
    assert parse_tolerances(["energy_kWh=0.01"]) == {"energy_kWh": 0.01}
    with pytest.raises(UsageError, match="energy_kWh"):
        parse_tolerances(["energy=0.01"])


def test_figures_are_taken_over_the_time_in_common():
    other = drive("other")
    early = CLOCK < 900.0
    short = Record("short", {name: values[early] for name, values in other.channels.items()})
    found = confronted(drive("whole"), short)
    # 60 to 899 s at 2 kW on both sides
    assert figure(found, "energy_kWh").test == pytest.approx(839.0 / 1800.0, rel=2e-3)
    assert figure(found, "energy_kWh").difference_percent == pytest.approx(0.0, abs=1e-9)


def test_power_at_the_dc_link_is_not_set_against_power_at_the_terminals():
    other = drive("terminals")
    channels = {**other.channels, "electrical_power_W": other["dc_power_W"]}
    del channels["dc_power_W"]
    found = confronted(drive("link"), Record("terminals", channels))
    energy = figure(found, "energy_kWh")
    assert energy.verdict == "not comparable"
    assert "terminals" in energy.note


def test_the_report_says_the_rule_the_tolerance_and_what_decided_it():
    test, other = drive("a", bias_K=3.0), Reference(drive("b"))
    report = build_report("real", CAR, test, reference=other, offset_s=0.0)
    (table, figures) = report.tables
    (winding,) = [line for line in table.lines if line.name == "winding"]
    assert "combined uncertainty" in winding.note
    assert "5 % of the rise of 16.1 K" in winding.note  # 0.95 * 17 K is 16.15 K
    assert any(name == "Tolerance" and "k = 2" in text for name, text in report.definitions)
    assert [line.name for line in figures.lines][:3] == [
        "Energy", "Energy without regeneration", "Distance",
    ]  # fmt: skip
    assert "5 % of the reference" in figures.note
