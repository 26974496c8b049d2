"""A run as FMU and Modelica: valid, with the intervals of the run, and no name gets through."""

import json
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
import xmlschema
from c_programs import needs_compiler
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu
from simulators import LIBRARY, has_modelica, simulated, unpacked, vectors_of

from heatrun import cli
from heatrun.errors import InputError
from heatrun.export import export_source
from heatrun.export.fmu import SETS, compiled, fmu_files
from heatrun.export.modelica import modelica
from heatrun.export.sources import ends, read_source
from heatrun.runs.run import open_run

FMU = "fmu/thermal_network.fmu"
needs_modelica = pytest.mark.skipif(not has_modelica, reason="no Modelica compiler")
HOSTILE = '*/ "); end x; // <&\n\\ \x00 %s$step é'


@pytest.fixture(scope="module")
def read(finished_day):
    """The C of the run, and its parameters."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(finished_day)
        return read_source(Path("run"), None, None, False, 1.0)


@pytest.fixture(scope="module")
def fmu(read, tmp_path_factory):
    return unpacked(tmp_path_factory.mktemp("fmu"), read.source, read.parameters)


@needs_compiler
def test_the_command_writes_an_fmu_that_is_valid(day, capsys):
    assert cli.main(["export", "run", "--to", "fmu", "--out", "fmu"]) == 0
    printed = capsys.readouterr().out
    assert "FMU (FMI 3.0, co-simulation, compiled for this platform) of second order" in printed
    assert validate_fmu(FMU) == []
    rows = np.genfromtxt("fmu/vectors.csv", delimiter=",", names=True, skip_header=1)
    found = simulated(FMU, rows)
    for name in ("winding_degC", "stator_degC"):
        assert np.abs(found[name] - rows[name]).max() < 1e-6
    content = Path(FMU).read_bytes()
    export_source(Path("run"), to="fmu", folder=Path("fmu"), is_replacing=True)
    assert Path(FMU).read_bytes() == content
    Path(FMU).write_bytes(b"PK of another tool")
    with pytest.raises(InputError, match="not as heatrun writes it"):
        export_source(Path("run"), to="fmu", folder=Path("fmu"), is_replacing=True)


def test_its_parameter_sets_are_the_intervals_of_the_run(read, finished_day, tmp_path):
    files = fmu_files(read.source, read.parameters)
    schema = Path(fmpy.__file__).parent / "ssp" / "schema" / "SystemStructureParameterValues.xsd"
    stated = json.loads((finished_day / "run/fit.json").read_text())["models"]["second"]
    stated = {**stated["parameters"], **stated["nuisances"]}
    for place, name in enumerate(SETS):
        text = files[f"resources/{name}.ssv"].decode()
        xmlschema.XMLSchema(str(schema)).validate(text)
        root = ElementTree.fromstring(text)
        found = {e.get("name"): float(e[0].get("value")) for e in root[0]}
        assert set(found) == {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr", "Rs0"}
        for each, value in found.items():
            low, high = stated[each]["interval_95"]
            assert value == pytest.approx((low, stated[each]["value"], high)[place])
    assert "95 % interval" in files["modelDescription.xml"].decode()


@needs_compiler
def test_set_to_the_end_of_its_intervals_it_is_as_lptn_there(read, fmu, finished_day):
    limits = ends(open_run(finished_day / "run"), None, read.found, read.source)
    for end, limit in enumerate(limits):
        values = {each.name: each.interval_95[end] for each in read.parameters}
        rows = vectors_of(limit)
        found = simulated(fmu, rows, start_values=values)
        for name in ("winding_degC", "stator_degC"):
            assert np.abs(found[name] - rows[name]).max() < 1e-6


@pytest.fixture
def slave(fmu):
    description = fmpy.read_model_description(str(fmu))
    made = FMU3Slave(
        guid=description.guid, unzipDirectory=str(fmu), modelIdentifier="thermal_network",
        instanceName="it",
    )  # fmt: skip
    made.instantiate()
    made.by_name = {each.name: each.valueReference for each in description.modelVariables}
    yield made
    made.freeInstance()


def started(slave):
    slave.enterInitializationMode()
    for name, value in {"current_A": 120.0, "losses_W": 500.0, "sink_degC": 20.0}.items():
        slave.setFloat64([slave.by_name[name]], [value])
    slave.exitInitializationMode()


def winding(slave):
    return slave.getFloat64([slave.by_name["winding_degC"]])[0]


@needs_compiler
@pytest.mark.parametrize("step", [0.25, 7.0, 2.5])
def test_steps_of_any_length_come_to_the_same(slave, step):
    at_140_s = []
    for each in (1.0, step):
        started(slave)
        for k in range(round(140.0 / each)):
            slave.doStep(k * each, each)
        at_140_s.append(winding(slave))
        slave.reset()
    assert at_140_s[1] == pytest.approx(at_140_s[0], abs=1e-6)
    assert at_140_s[0] > 30.0


@needs_compiler
def test_values_beyond_their_limits_are_refused(slave, capfd):
    for value in (np.nan, 1e9, -1.0):
        with pytest.raises(FMICallException):
            slave.setFloat64([slave.by_name["Ceq_w"]], [value])
    with pytest.raises(FMICallException):
        slave.setFloat64([slave.by_name["winding_degC"]], [20.0])
    started(slave)
    before = winding(slave)
    for name, value in (("current_A", np.inf), ("sink_degC", -300.0), ("Req_w", 0.15)):
        with pytest.raises(FMICallException):
            slave.setFloat64([slave.by_name[name]], [value])
    with pytest.raises(FMICallException):
        slave.doStep(0.0, -1.0)
    assert winding(slave) == before
    slave.doStep(0.0, 1.0)
    assert winding(slave) > before


def test_without_a_compiler_it_holds_its_sources_and_says_so(day, monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    written = export_source(Path("run"), to="fmu", folder=Path("fmu"))
    assert not written["is_compiled"]
    assert "holds its sources alone" in written["notes"][-1]
    with zipfile.ZipFile(FMU) as archive:
        assert not any("binaries" in name for name in archive.namelist())
        assert "sources/thermal_network.c" in archive.namelist()
    assert validate_fmu(FMU) == []
    monkeypatch.setitem(sys.modules, "fmpy", None)
    assert 'pip install "heatrun[fmu]"' in compiled({})[1][0]


def hostile(read):
    """The same with names that would end a comment, a string or a tag."""
    source = replace(read.source, said=dict.fromkeys(read.source.said, HOSTILE))
    names = [HOSTILE, f"end {HOSTILE}"]
    links = [[names[1], "time"], [names[0], names[1]]]
    found = {**source.of_run, "nodes": names, "links": links, "sink": "time",
             "copper_node": names[0], "sensor": {"node": names[0]}}  # fmt: skip
    words = ("end", "time", HOSTILE, 'x"/>', "model")
    parameters = [
        replace(each, name=name, meaning=HOSTILE + each.meaning)
        for name, each in zip(words, read.parameters, strict=True)
    ]
    return replace(source, of_run=found), parameters


@needs_compiler
def test_hostile_names_stay_inside_the_fmu(read, tmp_path):
    source, parameters = hostile(read)
    made = unpacked(tmp_path, source, parameters)
    assert validate_fmu(str(made)) == []
    description = fmpy.read_model_description(str(made))
    assert "*/" in description.modelName
    assert len({each.name for each in description.modelVariables}) == 13
    assert "#error" not in (made / "sources/fmu.c").read_text()


@needs_modelica
def test_hostile_names_stay_inside_the_modelica(read):
    import rumoca

    text = modelica(*hostile(read)).decode()
    model = rumoca.Session(roots=[LIBRARY]).loads(text, model="ThermalNetwork.Network")
    assert len(model.states.names) == 2
    assert text.count("\n") == modelica(read.source, read.parameters).decode().count("\n")


@needs_modelica
def test_the_command_writes_modelica_with_its_intervals(day, capsys):
    import rumoca

    assert cli.main(["export", "run", "--to", "modelica", "--out", "mo"]) == 0
    assert "Modelica of second order: nodes winding, stator" in capsys.readouterr().out
    stated = json.loads(Path("run/fit.json").read_text())["models"]["second"]["parameters"]
    text = Path("mo/ThermalNetwork.mo").read_text()
    for end, name in enumerate(("Lower", "Upper")):
        model = rumoca.Session(roots=[LIBRARY]).loads(text, model=f"ThermalNetwork.{name}")
        found = {each.name: each.value for each in model.parameters}
        for each, entry in stated.items():
            assert found[each] == pytest.approx(entry["interval_95"][end])
    again = export_source(Path("run"), to="modelica", folder=Path("mo"), is_replacing=True)
    assert Path(again["files"][0]).read_text() == text
