"""GNU Octave integrates prova.mat as lptn does, for both orders; skipped where it is absent."""

import gzip
import re
import time
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from octave import needs_octave, octave
from run_near_truth import TRUTH

from heatrun.export import mat_bytes, simulate_variables, thesis_variables
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.record.record import Record

DATA = Path(__file__).parents[2] / "data" / "synthetic"
TEMPLATES = files("heatrun.export") / "templates"
SCRIPT = TEMPLATES / "run_prova.m"
SECOND = TRUTH | {"Tw_start": 20.4, "Tsr_start": 19.8}
FIRST = {"Ceq": 12500.0, "Req": 0.132, "Tw_start": 20.4}


@pytest.fixture(scope="module")
def motor():
    return load_motor(DATA / "motor.toml")


@pytest.fixture(scope="module")
def long_record(motor):
    """90 minutes at 10 Hz with hard steps of load."""
    return read_record(DATA / "duty_90min.csv.gz", motor)


def every(record, step):
    return Record(record.name, {name: values[::step] for name, values in record.channels.items()})


def run_octave(folder, variables):
    """Return the course that the script writes, the RMSE it prints, and its seconds."""
    (folder / "prova.mat").write_bytes(mat_bytes(variables))
    (folder / "run_prova.m").write_bytes(SCRIPT.read_bytes())
    started = time.perf_counter()
    said = octave(folder / "run_prova.m", folder)
    seconds = time.perf_counter() - started
    printed = re.search(r"RMSE of Tw to Tw_m: ([0-9.]+) K over (\d+) readings", said)
    assert printed, said
    return pd.read_csv(folder / "prova_course.csv"), float(printed[1]), seconds


def compare(folder, variables, capsys, what):
    """Assert that Octave and lptn agree at every sample, and print by how much."""
    course = simulate_variables(variables)
    table, rmse, seconds = run_octave(folder, variables)
    worst = max(np.max(np.abs(table[f"{node}_degC"] - T)) for node, T in course.temperature.items())
    with capsys.disabled():
        print(f"\n{what}: Octave and lptn differ by at most {worst:.1e} K at {len(table)} samples "
              f"({seconds:.1f} s in Octave)")  # fmt: skip
    assert table["time_s"].to_numpy() == pytest.approx(course.time, abs=1e-9 * course.time[-1])
    # Required is 0.01 K. Left are the inputs, which lptn takes as means over its steps and the
    # script as straight lines: 1e-4 of the change within a step.
    assert worst < 2e-3
    # the script prints four decimals
    assert rmse == pytest.approx(course.rmse(course.sensed), abs=1.5e-4)


@needs_octave
@pytest.mark.parametrize(("order", "values"), [("first", FIRST), ("second", SECOND)])
def test_both_orders_on_ninety_minutes_at_10_hz(
    order, values, long_record, motor, tmp_path, capsys
):
    variables, _ = thesis_variables(long_record, values, motor, order)
    compare(tmp_path, variables, capsys, f"{order} order, {long_record.name}")


@needs_octave
def test_a_slow_and_uneven_record_with_missing_readings(long_record, motor, tmp_path, capsys):
    slow = every(long_record, 400)  # one sample in 40 s, the winding's time constant is 96 s
    kept = np.delete(np.arange(slow.time_s.size), [20, 21, 22, 50])
    channels = {name: values[kept] for name, values in slow.channels.items()}
    channels["winding_degC"] = np.where(kept % 7 == 3, np.nan, channels["winding_degC"])
    variables, notes = thesis_variables(Record("slow", channels), SECOND, motor, "second")
    assert "without a reading" in notes[0]
    compare(tmp_path, variables, capsys, "second order, 40 s and uneven")


@needs_octave
def test_our_reader_takes_the_course_for_a_record(long_record, motor, tmp_path):
    variables, _ = thesis_variables(every(long_record, 50), SECOND, motor, "second")
    run_octave(tmp_path, variables)
    record = read_record(tmp_path / "prova_course.csv")
    assert set(record.channels) == {"time_s", "winding_degC", "stator_degC"}
    assert record["winding_degC"] == pytest.approx(simulate_variables(variables).sensed, abs=2e-3)


@pytest.mark.parametrize("name", ["run_prova.m", "run_network.m"])
def test_the_script_is_plain_matlab(name):
    """None of what Octave alone understands: # comments, +=, !=, printf, double quotes, endif."""
    code = [line.partition("%")[0] if line.lstrip().startswith("%") else line
            for line in (TEMPLATES / name).read_text().splitlines()]  # fmt: skip
    text = re.sub(r"'[^'\n]*'", "''", "\n".join(code))  # texts may hold anything
    for foreign in (r"#", r"\+=", r"-=", r"\+\+", r"!", r'"', r"\bend[a-z]+", r"\bprintf\b",
                    r"\*\*", r"\bfunction\b", r"\bunwind_protect\b"):  # fmt: skip
        assert not re.search(foreign, text), foreign


def test_the_thesis_file_of_figure_10_has_its_shapes(long_record, motor):
    """45846 samples there; here as many as the record has, and 1x1 scalars."""
    variables, _ = thesis_variables(long_record, SECOND, motor, "second")
    shapes = {name: value.shape for name, value in variables.items()}
    signals = {"Is", "Pd", "Te", "Tw_m", "t"}
    assert {name for name, shape in shapes.items() if shape == (54001, 1)} == signals
    assert {shape for name, shape in shapes.items() if name not in signals} == {(1, 1)}
    with gzip.open(DATA / "duty_90min.csv.gz", "rt") as file:
        assert sum(1 for _ in file) == 54002
