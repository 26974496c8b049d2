"""The bundled data and the simulated bench that makes them."""

import ast
import csv
import gzip
import hashlib
import json
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import simpson
from scipy.linalg import expm

DATA = Path(__file__).parents[2] / "data"
SYNTHETIC = DATA / "synthetic"
RECORDS = {"step_30min": 1800, "step_90min": 5400, "duty_30min": 1800, "duty_90min": 5400}

FLOAT = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


def text_of(path: Path) -> str:
    return gzip.decompress(path.read_bytes()).decode("ascii")


def numbers(text: str) -> list[float]:
    return [float(number) for number in FLOAT.findall(text)]


def table_of(name: str) -> pd.DataFrame:
    separator, decimal = (";", ",") if name == "duty_30min" else (",", ".")
    return pd.read_csv(SYNTHETIC / f"{name}.csv.gz", sep=separator, decimal=decimal)


@pytest.mark.parametrize("name", ["thesis", "synthetic", "synthetic/hidden_cause"])
def test_checksums_of_the_description_hold(name: str) -> None:
    folder = DATA / name
    stated = dict(
        re.findall(
            r"\| `([^`]+)` \| `([0-9a-f]{64})` \|", (folder / "README.md").read_text("utf-8")
        )
    )
    data = {path.name for path in folder.glob("*.*")} - {
        "README.md",
        "generate.py",
        "generate_hidden.py",
    }
    assert set(stated) == data
    for file, digest in stated.items():
        assert hashlib.sha256((folder / file).read_bytes()).hexdigest() == digest, file


@pytest.mark.slow
def test_the_hidden_cause_can_be_made_again(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-B", SYNTHETIC / "generate_hidden.py", "--out", tmp_path],
        check=True,
        capture_output=True,
    )
    for path in tmp_path.iterdir():
        kept = SYNTHETIC / "hidden_cause" / path.name
        is_packed = path.suffix == ".gz"  # other versions of zlib pack otherwise
        one, other = (text_of(p) if is_packed else p.read_text("utf-8") for p in (path, kept))
        if path.suffix != ".json":
            assert one == other
            continue
        # how strong the cause must be is searched for: to nine digits with other versions of NumPy
        assert FLOAT.sub("#", one) == FLOAT.sub("#", other)
        assert numbers(one) == pytest.approx(numbers(other), rel=1e-8)
    assert len(list(tmp_path.iterdir())) == 5


def test_the_command_makes_the_same_records_again(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-B", SYNTHETIC / "generate.py", "--out", tmp_path],
        check=True,
        capture_output=True,
    )
    assert {path.name for path in tmp_path.iterdir()} == {
        "truth.json",
        *(f"{name}.csv.gz" for name in RECORDS),
    }
    assert (tmp_path / "truth.json").read_bytes() == (SYNTHETIC / "truth.json").read_bytes()
    for name in RECORDS:
        made, kept = tmp_path / f"{name}.csv.gz", SYNTHETIC / f"{name}.csv.gz"
        # Texts, not packed bytes: another build of zlib packs the same text differently.
        assert text_of(made) == text_of(kept), name
        assert made.read_bytes()[3:8] == bytes(5), "a name or a time stands in the gzip header"


@pytest.mark.parametrize(("name", "duration_s"), RECORDS.items())
def test_record_agrees_with_its_truth(name: str, duration_s: int) -> None:
    table, known = table_of(name), json.loads((SYNTHETIC / "truth.json").read_text("ascii"))
    assert (SYNTHETIC / f"{name}.csv.gz").stat().st_size < 700_000
    assert list(table.columns) == ["t", "Is", "Pd", "Te", "Tw_m", "speed_rpm"]
    assert len(table) == duration_s * 10 + 1

    minutes = table.iloc[::600]
    # Single precision resolves 0.49 ms at 5400 s.
    np.testing.assert_allclose(minutes["t"], known[name]["time_s"], rtol=0.0, atol=0.5e-3)
    error = minutes["Tw_m"] - np.array(known[name]["winding_degC"])
    # Half a step of rounding and five standard deviations of the noise, sqrt(0.2^2 + 0.1^2) K.
    assert error.abs().max() < 0.5 + 5.0 * np.hypot(0.2, 0.1)
    assert (minutes["Tw_m"] % 1.0 == 0.0).all()
    assert table["Pd"].max() < 1500.0


def test_single_precision_stamps_are_those_of_the_published_sheet() -> None:
    stamps = [line.split(",")[0] for line in text_of(SYNTHETIC / "step_90min.csv.gz").split("\n")]
    with (DATA / "thesis" / "worksheet.csv").open(encoding="utf-8", newline="") as file:
        published = [row["t [s]"] for row in csv.DictReader(file)]
    # The clock's step doubles when it passes 4 s, two seconds into the record; the last published
    # stamp, 2.1 s, lies beyond.
    assert stamps[1:22] == published[:21]


def test_motor_file_and_truth_describe_the_published_motor() -> None:
    truth = json.loads((SYNTHETIC / "truth.json").read_text("ascii"))["motor"]
    motor = tomllib.loads((SYNTHETIC / "motor.toml").read_text("utf-8"))
    published = tomllib.loads((DATA / "thesis" / "constants.toml").read_text("utf-8"))
    head = published["worksheet"]
    assert {name: truth[name] for name in published["second_order"]} == published["second_order"]
    assert truth["resistance_coefficient_degC"] == head["resistance_coefficient_degC"]
    assert motor["motor"]["name"] == truth["name"]
    assert motor["motor"]["rated_speed_rpm"] == truth["rated_speed_rpm"]
    for ours, theirs in (
        ("phase_resistance_ohm", "phase_resistance_ohm"),
        ("reference_temperature_degC", "phase_reference_degC"),
    ):
        assert truth[ours] == motor["winding"][ours] == head[theirs]


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


def test_a_clean_machine_leaves_little_to_see_and_comes_back_from_its_seed(hidden_bench):
    case, again = hidden_bench.make_case((), 7), hidden_bench.make_case(("clean",), 7)
    assert case.visible_misfit_K < 0.12
    for one, other in zip(case.tests, again.tests, strict=True):
        for name, values in one.columns.items():
            np.testing.assert_array_equal(values, other.columns[name])
    other = hidden_bench.make_case((), 8)
    assert not np.array_equal(other.tests[0].reading, case.tests[0].reading)
    assert [t.role for t in case.tests] == ["calibration", "calibration", "holdout"]
    assert case.tests[0].columns["time_s"].size == 14_401


def test_what_is_not_known_is_refused(hidden_bench):
    with pytest.raises(ValueError, match=r"speed_coolin'.*clean machine"):
        hidden_bench.make_case(("speed_coolin",), 7)
    with pytest.raises(ValueError, match="twice"):
        hidden_bench.make_case(("radiation", "radiation"), 7)
    with pytest.raises(ValueError, match="single_step"):
        hidden_bench.make_case((), 7, kind="one_step")
    with pytest.raises(ValueError, match="above zero"):
        hidden_bench.make_case(("radiation",), 7, target_K=0.0)


@pytest.mark.slow
def test_a_cause_is_given_the_misfit_that_was_asked_for(hidden_bench):
    case = hidden_bench.make_case(("speed_cooling",), 7, target_K=0.5)
    # a secant on a nearly linear function, ended at 7 %; the clean machine's 0.05 K add a little
    assert case.visible_misfit_K == pytest.approx(0.5, rel=0.12)


def test_integration_has_converged(hidden_bench, generator, monkeypatch):
    plant = import_module(f"{hidden_bench.__name__}.plant")
    machine = generator.reference_motor()

    def course(spacing):
        time = spacing * np.arange(round(1200.0 / spacing) + 1)
        current = 70.0 + 50.0 * np.sin(2 * np.pi * time / 240.0)
        speed, ambient = np.full(time.size, 3000.0), np.full(time.size, 20.0)
        return plant.integrate(plant.Plant(machine), current, speed, ambient, 20.0).winding_degC

    coarse = course(plant.HALF_S)
    monkeypatch.setattr(plant, "HALF_S", 0.25)
    # fourth order, steps of 1 s against the 97 s of the winding: (1/97)^5/120 of 100 K per step
    assert np.max(np.abs(coarse - course(0.25)[::2])) < 1e-6


@pytest.mark.parametrize("cause", ["ac_copper_loss", "neighbour_body", "rotor_node"])
def test_heat_is_neither_made_nor_lost(hidden_bench, generator, cause):
    """Far from the sink, the machine with all its bodies keeps what is put in."""
    causes = import_module(f"{hidden_bench.__name__}.causes")
    plant_module = import_module(f"{hidden_bench.__name__}.plant")
    machine = replace(generator.reference_motor(), Req_sr=1e9)
    time = 0.5 * np.arange(7201)
    load = causes.Load(0, time, np.full(time.size, 80.0), np.full(time.size, 4000.0),
                       np.full(time.size, 20.0))  # fmt: skip
    plant = plant_module.Plant(machine)
    if cause == "ac_copper_loss":
        plant.ac = np.full(time.size, 0.2)
    elif cause == "neighbour_body":
        plant.neighbour = (3.0, 8000.0, 0.0)
    else:
        plant.rotor = (0.3, 4000.0, 0.3)
    course = plant_module.integrate(plant, load.current, load.speed, load.ambient, 20.0)
    put_in = np.sum(0.5 * (course.copper_W + course.other_W)[:-1]) + 0.0
    stored = machine.Ceq_w * (course.winding_degC[-1] - 20.0)
    stored += machine.Ceq_sr * (course.stator_degC[-1] - 20.0)
    if cause == "ac_copper_loss":
        assert stored == pytest.approx(put_in, rel=2e-3)
    else:
        # the third body keeps the rest: what is missing from two nodes fits its capacity
        body = plant.neighbour or plant.rotor
        assert body is not None
        rise = (put_in - stored) / body[1]
        assert 0.3 * (course.stator_degC[-1] - 20.0) < rise < 2.5 * (course.stator_degC[-1] - 20.0)
