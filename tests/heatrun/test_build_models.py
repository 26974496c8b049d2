"""build_models.m: its block diagrams are whole, and integrate to what `heatrun simulate` says."""

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import simulink_models
from octave import needs_octave, octave
from run_near_truth import TRUTH
from simulink_models import Diagram
from test_export_new import row_means, rows_at_level_load

from heatrun.export import mat_bytes, simulate_variables, thesis_variables
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.record.record import Record
from heatrun.simulation import simulate_values

DATA = Path(__file__).parents[2] / "data" / "synthetic"
SCRIPT = (files("heatrun.export") / "templates" / "build_models.m").read_text()
SECOND, FIRST = "Second_Order_Thermal_Motor_Model", "First_Order_Thermal_Motor_Model"
VALUES = {
    "second": TRUTH | {"Tw_start": 20.4, "Tsr_start": 19.8},
    "first": {"Ceq": 12500.0, "Req": 0.132, "Tw_start": 20.4},
}
MODEL = {"second": SECOND, "first": FIRST}


@pytest.fixture(scope="module")
def motor():
    return load_motor(DATA / "motor.toml")


@pytest.fixture(scope="module")
def record(motor):
    """Half an hour of hard steps of load, two samples a second."""
    full = read_record(DATA / "duty_30min.csv.gz", motor)
    return Record("duty", {name: values[::5] for name, values in full.channels.items()})


@pytest.fixture(scope="module")
def models():
    return simulink_models.parse(SCRIPT)


def test_both_models_are_whole(models):
    assert set(models) == {SECOND, FIRST}
    assert (len(models[SECOND].blocks), len(models[SECOND].lines)) == (23, 27)
    assert (len(models[FIRST].blocks), len(models[FIRST].lines)) == (11, 11)
    assert {name: simulink_models.problems(one) for name, one in models.items()} == {
        SECOND: [],
        FIRST: [],
    }


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda d: d.lines.pop(), "is driven 0 times"),
        (lambda d: d.lines.append(d.lines[0]), "is driven 2 times"),
        (lambda d: d.lines.append(("Tw/1", "Heat of the stator/5")), "no such port"),
        (lambda d: d.lines.append(("Tw/2", "Ts_sim/1")), "no such port"),
        (lambda d: d.blocks.pop("Pse"), "no such block"),
        (lambda d: d.blocks.update(More=("simulink/Math/Gain", {})), "no block simulink/Math/Gain"),
        (lambda d: d.blocks["Pse"][1].update(Factor="2"), "no parameter Factor"),
    ],
)
def test_a_diagram_that_is_not_whole_is_seen(spoil, said):
    diagram = simulink_models.parse(SCRIPT)[SECOND]
    spoil(diagram)
    found = simulink_models.problems(diagram)
    assert any(said in one for one in found), found


@pytest.mark.parametrize("order", ["second", "first"])
def test_the_diagram_integrates_to_what_simulate_says(order, models, record, motor):
    variables, _ = thesis_variables(record, VALUES[order], motor, order)
    time, found = simulink_models.integrate(models[MODEL[order]], variables, step=0.5)
    # lptn's own course of the same variables, at every sample; both draw straight lines between
    np.testing.assert_allclose(found["Tw_sim"], simulate_variables(variables).sensed, atol=2e-3)
    virtual = simulate_values(motor, VALUES[order], record, order)
    columns = {"Tw_sim": "winding_degC", "Ts_sim": "stator_degC"}
    if order == "first":
        del columns["Ts_sim"]
    is_level = rows_at_level_load(virtual)
    assert np.mean(is_level) > 0.95
    for variable, column in columns.items():
        means = row_means(time, found[variable], virtual["time_s"])
        assert np.max(np.abs(means - virtual[column])[is_level]) < 0.01, variable
    if order == "second":
        # 3 Is^2 Rs0 (B + Tw)/(B + Trif), the thesis' section 4.3
        loss = 3 * 0.0062 * variables["Is"].ravel() ** 2 * (234.5 + found["Tw_sim"]) / 259.5
        np.testing.assert_allclose(found["Pjs_sim"], loss, rtol=1e-12)


def test_a_wrong_sign_would_be_seen(models, record, motor):
    """Else the comparison above could not fail."""
    blocks = dict(models[SECOND].blocks)
    library, given = blocks["Heat of the stator"]
    blocks["Heat of the stator"] = (library, {**given, "Inputs": "++--"})
    wrong = Diagram(blocks, models[SECOND].lines, models[SECOND].settings)
    variables, _ = thesis_variables(record, VALUES["second"], motor, "second")
    _, found = simulink_models.integrate(wrong, variables, step=0.5)
    assert np.max(np.abs(found["Tw_sim"] - simulate_variables(variables).sensed)) > 1.0


STUB = """function varargout = {name}(varargin)
  varargout = {{false}};
  file = fopen(getenv('SIMULINK_CALLS'), 'a');
  words = cellfun(@(word) regexprep(num2str(word), ' +', ' '), varargin, 'UniformOutput', false);
  fprintf(file, '%s\\n', strjoin([{{'{name}'}}, words], '\\t'));
  fclose(file);
  if strcmp('{name}', 'save_system'), fclose(fopen(varargin{{2}}, 'w')); end
  if strcmp('{name}', 'get_param'), varargout = {{getenv('SIMULINK_FILE')}}; end
end
"""
STUBS = ("load_system", "bdIsLoaded", "close_system", "new_system", "add_block", "add_line",
         "set_param", "save_system", "get_param")  # fmt: skip
"""The functions of Simulink that the script calls, replaced by such that write the call down."""


def build(folder, variables, tail=""):
    """Return the calls of Simulink that the script makes in Octave, and what it prints."""
    (folder / "prova.mat").write_bytes(mat_bytes(variables))
    (folder / "build_models.m").write_text(SCRIPT)
    stubs = folder / "stubs"
    stubs.mkdir(exist_ok=True)
    for name in STUBS:
        (stubs / f"{name}.m").write_text(STUB.format(name=name))
    (folder / "all.m").write_text(f"source('{folder}/build_models.m');\n{tail}")
    calls = folder / "calls.txt"
    calls.unlink(missing_ok=True)
    said = octave(
        folder / "all.m", folder, "--path", str(stubs),
        SIMULINK_CALLS=str(calls), SIMULINK_FILE=str(folder / "any.slx"),
    )  # fmt: skip
    return [line.split("\t") for line in calls.read_text().splitlines()], said


def diagrams(calls):
    """Return the models of calls that were written down."""
    models: dict[str, Diagram] = {}
    for what, *words in calls:
        if what == "new_system":
            models[words[0]] = Diagram()
        elif what == "add_block":
            library, name, *pairs = words
            model, _, block = name.partition("/")
            given = dict(zip(pairs[::2], pairs[1::2], strict=True))
            given["Position"] = f"[{given['Position']}]"
            models[model].blocks[block] = (library, given)
        elif what == "add_line":
            models[words[0]].lines.append((words[1], words[2]))
        elif what == "set_param":
            models[words[0]].settings |= dict(zip(words[1::2], words[2::2], strict=True))
    return models


@needs_octave
def test_octave_runs_the_script_and_makes_the_same_calls(models, record, motor, tmp_path):
    variables, _ = thesis_variables(record, VALUES["second"], motor, "second")
    calls, printed = build(tmp_path, variables)
    built = diagrams(calls)
    assert set(built) == set(models)
    for name, model in models.items():
        assert built[name].blocks == model.blocks
        assert built[name].lines == model.lines
    settings = built[SECOND].settings
    assert settings["Solver"] == "ode4"
    assert float(settings["FixedStep"]) == pytest.approx(0.5, rel=1e-12)
    assert float(settings["StopTime"]) == variables["t"][-1, 0]
    assert printed.splitlines() == [str(tmp_path / f"{name}.slx") for name in (SECOND, FIRST)]
    # a second time, what is there is kept
    build(tmp_path, variables)
    assert {path.name for path in tmp_path.glob("*.bak")} == {
        f"{name}.slx.bak" for name in (SECOND, FIRST)
    }


@needs_octave
@pytest.mark.parametrize(("order", "other"), [("second", "first"), ("first", "second")])
def test_a_model_refuses_the_variables_of_the_other_order(order, other, record, motor, tmp_path):
    """The start function that the script gives a model, run by Octave as Simulink would."""
    channels = {**record.channels, "winding_degC": np.full(record.time_s.size, np.nan)}
    variables, _ = thesis_variables(Record("bare", channels), VALUES[order], motor, order)
    calls, _ = build(tmp_path, variables)
    built = diagrams(calls)
    assert "Tw_m" not in built[MODEL[order]].blocks  # nothing was read
    start = {name: model.settings["InitFcn"] for name, model in built.items()}
    assert all(re.search(rf"get_param\('{name}', 'FileName'\)", start[name]) for name in start)
    _, printed = build(tmp_path, variables, start[MODEL[order]] + "\nprintf('%g\\n', Ceqw);\n")
    assert float(printed.split()[-1]) == variables["Ceqw"].item()
    tail = f"try\n{start[MODEL[other]]}\ncatch problem\ndisp(problem.message);\nend\n"
    _, printed = build(tmp_path, variables, tail)
    assert f"prova.mat holds the {order} order: export with --model {other}." in printed
