"""One and two bodies for drives and for MuJoCo: against closed forms, and no name gets through."""

import hashlib
import json
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import tomli_w

from heatrun import cli
from heatrun.export import export_drive
from heatrun.export.simpler import COLD, EXACT, figures
from heatrun.export.simpler import TestedRun as Read
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.results.model import DerivedFigure
from heatrun.runs.replica import Followed, nearest, replica
from heatrun.runs.run import open_run

VALUES = {**EXACT, "Rs0": 0.0062, "Tw_start": 20.0, "Tsr_start": 20.0}
HOSTILE = 'a"><x/>--&amp;\'|`*[b](c)\n# "\\é'


@pytest.fixture(scope="module")
def of_truth(blocks, motor, truth):
    """A test that the second-order network follows with the true parameters."""
    nothing = Followed(blocks, np.zeros(blocks.num_blocks), VALUES)
    return replace(nothing, course=nothing.error_K(Model.of("second", motor), truth))


def test_the_same_network_finds_its_parameters_again(of_truth, motor, truth):
    model = Model.of("second", motor)
    found = nearest(model, {n: 2.0 * v for n, v in truth.items()}, [of_truth])
    assert found.rms_K < 1e-3
    assert found.parameters == pytest.approx(truth, rel=1e-3)
    # another course: to the first order where the search would come
    other = {**truth, "Req_sr": 1.02 * truth["Req_sr"]}
    moved = found.moved(of_truth.error_K(model, other)[None])
    assert {n: float(v[0]) for n, v in moved.items()} == pytest.approx(other, rel=2e-3)


def test_what_a_sensor_adds_does_not_get_into_the_network_of_a_replica(of_truth, motor, truth):
    model = Model.of("second", motor, effects_named(("sensor_pickup", "sensor_lag"), "test"))
    of_sensor = {"sensor_pickup.p": 6.0, "sensor_pickup.n": 1.0, "sensor_lag.tau": 20.0}
    values = VALUES | of_sensor
    read = replace(of_truth, values=values).error_K(model, truth) + of_truth.course
    follow = SimpleNamespace(test=of_truth.test, median=read, middle=values | truth, is_there=True,
                             is_held_out=False, residual=of_truth.test.measured - read)  # fmt: skip
    found = replica(model, {}, [follow])
    assert found is not None
    assert found.from_model_K < 1e-2
    assert found.parameters == pytest.approx(truth, rel=1e-3)


def test_a_network_too_stiff_for_the_steps_has_an_error_with_a_square(of_truth, motor, truth):
    stiff = {**truth, "Ceq_w": 1e-3 * truth["Ceq_w"]}
    error = of_truth.error_K(Model.of("second", motor), stiff)
    assert np.max(np.abs(error)) > 1e6
    with np.errstate(over="raise", invalid="raise"):
        assert np.isfinite(error @ error)


def test_errors_towards_cold_weigh_more(of_truth, motor):
    model = Model.of("first", motor)
    start = {"Ceq": 1e4, "Req": 0.2}
    coldest = [nearest(model, start, [of_truth], cold=cold).errors_K[0].min() for cold in (1, COLD)]
    assert coldest[0] < -3.0  # one node cannot follow the winding
    assert coldest[1] > 0.4 * coldest[0]


@pytest.fixture(scope="module")
def exported(finished_day, tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(finished_day)
        assert cli.main(["export", "run", "--to", "drive", "--out", str(folder)]) == 0
    return folder, tomllib.loads((folder / "drive.toml").read_text())


def test_the_stated_bias_is_that_of_the_stated_parameters(exported, finished_day, monkeypatch):
    """Euler steps of a body from the file's numbers alone, against what the run predicts."""
    monkeypatch.chdir(finished_day)
    content, run = exported[1], open_run(Path("run"))
    ohm = content["winding"]["constant_resistance_ohm"]
    one, two = (
        {name: entry["value"] for name, entry in content["bodies"][key]["values"].items()}
        for key in ("one", "two")
    )
    errors = {"one": [], "two": []}
    for name in ("duty", "step"):
        rows, said = pd.read_csv(f"{name}.csv"), run.predict(f"{name}.csv")
        T = W = said.middle["Tw_start"]
        H = said.middle["Tsr_start"]
        course = []
        for current, sink in zip(rows["Is"], rows["Te"], strict=True):
            watts = 3.0 * ohm * current**2
            course.append((T, W))
            T += (watts - (T - sink) / one["R"]) / one["C"]
            across = (W - H) / two["R_winding"]
            W += (watts - across) / two["C_winding"]
            H += (across - (H - sink) / two["R_housing"]) / two["C_housing"]
        at = np.stack([np.interp(said.time_s, rows["t"], each) for each in np.transpose(course)])
        for key, each in zip(errors, at - said.nodes["winding"], strict=True):
            errors[key].append(each)
    for key, found in errors.items():
        bias, error = content["bodies"][key]["bias"], np.concatenate(found)
        # steps of 1 s, and samples for block means while the winding moves by 0.5 K/s
        assert bias["rms_K"] == pytest.approx(np.sqrt(np.mean(error**2)), abs=0.3)
        assert bias["colder_at_most_K"] == pytest.approx(-error.min(), abs=2.0)
        assert bias["warmer_at_most_K"] == pytest.approx(error.max(), abs=2.0)
        assert bias["colder_at_most_K"] < 0.3 * bias["warmer_at_most_K"]  # the safe side
    assert content["bodies"]["two"]["bias"]["rms_K"] < content["bodies"]["one"]["bias"]["rms_K"]


def test_the_figures_follow_from_each_other(exported):
    content = exported[1]
    one, two = (content["bodies"][key]["values"] for key in ("one", "two"))
    for entry in (*one.values(), *two.values()):
        low, high = entry["interval_95"]
        assert low < entry["value"] < high
    q = {name: entry["value"] for name, entry in two.items()}
    across, out = 1.0 / q["R_winding"], 1.0 / q["R_housing"]
    A = np.array([[-across, across], [across, -across - out]])
    A /= np.array([[q["C_winding"]], [q["C_housing"]]])
    times = sorted(-1.0 / np.linalg.eigvals(A))
    assert [q["tau_fast"], q["tau_slow"]] == pytest.approx(times)
    amperes, tau = content["rated"]["current_A"], one["tau"]["value"]
    assert one["I2t"]["value"] == pytest.approx(amperes**2 * tau)
    time = one["time_at_2"]["value"]  # the rise at twice the current is then the rated one
    assert 4.0 * (1.0 - np.exp(-time / tau)) == pytest.approx(1.0)


def test_every_value_stands_under_a_name_with_its_source(exported):
    folder, content = exported
    names = {entry["name"].split()[0]: entry["value"] for entry in content["names"]}
    tau = content["bodies"]["one"]["values"]["tau"]["value"]
    assert names["p0611"] == names["35.55"] == tau
    sheet = (folder / "drive.md").read_text()
    for entry in content["names"]:
        assert f"| {entry['source']} | {entry['name']} |" in sheet
    assert content["signals"][0]["name"] in sheet


def test_a_certified_current_is_the_rated_one(day, monkeypatch):
    said = DerivedFigure(value=140.0, unit="A", sd=1.0, interval_95=(138.0, 142.0),
                         condition="class F, <b>|")  # fmt: skip
    monkeypatch.setattr(Read, "continuous", said)
    content = export_drive(Path("run"))["parameters"]
    assert content["rated"]["is_certified"]
    assert not content["notes"]
    assert "**Rated current 140 A** (95 %: 138 … 142 A): class F, b.\n" in Path(
        "run/drive/drive.md").read_text()  # fmt: skip
    one, sink = content["bodies"]["one"]["values"], content["tested"]["sink_degC"]
    amperes = np.array([one["continuous"]["value"], *one["continuous"]["interval_95"][::-1]])
    R = np.array([one["R"]["value"], *one["R"]["interval_95"]])
    ohm = content["winding"]["constant_resistance_ohm"]
    missed = content["bodies"]["one"]["bias"]["colder_than_upper_95_at_most_K"]
    assert sink + 3.0 * ohm * amperes**2 * R + missed == pytest.approx(155.0)
    names = {entry["name"].split()[0]: entry["value"] for entry in content["names"]}
    assert names["p0305"] == names["9906"] == min(140.0, amperes[0])
    assert names["p0627"] == names["35.54"] == pytest.approx(3.0 * ohm * names["p0305"] ** 2 * R[0])
    assert sink + names["p0627"] <= names["p5391"] + 1e-6, "it trips at its own rated current"


def test_the_rated_current_is_within_the_permitted_rise_where_that_is_known(finished_day):
    read = Read.read(finished_day / "run")
    model = read.run.result.models[read.name]
    by_class, by_rise = (
        DerivedFigure(
            value=value, unit="A", sd=1.0, interval_95=(value - 2.0, value + 2.0), condition=words
        )
        for value, words in ((116.0, "class F"), (100.0, "permitted rise"))
    )
    for derived, expected in (
        ({"continuous_current_A": by_class, "continuous_current_by_rise_A": by_rise}, by_rise),
        ({"continuous_current_A": by_class}, by_class),
        (
            {
                "continuous_current_A": by_class,
                "continuous_current_by_rise_A": DerivedFigure(refused="unknown"),
            },
            by_class,
        ),
    ):
        result = replace(
            read.run.result,
            models={**read.run.result.models, read.name: replace(model, derived=derived)},
        )
        assert replace(read, run=SimpleNamespace(result=result)).continuous == expected


@pytest.fixture
def hostile_run(day):
    """The run of a motor with a hostile name, in a folder with another."""
    motor = tomllib.loads(Path("run/motor.toml").read_text())
    motor["motor"]["name"] = HOSTILE
    Path("run/motor.toml").write_text(tomli_w.dumps(motor))
    listing = json.loads(Path("run/manifest.json").read_text())
    digest = hashlib.sha256(Path("run/motor.toml").read_bytes()).hexdigest()
    listing["files"]["motor.toml"] = digest
    Path("run/manifest.json").write_text(json.dumps(listing))
    return Path("run").rename('r--"><x>&')


def test_no_name_gets_into_xml_toml_or_the_sheet(hostile_run):
    run = str(hostile_run)
    assert cli.main(["export", run, "--to", "drive", "--out", "drive"]) == 0
    content = tomllib.loads(Path("drive/drive.toml").read_text())
    assert content["source"]["machine"] == HOSTILE
    assert content["source"]["run"] == hostile_run.name
    sheet = Path("drive/drive.md").read_text()
    assert "machine: `a<U+0022><U+003E><U+003C>x" in sheet
    assert "[b](c)" not in sheet
    words = ["export", run, "--to", "mujoco", "--out", "mj", "--motor-constant", "0.4"]
    assert cli.main(words) == 0
    tree = attributes("mj/motor.xml")
    assert [*tree] == ["mujoco", "custom", "text", "option", "worldbody", "body", "joint", "geom",
                       "actuator", "dcmotor"]  # fmt: skip
    assert tree["mujoco"]["model"].startswith("a<U+0022><U+003E><U+003C>x<U+002F><U+003E>--")
    assert tree["text"]["data"].startswith("run r--<U+0022><U+003E><U+003C>x")
    assert tree["dcmotor"]["motorconst"] == "0.4"


def attributes(path):
    return {element.tag: element.attrib for element in ElementTree.parse(path).getroot().iter()}


def test_mujoco_heats_its_motor_as_one_body_does(day, capsys):
    mujoco = pytest.importorskip("mujoco")
    assert cli.main(["export", "run", "--to", "mujoco"]) == 0
    assert "motorconst is 1 N m/A, a placeholder" in capsys.readouterr().err
    model = mujoco.MjModel.from_xml_path("run/mujoco/motor.xml")
    simpler = Read.read(Path("run")).simpler("first", is_fed=True, cold=1.0)
    (_, R, _, _), (_, C, _, _), _ = figures(simpler)
    sink = float(attributes("run/mujoco/motor.xml")["dcmotor"]["thermal"].split()[-1])
    ohm, amperes, alpha = 3.0 * simpler.ohm, 120.0, 1.0 / (234.5 + 25.0)
    model.opt.timestep = 0.05
    data = mujoco.MjData(model)
    course = [0.0]
    for _ in range(12000):
        data.ctrl[0] = amperes * ohm * (1.0 + alpha * (course[-1] + sink - 25.0))
        data.qpos[0] = data.qvel[0] = 0.0  # the rotor is locked
        mujoco.mj_step(model, data)
        course.append(float(data.act[0]))
    assert data.qfrc_actuator[0] == pytest.approx(amperes, rel=1e-4)  # at 1 N m/A
    watts, rate = amperes**2 * ohm * (1.0 + alpha * (sink - 25.0)), 1.0 / R
    rate -= amperes**2 * ohm * alpha  # what warms the winding more as it gets warm
    time = 0.05 * np.arange(12001)
    closed = watts / rate * (1.0 - np.exp(-rate * time / C))
    assert closed[-1] > 40.0
    assert np.array(course) == pytest.approx(closed, abs=0.02)


def test_the_rotor_of_mujoco_turns_freely_up_to_its_voltage(day):
    mujoco = pytest.importorskip("mujoco")
    assert cli.main(["export", "run", "--to", "mujoco", "--motor-constant", "0.4"]) == 0
    model = mujoco.MjModel.from_xml_path("run/mujoco/motor.xml")
    data = mujoco.MjData(model)
    data.ctrl[0] = 1.0
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert data.qvel[0] == pytest.approx(1.0 / 0.4)
    assert 0.0 <= data.act[0] < 0.01  # the rotor takes a millijoule


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "duty.csv", "--to", "c"], "--to c exports a run"),
        ([__file__, "--to", "c"], "--to c takes a run folder"),
        (["run", "--to", "c", "--corrected"], "a drive has its own instruments"),
        (["run", "--to", "mat", "--step", "1"], "--step is for --to c, fmu and modelica"),
        (["run", "duty.csv", "--to", "drive"], "--to drive exports a run"),
        ([__file__, "--to", "mujoco"], "--to mujoco takes a run folder"),
        (["run", "--to", "drive", "--replica"], "follows all tests of the run"),
        (["run", "--to", "c", "--motor-constant", "1"], "--motor-constant is for --to mujoco"),
        (["run", "--to", "mujoco", "--motor-constant", "0"], "above 0 N m/A"),
    ],
)
def test_words_of_another_kind_are_refused(words, said, capsys):
    assert cli.main(["export", *words]) == 2
    assert said in capsys.readouterr().err


def test_a_run_without_current_is_refused(day, capsys, monkeypatch):
    monkeypatch.setattr(Read, "ohm", 0.0)
    assert cli.main(["export", "run", "--to", "drive"]) != 0
    assert "no copper loss follows from this run" in capsys.readouterr().err
