"""The C of an export: compiled without a warning, as lptn, an observer that judges its sensor."""

from __future__ import annotations

import ctypes
import hashlib
import io
import re
import shutil
import subprocess
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import norm
from simulators import fmu_error, has_modelica, modelica_error, vectors_text

from heatrun import cli
from heatrun.errors import InputError
from heatrun.export import export_source, mat_bytes, network_variables, simulate_network
from heatrun.export.c_file import LAWS, CSource, in_comment, links_of
from heatrun.export.missed import Missed, of_losses
from heatrun.export.network_course import read_network
from heatrun.export.parameters import entries
from heatrun.export.rerun import of_no_test, read_run_test
from heatrun.export.sources import faults, with_outputs, without_false_alarms
from heatrun.export.variables import Corrections
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.model.network_text import read_network as network_of_text
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.record.record import Record

DATA = Path(__file__).parents[2] / "data" / "synthetic"
COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-O1"]
MISSED = Missed(
    heat=0.01, heat_s=1200.0, slow_K=0.2, slow_s=60.0, white_K=0.03, sensor_K=0.0, sink_K=0.0,
    share=0.0, resolution_K=0.0,
)  # fmt: skip
SAID = {
    "run": "run",
    "sha256": "0" * 64,
    "machine": "bench",
    "network": "second order",
    "corrections": "by nothing",
}
VALUES = {
    "Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625, "Rs0": 0.0062,
    "Ceq": 12500.0, "Req": 0.132, "Tw_start": 60.4, "Tsr_start": 55.8,
    "speed_cooling.g": 0.9, "speed_cooling.m": 0.73, "radiation.eA": 0.1,
}  # fmt: skip
LEAD_OHM = 0.0004
TWO_SINKS = b"""
[network]
name = "sinks"
nodes = ["winding", "yoke"]
sinks = ["ambient", "coolant"]
links = [["winding", "yoke"], ["yoke", "ambient"], ["yoke", "coolant"]]
losses = { copper = "winding", iron = "yoke", mechanical = "yoke" }
by_speed = ["mechanical"]
sensors = { winding_degC = "winding" }
"""


@pytest.fixture(scope="module")
def machine():
    return load_motor(DATA / "motor.toml")


@pytest.fixture(scope="module")
def half_hour(machine):
    """The bundled duty's first half hour, with a fan and a coolant."""
    record = read_record(DATA / "duty_30min.csv.gz", machine)
    waves = 0.5 + 0.5 * np.sin(record.time_s / 200.0)
    further = {"fan": waves, "coolant_degC": 30.0 + 5.0 * waves}
    return Record(record.name, {**record.channels, **further})


@pytest.fixture(scope="module")
def two_hours(half_hour):
    """The same, four times on end."""
    time = half_hour.time_s
    channels = {name: np.tile(values[:-1], 4) for name, values in half_hour.channels.items()}
    channels["time_s"] = np.concatenate([time[:-1] + k * (time[-1] - time[0]) for k in range(4)])
    return Record(half_hour.name, channels)


def source(half_hour, machine, network="second", effects=(), said=SAID, step=1.0, **values):
    model = Model.of(network, machine, effects_named(effects, "test"))
    centres = {each.name: each.centre for each in model.form.parameters}
    centres |= {name: 40.0 for _, name in model.form.starts}
    centres |= {
        f"{kind.card.id}.{name}": quantity.typical
        for kind in model.effects for name, quantity in kind.card.parameters.items()
    }  # fmt: skip
    variables, _ = network_variables(
        half_hour, {**centres, **VALUES, **values}, machine, model,
        rated_speed=300.0, rated_current=100.0,
    )  # fmt: skip
    cold = (VALUES["Rs0"], LEAD_OHM)
    return CSource.of(read_network(mat_bytes(variables)), MISSED, said, step, cold)


BUILT = {}
"""Programs of this module by what they were compiled of: each is compiled once."""


def build(folder, made, *words, harness="main.c"):
    """Compile the sources with a harness; return the program."""
    for name, text in made.texts().items():
        (folder / name).write_bytes(text)
    sources = ("thermal_network.h", "thermal_network.c", harness)
    key = (*words, *((folder / name).read_bytes() for name in sources))
    if key not in BUILT:
        BUILT[key] = compiled(folder, *words, harness=harness)
    return BUILT[key]


def compiled(folder, *words, harness):
    """Compile what lies in a folder; return the program."""
    name = f"replay_{len(BUILT)}"  # the others stay
    command = [str(COMPILER), *STRICT, *words, "-o", name, harness, "thermal_network.c"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / name


def replay(folder, made, *words):
    """Return the largest difference to lptn that the harness prints [K]."""
    program = build(folder, made, *words)
    (folder / "vectors.csv").write_bytes(vectors_text(made))
    done = subprocess.run([program, "vectors.csv"], cwd=folder, capture_output=True, text=True,
                          check=False)  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert not done.stderr
    steps, difference = re.search(r"(\d+) steps .* difference (\S+) K", done.stdout).groups()
    assert int(steps) == made.num_vectors > 100
    return float(difference)


OF_LAWS = {"fan_cooling.g": 0.8, "ac_copper_loss.k": 0.3, "stray_load_loss.k": 60.0,
           "iron_loss_in_winding.k": 25.0, "rotor_node.P": 60.0, "rotor_node.rise": 12.0,
           "rotor_node.m": 0.9, "neighbour_body.C": 4000.0, "housing_node.x": 0.3,
           "end_winding_node.f": 0.4, "end_winding_node.p": 0.3, "natural_convection.f": 0.4,
           "insulation_conductivity.b": 0.002, "loss_gain.g": -0.03, "external_loss.k": 0.1,
           "copper_coefficient.dB": -8.0, "ambient_recirculation.r": 0.004,
           "sensor_lag.tau": 20.0}  # fmt: skip

OF_SECOND = tuple(law for law in LAWS if law not in ("speed_loss", "winding_node"))
alone = partial(pytest.param, marks=pytest.mark.slow)
"""One law by itself; together they are in each run of the tests."""


@needs_compiler
@pytest.mark.parametrize(
    ("network", "effects", "values"),
    [
        ("first", ("winding_node", "radiation"), {}),
        ("four", (), {}),
        ("second", OF_SECOND, OF_LAWS),
        (network_of_text(TWO_SINKS, "sinks.toml"), (),
         {"P_mechanical_n": 30.0, "P_mechanical_n2": 5.0}),
        alone("second", (), {}),
        alone("first", (), {}),
        *(alone("second", (law,), OF_LAWS) for law in OF_SECOND),
        alone("second", ("ac_copper_loss", "iron_loss_in_winding"), OF_LAWS),
    ],
    ids=lambda value: "+".join(value) if isinstance(value, tuple) else None,
)  # fmt: skip
def test_it_is_as_lptn(tmp_path, two_hours, machine, network, effects, values):
    is_as_lptn(tmp_path, two_hours, machine, network, effects, values)


@needs_compiler
def test_a_linear_network_is_as_the_exponential_of_its_matrix(tmp_path, half_hour, machine):
    v, made = VALUES, source(half_hour, machine)
    rows = np.empty((7200, 4))
    minute = np.arange(7200) // 60
    rows[:, 0] = 120.0 + 100.0 * np.sin(minute)
    rows[:, 1] = 3e-2 * rows[:, 0] ** 2 + 50.0
    rows[:, 2] = 20.0 + 5.0 * np.cos(0.3 * minute)
    rows[:, 3] = np.nan
    T, *_ = observed(tmp_path, made, 40.0, 5.0, rows)
    C = np.array([v["Ceq_w"], v["Ceq_sr"]])
    now, exact = np.array([40.0, 40.0, 1.0]), []
    for current, loss, sink, _ in rows[:, :4]:
        copper = 3 * v["Rs0"] / (234.5 + made.found["Tref"]) * current**2
        slopes = np.zeros((3, 3))  # of both nodes and of 1
        slopes[0] = copper - 1 / v["Req_w"], 1 / v["Req_w"], copper * 234.5
        slopes[1] = (1 / v["Req_w"] - copper, -1 / v["Req_w"] - 1 / v["Req_sr"],
                     loss - copper * 234.5 + sink / v["Req_sr"])  # fmt: skip
        now = expm(slopes / np.append(C, 1.0)[:, None]) @ now
        exact.append(now[:2])
    assert np.abs(T - exact).max() < 1e-6


@needs_compiler
def test_losses_of_a_map_come_on_top(tmp_path, two_hours, machine):
    values = {"ac_copper_loss.k": 0.3, "stray_load_loss.k": 60.0, "iron_loss_in_winding.k": 25.0}
    laws = ("ac_copper_loss", "stray_load_loss", "iron_loss_in_winding")
    is_as_lptn(tmp_path, two_hours, replace(machine, losses="map"), "second", laws, values)


def is_as_lptn(folder, record, machine, network, effects, values):
    """C, FMU and Modelica have the temperatures of lptn."""
    made = source(record, machine, network, effects, **values)
    assert replay(folder, made) < 1e-6
    assert replay(folder, made, "-DHEATRUN_REAL=float") < 0.05
    parameters = entries(made, Model.of(network, machine, effects_named(effects, "test")))
    assert fmu_error(folder, made, parameters) < 1e-6
    if has_modelica:
        assert modelica_error(made, parameters) < 1e-6


@pytest.fixture(scope="module")
def every_law(half_hour, machine, tmp_path_factory):
    """A folder with the source that holds all laws with an observer, and one with two sinks."""
    folder = tmp_path_factory.mktemp("every_law")
    network = network_of_text(TWO_SINKS, "sinks.toml")
    sinks = source(half_hour, machine, network, ("end_winding_node", "sensor_lag"), **OF_LAWS,
                   P_mechanical_n=30.0, P_mechanical_n2=5.0)  # fmt: skip
    (folder / "sinks").mkdir()
    for name, text in sinks.texts().items():
        (folder / "sinks" / name).write_bytes(text)
    laws = tuple(law for law in OF_SECOND if law not in ("neighbour_body", "housing_node"))
    (folder / "plain").mkdir()
    for name, text in source(half_hour, machine).texts().items():
        (folder / "plain" / name).write_bytes(text)
    made = source(half_hour, machine, "second", laws, **OF_LAWS)
    assert made.has_observer
    for name, text in made.texts().items():
        (folder / name).write_bytes(text)
    return folder


def checked(folder, *command):
    """Return what a checker says of a folder."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.skipif(shutil.which("clang") is None, reason="no clang")
@pytest.mark.parametrize("real", ["double", "float"])
def test_clang_warns_of_nothing(every_law, real):
    command = ["clang", *STRICT, f"-DHEATRUN_REAL={real}", "-fsyntax-only", "main.c",
               "thermal_network.c"]  # fmt: skip
    assert checked(every_law, *command) == (0, "")
    assert checked(every_law / "sinks", *command) == (0, "")


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="no cppcheck")
def test_cppcheck_finds_what_is_justified_alone(every_law):
    command = ["cppcheck", "--quiet", "--std=c99"]
    every = ["--enable=warning,style,performance,portability", "main.c", "thermal_network.c"]
    assert checked(every_law, *command, *every) == (0, "")
    misra = [*command, "--addon=misra", "thermal_network.c"]
    status, said = checked(every_law, *misra)
    of_plain, more = checked(every_law / "plain", *misra)
    status, said = status + of_plain, said + more
    found = set(re.findall(r"misra-c2012-(\d+\.\d+)", said))
    page = (Path(__file__).parents[2] / "docs" / "drive.md").read_text()
    rows = re.findall(r"^\| ((?:\d+\.\d+(?:, )?)+) \|", page, flags=re.MULTILINE)
    assert status == 0
    assert found == {rule for row in rows for rule in row.split(", ")}


@needs_compiler
def test_it_is_clean_under_sanitizers(tmp_path, half_hour, machine):
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    (tmp_path / "probe.c").write_text("int main(void) { return 0; }\n")
    probe = subprocess.run([COMPILER, *sanitizers, "probe.c", "-o", "probe"], cwd=tmp_path,
                           capture_output=True, check=False)  # fmt: skip
    if probe.returncode:
        pytest.skip("the compiler has no sanitizers")
    made = source(half_hour, machine, "second", ("speed_cooling",))
    assert replay(tmp_path, made, *sanitizers) < 1e-6
    _, rows = hidden_machine(seed=2, num=300)
    rows[100:150, 3] = np.nan
    rows[200:250, 0] = np.inf
    observed(tmp_path, source(half_hour, machine), 30.0, 30.0, rows, *sanitizers)


@needs_compiler
def test_a_bad_input_holds_the_state_and_says_so(tmp_path, half_hour, machine):
    made = source(half_hour, machine)
    harness = tmp_path / "hold.c"
    harness.write_text("""#include "thermal_network.h"
int main(void)
{
    const volatile heatrun_real zero = (heatrun_real)0.0;
    const heatrun_real start[2] = {(heatrun_real)60.0, (heatrun_real)50.0};
    heatrun_real bad[4];
    heatrun_state state;
    heatrun_inputs inputs = {(heatrun_real)10.0, (heatrun_real)100.0, (heatrun_real)20.0};
    int i, j, num_wrong = 0;
    bad[0] = zero/zero;
    bad[1] = (heatrun_real)1.0/zero;
    bad[2] = -bad[1];
    bad[3] = (heatrun_real)1e9;
    num_wrong += heatrun_start(&state, start) != HEATRUN_OK;
    num_wrong += heatrun_start(&state, bad) != HEATRUN_STATE_INVALID;
    for (i = 0; i < 4; ++i) {
        for (j = 0; j < 3; ++j) {
            heatrun_inputs wrong = inputs;
            *(j == 0 ? &wrong.current_A : j == 1 ? &wrong.losses_W : &wrong.sink_degC) = bad[i];
            num_wrong += heatrun_step(&state, &wrong) != HEATRUN_INPUT_INVALID;
            num_wrong += state.temperature_degC[0] < start[0];
            num_wrong += state.temperature_degC[0] > start[0];
        }
    }
    num_wrong += heatrun_step(&state, &inputs) != HEATRUN_OK;
    num_wrong += !(state.temperature_degC[0] < start[0]);
    return num_wrong;
}
""")
    for words in ((), ("-DHEATRUN_REAL=float",)):
        assert subprocess.run([build(tmp_path, made, *words, harness="hold.c")]).returncode == 0


def observed(folder, made, start, sd, rows, *words):
    """Return temperatures, standard deviations, each (step, node), status, sensor, (step,)."""
    shutil.copy(Path(__file__).with_name("observe.c"), folder)
    return run_observer(build(folder, made, *words, harness="observe.c"), start, sd, rows)


def run_observer(program, start, sd, rows):
    """Return what the program says, as `observed`."""
    done = subprocess.run([program, str(start), str(sd)], input=np.asarray(rows, float).tobytes(),
                          capture_output=True, check=False)  # fmt: skip
    assert done.returncode == 0
    found = np.frombuffer(done.stdout).reshape(len(rows), -1)
    return found[:, 0:-2:2], found[:, 1:-2:2], found[:, -2], found[:, -1]


@pytest.fixture(scope="module")
def observer_vectors(half_hour, machine, tmp_path_factory):
    """A source with errors that stay, a folder with its files, and the courses of its vectors."""
    made = replace(source(half_hour, machine), missed=replace(
        MISSED, sensor_K=0.4, sink_K=0.5, share=0.01, losses=0.02, answer=0.05))  # fmt: skip
    folder = tmp_path_factory.mktemp("observer_vectors")
    courses = made.observer_courses("duty")
    text, notes = with_outputs({**made.texts(), "observer_vectors.csv": courses})
    assert not notes
    (folder / "observer_vectors.csv").write_bytes(text)
    (folder / "vectors.csv").write_bytes(vectors_text(made))
    rows = np.genfromtxt(io.BytesIO(text), delimiter=",", names=True, skip_header=1)
    return made, folder, np.split(rows, np.flatnonzero(rows["time_s"] == 0.0)[1:])


@needs_compiler
def test_the_vectors_of_the_observer_hold_what_a_port_must_show(observer_vectors):
    _, _, (sound, lost, stuck, wrong) = observer_vectors
    assert {len(each) for each in (sound, lost, stuck, wrong)} == {1801}
    told = np.repeat([0, 6, 1, 0], [601, 59, 541, 600])
    for course, expected in ((sound, 0), (lost, told), (wrong, 0)):
        assert np.all(course["sensor"] == expected)
    assert np.all(stuck["sensor"][700:1200] == 2)
    assert stuck["sensor"][-1] == 0
    for node in ("winding", "stator"):
        T, sd = wrong[f"{node}_degC"], wrong[f"{node}_sd_K"]
        assert sound[f"{node}_degC"][0] - T[0] == pytest.approx(30.0)
        assert np.all(np.abs(T - sound[f"{node}_degC"])[900:] < 2.0 * sd[900:])
        assert lost[f"{node}_sd_K"][1200] > 1.1 * sound[f"{node}_sd_K"][1200]
    asked = sound[sound["permitted_A"] >= 0.0]
    assert len(asked) == 30
    assert np.ptp(asked["time_to_limit_s"]) > 100.0


@needs_compiler
def test_vectors_of_a_sound_sensor_are_the_kalman_filter_of_a_textbook(observer_vectors):
    """Exact steps by the exponential of the matrix; errors that stay are not estimated."""
    made, _, (sound, *_) = observer_vectors
    v, constants = VALUES, made._observer()
    C, k = np.array([v["Ceq_w"], v["Ceq_sr"]]), 3 * v["Rs0"] / (234.5 + made.found["Tref"])
    names = ("heat_sd", "slow_sd", "heat_decay", "slow_decay", "reading_sd")
    heat, slow, keeps, keeps_slow, white = (float(constants[name]) for name in names)
    decays, sds = (
        [keeps, keeps, keeps_slow],
        np.array([5, 5, heat, heat, slow, 0.4, 0.5, 0.01, 0.02]),
    )
    P = np.diag(sds**2)
    Q = np.diag([0.0, 0.0, *(sds[2:5] ** 2 * (1.0 - np.square(decays))), *np.zeros(4)])
    H = np.array([1.0, 0, 0, 0, 1, 1, 0, 0, 0])
    x = np.array([sound["winding_degC"][0], sound["stator_degC"][0], 0.0, 0.0, 0.0])
    for step, row in enumerate(sound[1:]):
        copper = k * row["current_A"] ** 2
        A = np.zeros((10, 10))  # T, heat, slow, sensor, sink, share, losses, 1
        A[0, :3] = copper - 1 / v["Req_w"], 1 / v["Req_w"], 1.0
        A[1, :2] = 1 / v["Req_w"] - copper, -1 / v["Req_w"] - 1 / v["Req_sr"]
        A[1, [3, 6, 8]] = 1.0, 1 / v["Req_sr"], row["losses_W"]
        A[:2, 9] = copper * 234.5, (row["losses_W"] - copper * 234.5
                                    + row["sink_degC"] / v["Req_sr"])  # fmt: skip
        A[:2] /= C[:, None]
        T = (expm(A) @ [*x[:4], 0, 0, 0, 0, 0, 1.0])[:2]
        own = copper * (234.5 + T[0])
        A[:2, 7] = (np.array([own, row["losses_W"] - own]) + x[2:4]) / C
        F = expm(A)[:9, :9]
        F[[2, 3, 4], [2, 3, 4]] = decays
        x, P = np.array([*T, *(x[2:] * decays)]), F @ P @ F.T + Q
        if step > 0:  # the first reading is looked at alone
            seen = H @ P
            S = seen @ H + white**2
            x = x + seen[:5] / S * (row["reading_degC"] - x[0] - x[4])
            P[:5], P[5:, :5] = (
                P[:5] - np.outer(seen[:5], seen) / S,
                P[5:, :5] - np.outer(seen[5:], seen[:5]) / S,
            )
        found = [row["winding_degC"], row["winding_sd_K"], row["stator_degC"], row["stator_sd_K"]]
        sd = np.sqrt(np.diag(P))
        np.testing.assert_allclose(found, [x[0], sd[0], x[1], sd[1]], rtol=0.0, atol=2e-6)


@needs_compiler
@pytest.mark.parametrize("words", [(), ("-DHEATRUN_REAL=float",)], ids=["double", "float"])
def test_the_harness_replays_both_and_names_the_line_that_differs_first(observer_vectors, words):
    made, folder, _ = observer_vectors
    command = [build(folder, made, *words), "vectors.csv", "observer_vectors.csv"]
    status, said = checked(folder, *command)
    assert (status, said.count("largest difference")) == (0, 2), said
    lines = (folder / "observer_vectors.csv").read_text().splitlines()
    heading = lines[1].split(",")
    for at, column in ((2345, "stator_sd_K"), (4000, "sensor"), (120 + 3, "permitted_A")):
        wrong = lines.copy()
        for line in (at, at + 60):
            row = wrong[line - 1].split(",")
            row[heading.index(column)] = repr(float(row[heading.index(column)]) + 2.0)
            wrong[line - 1] = ",".join(row)
        (folder / "wrong.csv").write_text("\n".join(wrong) + "\n")
        status, said = checked(folder, *command, "wrong.csv")
        assert status == 1
        assert said.count("expected") == 1
        assert f"wrong.csv, line {at}: {column} is " in said


def test_without_a_compiler_the_vectors_hold_the_courses_and_a_note(
    half_hour, machine, monkeypatch
):
    made = source(half_hour, machine)
    courses = made.observer_courses("duty")
    texts = {**made.texts(), "observer_vectors.csv": courses}
    monkeypatch.setenv("PATH", "")
    text, notes = with_outputs(texts)
    assert text == courses
    assert "no C compiler built it here" in notes[0]
    monkeypatch.undo()
    monkeypatch.setattr("heatrun.export.sources.LONGEST_BUILD_S", 0.0)  # one that never ends
    assert with_outputs(texts) == (courses, notes)


def read_late(made, seconds, seed=0):
    """What drives a source, with readings that follow its winding late, as if it missed a part."""
    plain = {name: value for name, value in made.of_run.items() if not name.startswith("__")}
    time, winding = made.found["t"], simulate_network(mat_bytes(plain)).sensed
    read = winding.copy()
    keep = np.exp(-np.diff(time) / seconds) if seconds else np.zeros(time.size - 1)
    for k, share in enumerate(keep):
        read[k + 1] = share * read[k] + (1.0 - share) * winding[k + 1]
    noise = np.random.default_rng(seed).normal(0.0, MISSED.reading(1.0), time.size)
    names = [name for name in ("t", "Is", "Pd", "Pol", "Te", "start") if name in made.of_run]
    return {name: made.of_run[name] for name in names} | {"Tw_m": read + noise}


@needs_compiler
def test_an_observer_that_takes_a_missing_part_for_a_fault_is_given_more(half_hour, machine):
    made = source(half_hour, machine)
    sound, late = read_late(made, 0.0), read_late(made, 2.0)
    assert without_false_alarms(made, {"sound": sound}) == (made, [])
    told = faults(made, [replace(made, of_run={**made.of_run, **late}).readings()])
    assert told > 0
    widened, (note,) = without_false_alarms(made, {"late": late, "sound": sound})
    assert f"told {told} faults" in note
    assert widened.missed.misfit_K > made.missed.misfit_K
    assert faults(widened, [replace(widened, of_run={**made.of_run, **late}).readings()]) == 0
    stuck = {**sound, "Tw_m": np.full_like(sound["Tw_m"], sound["Tw_m"][900])}
    assert faults(widened, [replace(widened, of_run={**made.of_run, **stuck}).readings()]) > 0


def hidden_machine(seed, num=3600, eA=0.0):
    """A two-node machine with heat that the network misses, by Euler steps of 0.1 s.

    Args:
        seed: Of its noise.
        num: Of seconds.
        eA: Emissivity times surface of the stator [m2].

    Returns:
        Temperatures (step, node), rows of current, losses, sink and reading (step, 4).
    """
    rng = np.random.default_rng(seed)
    v, missed, k = VALUES, np.zeros(2), 3 * VALUES["Rs0"] / (234.5 + 25.0)
    T, noise, course, rows = np.array([60.0, 55.0]), 0.0, [], []
    for second in range(num):
        current, loss = (220.0, 1100.0) if (second // 900) % 2 == 0 else (60.0, 150.0)
        missed = missed * np.exp(-1 / 1200.0) + rng.normal(
            0.0, 0.01 * 625.0 * np.sqrt(1 - np.exp(-2 / 1200.0)), 2)  # fmt: skip
        for _ in range(10):
            copper = k * current**2 * (234.5 + T[0])
            across = (T[0] - T[1]) / v["Req_w"]
            out = (T[1] - 20.0) / v["Req_sr"]
            out += 5.67e-8 * eA * ((T[1] + 273.15) ** 4 - 293.15**4)
            winding = copper - across + missed[0]
            stator = loss - copper + across - out + missed[1]
            T = T + 0.1 * np.array([winding / v["Ceq_w"], stator / v["Ceq_sr"]])
        noise = noise * np.exp(-1 / 60.0) + rng.normal(0.0, 0.2 * np.sqrt(1 - np.exp(-2 / 60.0)))
        course.append(T)
        rows.append([current, loss, 20.0, T[0] + noise + rng.normal(0.0, 0.13)])
    return np.array(course), np.array(rows)


@pytest.fixture(scope="module")
def steady(half_hour):
    """The record whose mean loss scales the heat that is missed: 625 W."""
    channels = {**half_hour.channels, "losses_W": np.full(half_hour.time_s.size, 625.0)}
    return Record(half_hour.name, channels)


@needs_compiler
@pytest.mark.parametrize("eA", [0.0, 0.6], ids=["linear", "radiating"])
@pytest.mark.parametrize("words", [(), ("-DHEATRUN_REAL=float",)], ids=["double", "float"])
def test_an_observer_that_starts_30_K_wrong_is_right_within_its_band(
    tmp_path, steady, machine, words, eA
):
    course, rows = hidden_machine(seed=1, eA=eA)
    effects = ("radiation",) if eA else ()
    made = source(steady, machine, "second", effects, **{"radiation.eA": eA})
    T, sd, status, sensor = observed(tmp_path, made, 30.0, 30.0, rows, *words)
    assert not status.any()
    assert not sensor.any()
    assert course[0, 1] - T[0, 1] > 15.0  # the first reading says little of the stator
    late = slice(900, None)
    assert np.all(sd[late] < 1.5)
    assert np.all(np.abs(T - course)[late] < 3.0 * sd[late])


@needs_compiler
def test_the_band_holds_with_the_sensor_pulled_for_ten_minutes(tmp_path, steady, machine):
    made, within, grown = source(steady, machine), [], []
    for seed in range(10, 22):
        course, rows = hidden_machine(seed, num=2700)
        rows[1800:2400, 3] = np.nan
        T, sd, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
        assert np.all(sensor[1800:1859] == 6)
        assert np.all(sensor[1859:2400] == 1)
        assert not sensor[2400:].any(), "nothing spoke against it"
        within.append((np.abs(T - course) < 1.96 * sd)[1800:2400])
        grown.append(sd[2399, 0] > 1.5 * sd[1799, 0])
    assert np.mean(within) > 0.88  # twelve tests of correlated errors: 95 % in the long run
    assert all(grown)


@needs_compiler
@pytest.mark.parametrize(
    ("fault", "named", "within_s"),
    [("stuck", 2, 120), ("off", 3, 20), ("noisy", 3, 60), ("lagging", 5, 60)],
)
def test_a_sensor_that_lies_is_found_and_counts_again_later(
    tmp_path, steady, machine, fault, named, within_s
):
    course, rows = hidden_machine(seed=3, num=3000)
    late = rows[1800:2400, 3]  # from the change of load on
    if fault == "stuck":
        late[:] = rows[1799, 3]
    elif fault == "off":
        late += 15.0
    elif fault == "noisy":  # ten times the noise of `hidden_machine`
        late += np.random.default_rng(1).normal(0.0, 2.4, late.size)
    else:
        late += through_a_lag(course[1800:2400, 0], 60.0) - course[1800:2400, 0]
    T, sd, _, sensor = observed(tmp_path, source(steady, machine), 57.0, 5.0, rows)
    assert not sensor[:1800].any()
    assert np.any(sensor[1800 : 1800 + within_s] == named)
    if fault in ("stuck", "off", "noisy"):
        assert np.all(sensor[1800 + within_s : 2400] == named)
    assert np.all(sensor[1800 + within_s : 2400] > 0), "a lag is seen while the load changes alone"
    assert np.all(np.abs(T - course)[1800:] < 4.0 * sd[1800:])
    back_s = 2500 if fault in ("off", "noisy") else 2780  # the others need a change of load
    assert np.all(sensor[2400:2410] > 0)
    assert not sensor[back_s:].any()


@needs_compiler
@pytest.mark.parametrize("words", [(), ("-DHEATRUN_REAL=float",)], ids=["double", "float"])
def test_no_input_or_reading_locks_the_observer_up(tmp_path, steady, machine, words):
    course, rows = hidden_machine(seed=7, num=6000)
    made = source(steady, machine)
    rng = np.random.default_rng(1)
    for column, value, seconds in ((0, 2500.0, 600), (0, 600.0, 900), (1, 12700.0, 600),
                                   (2, 500.0, 600), (3, 400.0, 300), (3, -100.0, 1)):  # fmt: skip
        wrong = rows.copy()
        wrong[600 : 600 + seconds, column] = value
        T, sd, status, _ = observed(tmp_path, made, 57.0, 5.0, wrong, *words)
        assert not status[-1800:].any()
        assert np.all(np.isfinite(T) & np.isfinite(sd))
        assert np.mean(np.abs(T - course)[-3600:] < 1.96 * sd[-3600:]) > 0.9
    for _ in range(12):
        wrong = rows.copy()
        for _ in range(40):
            at, long = rng.integers(0, 2500), int(rng.integers(1, 200))
            values = [np.nan, np.inf, -np.inf, 0.0, -100.0, 500.0, 2500.0, 1e9, 300 * rng.normal()]
            wrong[at : at + long, rng.integers(0, 4)] = rng.choice(values)
        T, sd, status, _ = observed(tmp_path, made, 57.0, 5.0, wrong, *words)
        assert not status[-600:].any()
        assert np.all(np.abs(T - course)[-600:] < 3.0 * sd[-600:])


@needs_compiler
def test_where_the_model_may_be_wrong_the_band_has_both_in_it(tmp_path, steady, machine):
    course, rows = hidden_machine(seed=8, num=5400)
    made = source(steady, machine)
    T, sd, _, sensor = observed(tmp_path, made, 30.0, 5.0, rows)
    assert np.all(np.abs(T - course)[:, 0] < 1.96 * sd[:, 0] + 1.0), "the start was wrong"
    assert set(sensor[:60]) == {0, 4, 5}
    assert not sensor[90:].any()
    for column in (0, 1):
        wrong = rows.copy()
        wrong[1000:2600, column] = 0.0
        T, sd, status, sensor = observed(tmp_path, made, 57.0, 5.0, wrong)
        assert not status.any()
        assert not np.isin(sensor, (2, 3)).any(), "the sensor is right"
        assert np.any(sensor == 5)
        told = np.flatnonzero(sensor)[0]
        assert np.abs(T - course)[told:2600, 0].max() > 10.0
        assert np.mean(np.abs(T - course)[told:2600, 0] < 1.96 * sd[told:2600, 0]) > 0.9


@needs_compiler
def test_one_bad_reading_at_the_start_is_not_believed(tmp_path, steady, machine):
    course, rows = hidden_machine(seed=9, num=1800)
    for num in (1, 5, 12):
        wrong = rows.copy()
        wrong[:num, 3] = 150.0
        T, sd, *_ = observed(tmp_path, source(steady, machine), 57.0, 30.0, wrong)
        assert np.all(np.abs(T - course)[100:, 0] < 3.0 * sd[100:, 0])
        assert np.all(sd[600:, 0] < 1.0)


@needs_compiler
@pytest.mark.parametrize("every_s", [2, 10, 30])
def test_readings_that_come_seldom_are_used(tmp_path, steady, machine, every_s):
    course, rows = hidden_machine(seed=11, num=3600)
    rows[np.arange(3600) % every_s != 0, 3] = np.nan
    T, sd, _, sensor = observed(tmp_path, source(steady, machine), 30.0, 30.0, rows)
    assert set(sensor[2:]) == {0, 6}
    assert np.all(np.abs(T - course)[900:] < 3.5 * sd[900:])
    assert np.all(sd[900:, 0] < 0.8)


@needs_compiler
def test_an_offset_that_was_told_is_not_believed_later(tmp_path, steady, machine):
    made = replace(source(steady, machine), missed=replace(MISSED, sensor_K=0.5, sink_K=0.5))
    course, rows = hidden_machine(seed=22, num=5400)
    rows[1400:4400, 3] += 3.0
    T, sd, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
    assert np.all(np.isin(sensor[1412:4400], (3, 4)))
    assert np.mean(np.abs(T - course)[:, 0] < 1.96 * sd[:, 0]) > 0.95
    assert not sensor[4900:].any(), "it has jumped back"


@needs_compiler
def test_a_drift_is_told_by_the_mean_of_what_remains(tmp_path, steady, machine):
    _, rows = hidden_machine(seed=13, num=7200)
    made = replace(source(steady, machine), missed=replace(MISSED, sensor_K=0.5, sink_K=0.5))
    rows[1400:, 3] += 10.0 / 3600.0 * np.arange(5800)
    _, _, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
    assert not sensor[:1400].any()
    assert np.flatnonzero(sensor)[0] < 1400 + 3600
    assert 5 in sensor


def by_resistance(T):
    """Return what an ohmmeter shows of winding and leads [ohm], by the rule of IEC 60034-1."""
    return VALUES["Rs0"] * (234.5 + T) / (234.5 + 25.0) + LEAD_OHM


@needs_compiler
@pytest.mark.parametrize("words", [(), ("-DHEATRUN_REAL=float",)], ids=["double", "float"])
def test_the_winding_by_its_resistance(tmp_path, half_hour, machine, words):
    real = ctypes.c_float if words else ctypes.c_double
    shared = build(tmp_path, source(half_hour, machine), *words, "-shared", "-fPIC")
    library = ctypes.CDLL(str(shared))
    library.heatrun_winding_degC.restype = real
    of_run = (4 * real).in_dll(library, "heatrun_cold_winding")
    given = [by_resistance(25.0), by_resistance(100.0), by_resistance(-40.0), np.nan, np.inf,
             -0.006, 0.0, LEAD_OHM, 0.02, 1e37]  # fmt: skip
    found = [library.heatrun_winding_degC(of_run, real(ohm)) for ohm in given]
    np.testing.assert_allclose(found[:3], [25.0, 100.0, -40.0], atol=2e-4 if words else 1e-9)
    found.append(library.heatrun_winding_degC((4 * real)(), real(0.006)))
    assert set(found[3:]) == {-1000.0}, "no reading"


@needs_compiler
def test_the_band_of_an_observer_by_resistance_holds(tmp_path, steady, machine):
    """A resistance that is 0.2 % wrong for good, at noise of 0.1 %, each ten seconds."""
    made, rng = source(steady, machine), np.random.default_rng(3)
    header = made.texts()["thermal_network.h"].decode()
    K_per_ohm = float(re.search(r"one of (\S+) K/ohm", header)[1])
    assert K_per_ohm == pytest.approx((234.5 + 25.0) / VALUES["Rs0"])
    ohm = by_resistance(410.0)  # as warm as this machine becomes
    words = ["-DBY_RESISTANCE", "-DHEATRUN_SLOW_SD_K=0.0",
             f"-DHEATRUN_READING_SD_K={0.001 * ohm * K_per_ohm:.3f}",
             f"-DHEATRUN_SENSOR_SD_K={0.002 * ohm * K_per_ohm:.3f}"]  # fmt: skip
    held, bare = [], []
    for seed, error in enumerate(norm.ppf((np.arange(8) + 0.5) / 8)):
        course, rows = hidden_machine(seed + 30, num=2700)
        ohm = by_resistance(course[:, 0]) * (1.0 + 0.002 * error)
        rows[:, 3] = ohm * (1.0 + 0.001 * rng.normal(size=len(rows)))
        rows[np.arange(len(rows)) % 10 != 0, 3] = np.nan
        rows[1500, 3] = -1.0  # the meter is off for a moment
        for names, within in ((words, held), (words[:1], bare)):
            T, sd, status, sensor = observed(tmp_path, made, 57.0, 5.0, rows, *names)
            within.append(np.abs(T - course)[600:, 0] < 1.96 * sd[600:, 0])
            if names is words:
                assert not status.any()
                assert set(sensor) <= {0, 6}
                assert sd[600:, 0].max() < 2.0
    assert np.mean(held) > 0.93
    assert np.mean(bare) < np.mean(held) - 0.2


@needs_compiler
def test_readings_by_resistance_are_refused_by_name(tmp_path, half_hour, machine):
    unknown = replace(source(half_hour, machine), cold=(0.0, 0.0))
    assert "the run has no resistance" in unknown.not_by_resistance[0]
    build(tmp_path, unknown)
    assert "heatrun_winding_degC is left out" in (tmp_path / "thermal_network.h").read_text()
    assert not source(half_hour, machine).not_by_resistance
    lagging = source(half_hour, machine, "second", ("sensor_lag",))
    assert "expects another reading (sensor_lag)" in lagging.not_by_resistance[0]


def through_a_lag(course, lag_s):
    """Return what a sensor shows that follows a course, each second, by steps of 10 ms."""
    fine = np.interp(np.arange(100 * (course.size - 1) + 1) / 100.0, range(course.size), course)
    shown = [fine[0]]
    for T in fine[:-1]:
        shown.append(shown[-1] + (T - shown[-1]) * 0.01 / lag_s)
    return np.array(shown[::100])


@needs_compiler
def test_a_lag_that_the_run_knows_is_no_fault(tmp_path, steady, machine):
    course, rows = hidden_machine(seed=5)
    rows[:, 3] += through_a_lag(course[:, 0], 25.0) - course[:, 0]
    known = source(steady, machine, "second", ("sensor_lag",), **{"sensor_lag.tau": 25.0})
    T, sd, _, sensor = observed(tmp_path, known, 57.0, 5.0, rows)
    assert not sensor.any()
    assert np.all(np.abs(T - course)[900:] < 3.0 * sd[900:])
    _, _, _, sensor = observed(tmp_path, source(steady, machine), 57.0, 5.0, rows)
    assert sensor.any(), "one that is not known is"


@needs_compiler
@pytest.mark.parametrize("lag_s", [0.0, 15.0], ids=["at once", "lagging"])
def test_a_sensor_between_slots_and_overhang_is_read_as_such(tmp_path, steady, machine, lag_s):
    """By Euler steps of 0.1 s: 40 % of the winding is overhang, 30 s behind, half of it read."""
    f, tau, p, v, k = 0.4, 30.0, 0.5, VALUES, 3 * VALUES["Rs0"] / (234.5 + 25.0)
    rng, T, course, rows = np.random.default_rng(8), np.array([60.0, 55.0, 60.0]), [], []
    for second in range(2700):
        current, loss = (220.0, 1100.0) if (second // 600) % 2 == 0 else (60.0, 150.0)
        for _ in range(10):
            copper = k * current**2 * (234.5 + T[0])
            across, hers = (T[0] - T[1]) / v["Req_w"], f * v["Ceq_w"] * (T[2] - T[0]) / tau
            heat = [
                (1.0 - f) * copper - across + hers,
                loss - copper + across - (T[1] - 20.0) / v["Req_sr"],
                f * copper - hers,
            ]
            T = T + 0.1 * np.array(heat) / [(1.0 - f) * v["Ceq_w"], v["Ceq_sr"], f * v["Ceq_w"]]
        course.append(T)
        rows.append([current, loss, 20.0, T[0] + p * (T[2] - T[0])])
    course, rows = np.array(course), np.array(rows)
    assert np.max(np.abs(course[:, 2] - course[:, 0])) > 5.0
    if lag_s:
        rows[:, 3] = through_a_lag(rows[:, 3], lag_s)
    rows[:, 3] += rng.normal(0.0, 0.13, len(rows))
    laws = ("end_winding_node", *(["sensor_lag"] if lag_s else []))
    values = {"end_winding_node.f": f, "end_winding_node.tau": tau, "end_winding_node.p": p,
              "sensor_lag.tau": lag_s}  # fmt: skip
    own = {name: value for name, value in values.items() if name.startswith(laws)}
    made = source(steady, machine, "second", laws, **own)
    T, sd, _, sensor = observed(tmp_path, made, 58.0, 5.0, rows)
    assert not sensor.any()
    assert np.all(np.abs(T - course)[900:] < 3.0 * sd[900:])
    at_its_node = source(steady, machine)
    T, sd, _, _ = observed(tmp_path, at_its_node, 58.0, 5.0, rows)
    assert np.any(np.abs(T - course[:, :2])[900:] > 3.0 * sd[900:]), "without it, it is not"


@needs_compiler
def test_errors_that_stay_widen_the_band_and_are_not_averaged_away(tmp_path, steady, machine):
    course, rows = hidden_machine(seed=6, num=7200)
    rows[:, 3] += 0.8
    made = replace(source(steady, machine), missed=replace(MISSED, sensor_K=0.5, sink_K=0.5))
    T, sd, _, sensor = observed(tmp_path, made, 57.0, 5.0, rows)
    assert not sensor.any()
    assert np.all(np.abs(T - course)[900:] < 3.0 * sd[900:])
    assert np.all(sd[-600:, 0] > 0.45)  # two hours of readings, and as wide as the sensor


@needs_compiler
def test_without_inputs_the_band_grows(tmp_path, steady, machine):
    _, rows = hidden_machine(seed=4, num=900)
    rows[600:, 0] = np.nan
    rows[600:, 3] = np.nan
    T, sd, status, _ = observed(tmp_path, source(steady, machine), 57.0, 5.0, rows)
    assert np.all(status[600:] == 1)
    assert np.ptp(T[600:, 0]) == 0.0
    assert np.all(np.diff(sd[600:, 0]) > 0.1)


@needs_compiler
def test_a_compiler_that_drops_nan_is_refused(tmp_path, half_hour, machine):
    for name, text in source(half_hour, machine).texts().items():
        (tmp_path / name).write_bytes(text)
    command = [str(COMPILER), "-ffast-math", "-fsyntax-only", "thermal_network.c"]
    status, said = checked(tmp_path, *command)
    assert status != 0
    assert "-ffast-math drops the tests for NaN" in said


ASK = """#include <stdio.h>
#include "thermal_network.h"
int main(void)
{
    const heatrun_real start[HEATRUN_NUM_NODES] = {(heatrun_real)80.0, (heatrun_real)60.0};
    heatrun_inputs inputs = {(heatrun_real)150.0, (heatrun_real)700.0, (heatrun_real)20.0};
    const heatrun_real zero = inputs.sink_degC - inputs.sink_degC;
    heatrun_state state;
    if (heatrun_start(&state, start) != HEATRUN_OK) {
        return 1;
    }
    printf("%.9g ", (double)heatrun_time_to_limit_s(&state, &inputs, 0, (heatrun_real)120.0,
                                                    (heatrun_real)3600.0));
    printf("%.9g ", (double)heatrun_time_to_limit_s(&state, &inputs, 0, (heatrun_real)400.0,
                                                    (heatrun_real)600.0));
    printf("%.9g ", (double)heatrun_permitted_current_A(&state, &inputs, 0, (heatrun_real)120.0,
                                                        (heatrun_real)300.0));
    printf("%.9g ", (double)heatrun_permitted_current_A(&state, &inputs, 0, (heatrun_real)50.0,
                                                        (heatrun_real)300.0));
    printf("%.9g ", (double)heatrun_time_to_limit_s(&state, &inputs, 7, (heatrun_real)120.0,
                                                    (heatrun_real)300.0));
    printf("%.9g ", (double)heatrun_permitted_current_A(&state, &inputs, 0, (heatrun_real)120.0,
                                                        zero));
    printf("%.9g ", (double)heatrun_permitted_current_A(&state, &inputs, 1, (heatrun_real)500.0,
                                                        (heatrun_real)1.0)
                        - HEATRUN_MAX_CURRENT_A);
    inputs.current_A = zero/zero;
    printf("%.9g", (double)heatrun_permitted_current_A(&state, &inputs, 0, (heatrun_real)120.0,
                                                         (heatrun_real)300.0));
    return 0;
}
"""


@needs_compiler
def test_time_to_the_limit_and_permitted_current(tmp_path, half_hour, machine):
    (tmp_path / "ask.c").write_text(ASK)
    program = build(tmp_path, source(half_hour, machine), harness="ask.c")
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    reached, stays, permitted, *nothing = map(float, said.split())
    k = 3 * VALUES["Rs0"] / (234.5 + 25.0)

    def held(current, seconds, other=None):
        """Euler steps of 10 ms; the losses are 700 W with copper, or `other` W without."""
        T, Tsr, course = 80.0, 60.0, []
        for _ in range(100 * seconds):
            copper = k * current**2 * (234.5 + T)
            rest = 700.0 - copper if other is None else other
            across = (T - Tsr) / VALUES["Req_w"]
            out = (Tsr - 20.0) / VALUES["Req_sr"]
            T += 0.01 * (copper - across) / VALUES["Ceq_w"]
            Tsr += 0.01 * (rest + across - out) / VALUES["Ceq_sr"]
            course.append(T)
        return np.array(course)

    above = np.flatnonzero(held(150.0, int(reached) + 5) > 120.0)
    assert reached == pytest.approx(0.01 * above[0], abs=1.1)
    assert stays == 600.0
    other = 700.0 - k * 150.0**2 * (234.5 + 80.0)
    assert held(permitted, 300, other).max() == pytest.approx(120.0, abs=0.05)
    assert nothing == [0.0, -1.0, -1.0, 0.0, -1.0]


@needs_compiler
def test_one_body_asks_for_the_resistance_too(tmp_path, half_hour, machine):
    ask = ASK.replace(", (heatrun_real)60.0}", "}").replace("&inputs, 1,", "&inputs, 0,")
    (tmp_path / "ask.c").write_text(ask)
    made = source(half_hour, machine, "first")
    program = build(tmp_path, made, harness="ask.c")
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert 100.0 < float(said.split()[2]) < 0.9 * float(made.largest()["max_current"])
    unknown = replace(made, of_run=made.of_run | {"Rs0": 0.0})
    program = build(tmp_path, unknown, harness="ask.c")
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert float(said.split()[2]) == -1.0, "not known"


HOSTILE = '*/ int main(void){} /* \\\n#error ??/ "%s$step" é\x00'


@needs_compiler
def test_hostile_names_stay_inside_their_comment(tmp_path, half_hour, machine):
    made = source(half_hour, machine, said=dict.fromkeys(SAID, HOSTILE))
    found = {**made.of_run, "nodes": ["wick*/lung", "wick /lung"],
             "links": [["wick /lung", "$x"], ["wick*/lung", "wick /lung"]], "sink": "$x",
             "copper_node": "wick*/lung", "sensor": {"node": "wick*/lung"}}  # fmt: skip
    hostile = replace(made, of_run=found)
    text = hostile.texts()["thermal_network.h"].decode()
    assert "#error ??" not in text
    assert "HEATRUN_NODE_WICK__LUNG_1 = 1" in text
    build(tmp_path, hostile)
    assert hostile.texts()["thermal_network.c"] == made.texts()["thermal_network.c"]
    assert in_comment(HOSTILE).isascii()


def test_other_effects_are_refused_by_name(half_hour, machine):
    with pytest.raises(InputError, match=r"not hold the law of cooling_step: events") as error:
        source(half_hour, machine, "second", ("speed_cooling", "cooling_step"))
    assert "--replica" in error.value.remedy
    with pytest.raises(InputError, match="winding and body keep one temperature"):
        source(half_hour, machine, "first", ("winding_node",), **{"winding_node.x": 1e-4})


def test_a_step_that_no_drive_can_afford_is_refused(half_hour, machine):
    with pytest.raises(InputError, match="a step of 10000 s is too long"):
        source(half_hour, machine, step=1e4)
    with pytest.raises(InputError, match="above 0 s, got nan s"):
        source(half_hour, machine, step=np.nan)


def test_an_observer_that_is_too_large_is_left_out(half_hour, machine):
    made = source(half_hour, machine)
    of_run = made.of_run | {
        name: np.append(made.of_run[name], np.full(8, value))
        for name, value in (
            ("capacitance", 1e3),
            ("resistance", 1.0),
            ("share", 0.0),
            ("start", 20.0),
        )
    }
    of_run["nodes"] = [*made.nodes, *"abcdefgh"]
    of_run["links"] = [*links_of(made.found), *(("winding", node) for node in "abcdefgh")]
    large = replace(made, of_run=of_run)
    assert not large.has_observer


@needs_compiler
@pytest.mark.parametrize("effects", [(), ("sensor_lag",)], ids=["at once", "lagging"])
def test_the_size_of_an_observer_is_known_before_it_is_compiled(
    tmp_path, half_hour, machine, effects
):
    (tmp_path / "size.c").write_text("""#include <stdio.h>
#include "thermal_network.h"
int main(void) { printf("%lu", (unsigned long)sizeof(heatrun_observer)); return 0; }
""")
    made = source(half_hour, machine, "second", effects)
    program = build(tmp_path, made, harness="size.c")
    said = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    assert int(said) == made.state_bytes < 1024


@needs_compiler
def test_the_command_writes_what_compiles_and_replays(day, capsys):
    assert cli.main(["export", "run", "--to", "c", "--out", "drive", "--step", "0.5"]) == 0
    printed = capsys.readouterr().out
    assert "C99 of second order, with an observer: nodes winding, stator; steps of 0.5 s" in printed
    command = [str(COMPILER), *STRICT, "main.c", "thermal_network.c", "-o", "replay"]
    subprocess.run(command, cwd="drive", check=True)
    subprocess.run(["drive/replay", "drive/vectors.csv", "drive/observer_vectors.csv"], check=True)
    header = Path("drive/thermal_network.h").read_text()
    assert f"SHA-256:  {hashlib.sha256(Path('run/fit.json').read_bytes()).hexdigest()}" in header
    text = Path("drive/thermal_network.c").read_text()
    ohm = load_motor("motor.toml").phase_resistance_ohm
    assert f"heatrun_cold_winding = {{R({ohm!r}), R(25.0), R(234.5), R(0.0)}}" in text
    interval = re.search(r"capacitance_J_per_K\[0\] +(\S+) to (\S+)  Ceq_w", text)
    low, high = map(float, interval.groups())
    stated = float(re.search(r"heatrun_identified = \{\n    \{R\((\S+)\)", text)[1])
    assert low < stated < high
    again = export_source(Path("run"), folder=Path("drive"), step=0.5)
    assert Path(again["files"][0]).read_text() == header
    with pytest.raises(InputError, match="holds another export"):
        export_source(Path("run"), folder=Path("drive"))
    Path("drive/main.c").write_text("int main(void) { return 0; }")
    with pytest.raises(InputError, match="not as heatrun writes it"):
        export_source(Path("run"), folder=Path("drive"), step=0.5, is_replacing=True)


@needs_compiler
def test_the_band_of_a_run_holds_on_other_loads(day, generator):
    """The simulated bench is code of its own; the sensor is pulled for ten minutes, twice."""
    export_source(Path("run"), folder=Path("drive"))
    shutil.copy(Path(__file__).with_name("observe.c"), "drive")
    command = [str(COMPILER), *STRICT, "observe.c", "thermal_network.c", "-o", "observe"]
    subprocess.run(command, cwd="drive", check=True)
    for seed, profile in enumerate([generator.staircase(3600.0), generator.drive_cycle(3600.0)]):
        truth = generator.simulate(
            generator.reference_motor(), profile, sample_s=1.0, steps_per_sample=20
        )
        said = generator.measure(truth, np.random.default_rng(seed), generator.Instruments())
        before, after = slice(None, -1), slice(1, None)
        held = [said["Is"] ** 2, said["Pd"], said["Te"]]
        held = [0.5 * (np.asarray(each)[before] + np.asarray(each)[after]) for each in held]
        rows = np.column_stack([np.sqrt(held[0]), *held[1:], np.asarray(said["Tw_m"])[after]])
        is_pulled = np.zeros(len(rows), bool)
        is_pulled[1200:1800] = is_pulled[2700:3300] = True
        rows[is_pulled, 3] = np.nan
        T, sd, status, sensor = run_observer(Path("drive/observe"), 19.0, 2.0, rows)
        course = np.column_stack([truth.winding_degC, truth.stator_degC])[after]
        assert not status.any()
        assert set(sensor) == {0, 1, 6}  # no fault but the missing readings
        assert np.mean(np.abs(T - course)[is_pulled] < 1.96 * sd[is_pulled]) > 0.93
        assert np.all(
            sd[is_pulled] < 1.5
        )  # half of it the drive's own losses, of the bench's class


def test_records_are_found_from_the_folder_of_the_run(day, tmp_path, monkeypatch):
    here = Path.cwd()
    monkeypatch.chdir(tmp_path)
    export_source(here / "run", folder=Path("drive"))
    assert Path("drive/vectors.csv").is_file()


def test_the_losses_are_meant_as_the_run_corrects_them(day):
    export_source(Path("run"), folder=Path("drive"))
    found = read_run_test(Path("run"))
    corrections = Corrections.of(found.values)
    assert corrections.power_gain
    assert corrections.words() in Path("drive/thermal_network.h").read_text()
    rows = np.genfromtxt("drive/vectors.csv", delimiter=",", skip_header=1, names=True)[1:]
    time, given = found.record.time_s - found.record.time_s[0], found.record.channels
    losses = (1.0 + corrections.power_gain) * given["losses_W"]
    losses = losses - corrections.torque_offset * given.get("speed_rpm", 0.0) * np.pi / 30.0
    later = np.interp(time - corrections.load_timing, time, losses)
    losses = np.interp(rows["time_s"] - 0.5, time, later)
    assert not corrections.needs_shaft_power
    np.testing.assert_allclose(rows["losses_W"], losses, rtol=1e-9)


def test_errors_of_the_losses_are_told_in_two_parts_and_none_is_lost(day):
    found = read_run_test(Path("run"))
    losses = np.linspace(50.0, 400.0, 90)
    power = 3000.0 * np.sqrt(losses / 400.0)
    test = replace(found.blocks, means={"losses": losses, "shaft_power": power})
    along, rest = of_losses({"shaft_power_gain": 0.005}, test)
    assert along > 0.03
    assert rest > 0.005
    square = along**2 * np.mean(losses**2) + rest**2 * np.mean(losses) ** 2
    assert np.isclose(square, 0.005**2 * np.mean(power**2))
    assert of_losses({"power_gain": 0.01}, test) == pytest.approx((0.01, 0.0), abs=1e-9)


def test_what_changed_in_one_test_is_not_the_drives(day):
    found = read_run_test(Path("run"))
    assert of_no_test(found) is found
    changed = replace(found, values={**found.values, "Req_w_change": -0.1, "Ceq_w_change": 0.1})
    other = of_no_test(changed)
    assert other.values == found.values
    assert other.predicted.reading.shape == found.predicted.reading.shape


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "duty.csv", "--to", "c"], "--to c exports a run"),
        ([__file__, "--to", "c"], "--to c takes a run folder"),
        (["run", "--to", "c", "--corrected"], "a drive has its own instruments"),
        (["run", "--to", "mat", "--step", "1"], "--step is for --to c, fmu and modelica"),
    ],
)
def test_words_of_the_other_kind_are_refused(words, said, capsys):
    assert cli.main(["export", *words]) == 2
    assert said in capsys.readouterr().err
