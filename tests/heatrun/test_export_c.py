"""The C of an export: compiled without a warning, as lptn, and what it refuses."""

import hashlib
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from c_programs import (
    COMPILER,
    MACHINE,
    SAID,
    STRICT,
    VALUES,
    build,
    checked,
    half_hour,
    hidden_machine,
    in_both_precisions,
    needs_compiler,
    observed,
    source,
    written,
)
from simulators import fmu_error, has_modelica, modelica_error, vectors_of, vectors_text

from heatrun import cli
from heatrun.errors import InputError
from heatrun.export import export_source
from heatrun.export.fmu import fmu_files
from heatrun.export.laws import LAWS, entries, in_comment
from heatrun.export.missed import of_losses
from heatrun.export.rerun import of_no_test, read_run_test
from heatrun.export.variables import Corrections
from heatrun.export.vectors import observer_courses
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.model.network_text import read_network as network_of_text
from heatrun.motor.file import load_motor
from heatrun.record.record import Record

TWO_SINKS = network_of_text(
    b"""
[network]
name = "sinks"
nodes = ["winding", "yoke"]
sinks = ["ambient", "coolant"]
links = [["winding", "yoke"], ["yoke", "ambient"], ["yoke", "coolant"]]
losses = { copper = "winding", iron = "yoke", mechanical = "yoke" }
by_speed = ["mechanical"]
sensors = { winding_degC = "winding" }
""",
    "sinks.toml",
)
FRICTION = {"P_mechanical_n": 30.0, "P_mechanical_n2": 5.0}


@cache
def two_hours():
    """The half hour four times on end."""
    record = half_hour()
    time = record.time_s
    channels = {name: np.tile(values[:-1], 4) for name, values in record.channels.items()}
    channels["time_s"] = np.concatenate([time[:-1] + k * (time[-1] - time[0]) for k in range(4)])
    return Record(record.name, channels)


def replay(folder, made, *words):
    """Return the largest difference to lptn that the harness prints [K]."""
    program = build(folder, made, *words)
    (folder / "vectors.csv").write_bytes(vectors_text(made))
    status, said = checked(folder, program, "vectors.csv")
    assert status == 0, said
    steps, difference = re.fullmatch(r"\S+: (\d+) steps .* difference (\S+) K .*\n", said).groups()
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
OF_A_MAP = ("ac_copper_loss", "stray_load_loss", "iron_loss_in_winding")


alone = partial(pytest.param, marks=pytest.mark.slow)
"""One law by itself; together they are in each run of the tests."""


@needs_compiler
@pytest.mark.parametrize(
    ("network", "effects", "values"),
    [
        ("first", ("winding_node", "radiation"), {}),
        ("four", (), {}),
        ("second", OF_SECOND, OF_LAWS),
        ("second", OF_A_MAP, OF_LAWS | {"losses": "map"}),
        (TWO_SINKS, (), FRICTION),
        alone("second", (), {}),
        alone("first", (), {}),
        *(alone("second", (law,), OF_LAWS) for law in OF_SECOND),
        alone("second", ("ac_copper_loss", "iron_loss_in_winding"), OF_LAWS),
    ],
    ids=lambda value: "+".join(value) if isinstance(value, tuple) else None,
)  # fmt: skip
def test_c_fmu_and_modelica_have_the_temperatures_of_lptn(tmp_path, network, effects, values):
    made = source(network, effects, record=two_hours(), **values)
    assert replay(tmp_path, made) < 1e-6
    assert replay(tmp_path, made, "-DHEATRUN_REAL=float") < 0.05
    machine = replace(MACHINE, losses=values.get("losses", "balance"))
    parameters = entries(made, Model.of(network, machine, effects_named(effects, "test")))
    assert fmu_error(tmp_path, made, parameters) < 1e-6
    if has_modelica:
        assert modelica_error(source(network, effects, **values), parameters) < 1e-6


@pytest.fixture(scope="module")
def every_law(tmp_path_factory):
    """A folder with the source that holds all laws with an observer, and one with two sinks."""
    folder = tmp_path_factory.mktemp("every_law")
    effects = ("end_winding_node", "sensor_lag")
    written(folder / "sinks", source(TWO_SINKS, effects, **OF_LAWS, **FRICTION))
    written(folder / "plain", source())
    laws = tuple(law for law in OF_SECOND if law not in ("neighbour_body", "housing_node"))
    made = source("second", laws, **OF_LAWS)
    assert made.has_observer
    return written(folder, made)


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
def test_it_is_clean_under_sanitizers(tmp_path):
    sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    (tmp_path / "probe.c").write_text("int main(void) { return 0; }\n")
    if checked(tmp_path, COMPILER, *sanitizers, "probe.c", "-o", "probe")[0]:
        pytest.skip("the compiler has no sanitizers")
    made = source("second", ("speed_cooling",))
    assert replay(tmp_path, made, *sanitizers) < 1e-6
    _, rows = hidden_machine(seed=2, num=300)
    rows[100:150, 3] = np.nan
    rows[200:250, 0] = np.inf
    observed(tmp_path, source(), 30.0, 30.0, rows, *sanitizers)


@needs_compiler
@in_both_precisions
def test_a_bad_input_holds_the_state_and_says_so(tmp_path, words):
    (tmp_path / "hold.c").write_text("""#include "thermal_network.h"
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
    program = build(tmp_path, source(), *words, harness="hold.c")
    assert checked(tmp_path, program) == (0, "")


@needs_compiler
def test_a_compiler_that_drops_nan_is_refused(tmp_path):
    command = [str(COMPILER), "-ffast-math", "-fsyntax-only", "thermal_network.c"]
    status, said = checked(written(tmp_path, source()), *command)
    assert status != 0
    assert "-ffast-math drops the tests for NaN" in said


ASK = """#include <stdio.h>
#include "thermal_network.h"
#define R(x) ((heatrun_real)(x))
#define SAY(x) printf("%.9g ", (double)(x))
int main(void)
{
    const heatrun_real start[HEATRUN_NUM_NODES] = {R(80.0), R(60.0)};
    heatrun_inputs inputs = {R(150.0), R(700.0), R(20.0)};
    const heatrun_real zero = inputs.sink_degC - inputs.sink_degC;
    heatrun_state state;
    if (heatrun_start(&state, start) != HEATRUN_OK) {
        return 1;
    }
    SAY(heatrun_time_to_limit_s(&state, &inputs, 0, R(120.0), R(3600.0)));
    SAY(heatrun_time_to_limit_s(&state, &inputs, 0, R(400.0), R(600.0)));
    SAY(heatrun_permitted_current_A(&state, &inputs, 0, R(120.0), R(300.0)));
    SAY(heatrun_permitted_current_A(&state, &inputs, 0, R(50.0), R(300.0)));
    SAY(heatrun_time_to_limit_s(&state, &inputs, 7, R(120.0), R(300.0)));
    SAY(heatrun_permitted_current_A(&state, &inputs, 0, R(120.0), zero));
    SAY(heatrun_permitted_current_A(&state, &inputs, 1, R(500.0), R(1.0)) - HEATRUN_MAX_CURRENT_A);
    inputs.current_A = zero/zero;
    SAY(heatrun_permitted_current_A(&state, &inputs, 0, R(120.0), R(300.0)));
    return 0;
}
"""


def answers(folder, made, ask=ASK):
    (folder / "ask.c").write_text(ask)
    status, said = checked(folder, build(folder, made, harness="ask.c"))
    assert status == 0
    return [float(each) for each in said.split()]


@needs_compiler
def test_time_to_the_limit_and_permitted_current(tmp_path):
    reached, stays, permitted, *nothing = answers(tmp_path, source())
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
def test_one_body_asks_for_the_resistance_too(tmp_path):
    ask = ASK.replace(", R(60.0)}", "}").replace("&inputs, 1,", "&inputs, 0,")
    made = source("first")
    assert 100.0 < answers(tmp_path, made, ask)[2] < 0.9 * float(made.largest()["max_current"])
    unknown = replace(made, of_run=made.of_run | {"Rs0": 0.0})
    assert answers(tmp_path, unknown, ask)[2] == -1.0, "not known"


def test_nodes_that_differ_by_case_have_their_own_names_in_the_vectors_as_in_the_fmu():
    network = network_of_text(
        b"""
[network]
name = "case"
nodes = ["winding", "Yoke", "yoke"]
links = [["winding", "Yoke"], ["Yoke", "yoke"], ["yoke", "ambient"]]
losses = { copper = "winding", other = "Yoke" }
sensors = { winding_degC = "winding" }
""",
        "case.toml",
    )
    made = source(network)
    names = ("winding_degC", "Yoke_degC", "yoke_degC")
    assert vectors_of(made).dtype.names[-3:] == names
    assert b",Yoke_degC,Yoke_sd_K,yoke_degC," in observer_courses(made, "duty")
    description = fmu_files(made, [])["modelDescription.xml"].decode()
    assert all(f'name="{name}"' in description for name in names)


HOSTILE = '*/ int main(void){} /* \\\n#error ??/ "%s$step" é\x00'


@needs_compiler
def test_hostile_names_stay_inside_their_comment(tmp_path):
    made = source(said=dict.fromkeys(SAID, HOSTILE))
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


def test_other_effects_are_refused_by_name():
    with pytest.raises(InputError, match=r"not hold the law of cooling_step: events") as error:
        source("second", ("speed_cooling", "cooling_step"))
    assert "--replica" in error.value.remedy
    with pytest.raises(InputError, match="winding and body keep one temperature"):
        source("first", ("winding_node",), **{"winding_node.x": 1e-4})


def test_a_step_that_no_drive_can_afford_is_refused():
    with pytest.raises(InputError, match="a step of 10000 s is too long"):
        source(step=1e4)
    with pytest.raises(InputError, match="above 0 s, got nan s"):
        source(step=np.nan)


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


def test_the_losses_are_meant_as_the_run_corrects_them(finished_day, tmp_path, monkeypatch):
    """Its records are found from the folder of the run."""
    monkeypatch.chdir(tmp_path)
    export_source(finished_day / "run", folder=Path("drive"))
    found = read_run_test(finished_day / "run")
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
