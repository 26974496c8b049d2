"""A run as an FMU (FMI 3.0, co-simulation) around the C of `--to c`, its sources included.

The 95 % intervals of the run travel with it: in the descriptions of the parameters, and as
parameter sets that simulators load (SSP 1.0, `.ssv`).

Reference: Functional Mock-up Interface Specification 3.0; System Structure and Parameterization
    1.0 (Modelica Association).
"""

import hashlib
import re
import subprocess
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ..version import __version__
from .c_file import HEADER, SOURCE, CSource, filled_template
from .laws import INPUTS, Entry, in_comment, parts_of, unique

NAME = "thermal_network"

WRAPPER = "fmu.c"

UNITS: Mapping[str, Mapping[str, str]] = {
    "1/K": {"K": "-1"},
    "A": {"A": "1"},
    "J/K": {"kg": "1", "m": "2", "s": "-2", "K": "-1"},
    "K": {"K": "1"},
    "K/W": {"kg": "-1", "m": "-2", "s": "3", "K": "1"},
    "N.m": {"kg": "1", "m": "2", "s": "-2"},
    "Ohm": {"kg": "1", "m": "2", "s": "-3", "A": "-2"},
    "W": {"kg": "1", "m": "2", "s": "-3"},
    "m2": {"m": "2"},
    "degC": {"K": "1", "offset": "273.15"},
    "rpm": {"s": "-1", "rad": "1", "factor": "0.10471975511965977"},
    "s": {"s": "1"},
}
"""Exponents of the base units, factor and offset of each unit; `"1"` is none."""

SETS = ("lower_2.5_percent", "stated", "upper_97.5_percent")

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"

TEMPERATURES = (-100.0, 500.0)
"""Between which the C takes them [degC]."""


class Variable(NamedTuple):
    """A variable of the FMU; its value reference is its place in their list."""

    name: str  # As other programs see it.
    member: str  # Where it stands in the C.
    causality: str  # As FMI has it.
    unit: str  # Its unit, `"1"` for none.
    meaning: str  # What it is.
    start: float = 0.0  # Value at the start [unit].
    bounds: tuple[float, float] = (-1e300, 1e300)  # Least and largest value [unit].


def fmu_files(source: CSource, parameters: Sequence[Entry]) -> dict[str, bytes]:
    """Return what an FMU holds, without binaries, by path.

    Args:
        source: The network as C.
        parameters: Those that can be set.
    """
    # parameters may be set as low as their bounds: the network is faster then
    found = {name: np.array(source.found[name], float, ndmin=1)
             for name in ("capacitance", "resistance")}  # fmt: skip
    for each in parameters:
        name = each.member.split("_")[0]
        if name in found and each.index is not None:
            found[name][each.index] = each.bounds[0]
    source = replace(source, parts=parts_of(source.step, {**source.found, **found}))
    texts = source.texts()
    variables = _variables(source, parameters)
    rows = [
        f"    {{offsetof(machine, {each.member}), {each.causality.upper()}, "
        f"{each.bounds[0]!r}, {each.bounds[1]!r}, {each.start!r}}}"
        for each in variables
    ]
    whole = hashlib.sha256(b"".join(texts.values()) + "\n".join(rows).encode()).hexdigest()
    wrapper = filled_template(WRAPPER, {"rows": ",\n".join(rows), "token": whole})
    files = {
        "modelDescription.xml": _description(source, variables, whole),
        "sources/buildDescription.xml": _build(),
        f"sources/{WRAPPER}": wrapper.encode("ascii"),
        f"sources/{HEADER}": texts[HEADER],
        f"sources/{SOURCE}": texts[SOURCE],
    }
    for place, name in enumerate(SETS):
        values = [(low, each.value, high)[place] for each in parameters
                  for low, high in [each.interval_95 or (np.nan, np.nan)]]  # fmt: skip
        if np.all(np.isfinite(values)):
            files[f"resources/{name}.ssv"] = _parameter_set(name, parameters, values)
    return files


def _variables(source: CSource, parameters: Sequence[Entry]) -> list[Variable]:
    """Return the variables in the order of their value references."""
    found, nodes = source.found, source.nodes
    starts = np.atleast_1d(found["start"])
    current, losses, speed = (float(each) for each in source.largest().values())
    second = found.get("second_sink", "")
    inputs = {
        "current_A": ("A", "rms current of one phase", (-current, current)),
        "losses_W": ("W", source.losses_words, (-losses, losses)),
        "sink_degC": ("degC", f"temperature of the sink: {found['sink']}", TEMPERATURES),
        "second_sink_degC": ("degC", f"temperature of the sink: {second}", TEMPERATURES),
        "coolant_degC": ("degC", "temperature of the coolant", TEMPERATURES),
        "speed_rpm": ("rpm", "speed, of either sign", (-speed, speed)),
        "fan": ("1", "fan or flow over its rated value", (0.0, 1.0)),
    }
    made = [Variable("time", "time_s", "independent", "s", "time")]
    made += [
        Variable(each.name, f"parameters.{each.member}{'' if each.index is None else [each.index]}",
                 "parameter", each.unit, each.words, each.value, each.bounds)
        for each in parameters
    ]  # fmt: skip
    made += [
        Variable(f"{node}_start_degC", f"start_degC[{i}]", "parameter", "degC",
                 f"temperature of {node} at the start", float(starts[i]), TEMPERATURES)
        for i, node in enumerate(nodes)
    ]  # fmt: skip
    for name in source.inputs:
        unit, meaning, bounds = inputs[INPUTS[name]]
        start = float(starts[0]) if unit == "degC" else 0.0
        made.append(Variable(INPUTS[name], f"inputs.{INPUTS[name]}", "input", unit, meaning,
                             start, bounds))  # fmt: skip
    made += [
        Variable(f"{node}_degC", f"state.temperature_degC[{i}]", "output", "degC",
                 f"temperature of {node}", float(starts[i]))
        for i, node in enumerate(nodes)
    ]  # fmt: skip
    names = unique(each.name for each in made)
    return [each._replace(name=name) for each, name in zip(made, names, strict=True)]


def _text(text: str) -> str:
    """Return text without what XML cannot hold, escaped or not."""
    return re.sub(r"[^ -~\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text)


def _description(source: CSource, variables: Sequence[Variable], token: str) -> bytes:
    said = source.said
    root = Element("fmiModelDescription", {
        "fmiVersion": "3.0",
        "modelName": _text(said["machine"]) or NAME,
        "instantiationToken": token,
        "description": _text(f"thermal network ({said['network']}) of run {said['run']}, "
                             f"SHA-256 of fit.json {said['sha256']}"),
        "generationTool": f"heatrun {__version__}",
        "variableNamingConvention": "structured",
    })  # fmt: skip
    SubElement(root, "CoSimulation", {
        "modelIdentifier": NAME, "canHandleVariableCommunicationStepSize": "true",
    })  # fmt: skip
    _units(SubElement(root, "UnitDefinitions"), "", (each.unit for each in variables))
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", {"name": "logStatusError"})
    SubElement(root, "DefaultExperiment", {
        "startTime": "0", "stopTime": repr(source.num_vectors * source.step),
        "stepSize": repr(float(source.step)),
    })  # fmt: skip
    listed = SubElement(root, "ModelVariables")
    structure = SubElement(root, "ModelStructure")
    for reference, each in enumerate(variables):
        attributes = {
            "name": each.name,
            "valueReference": str(reference),
            "causality": each.causality,
            "variability": "fixed" if each.causality == "parameter" else "continuous",
            "description": _text(each.meaning),
            **({} if each.unit == "1" else {"unit": each.unit}),
        }
        if each.causality in ("parameter", "input"):
            low, high = map(repr, each.bounds)
            attributes |= {"min": low, "max": high, "start": repr(each.start)}
        if each.causality == "output":
            attributes["initial"] = "calculated"
            SubElement(structure, "Output", {"valueReference": str(reference)})
        SubElement(listed, "Float64", attributes)
    for output in list(structure):
        SubElement(structure, "InitialUnknown", output.attrib)
    return _bytes(root)


def _build() -> bytes:
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": NAME})
    files = SubElement(configuration, "SourceFileSet", {"language": "C99"})
    for name in (WRAPPER, SOURCE):
        SubElement(files, "SourceFile", {"name": name})
    return _bytes(root)


def _parameter_set(name: str, parameters: Sequence[Entry], values: Sequence[float]) -> bytes:
    ElementTree.register_namespace("ssv", SSV)
    ElementTree.register_namespace("ssc", SSC)
    root = Element(f"{{{SSV}}}ParameterSet", {"version": "1.0", "name": name})
    listed = SubElement(root, f"{{{SSV}}}Parameters")
    for each, value in zip(parameters, values, strict=True):
        entry = SubElement(listed, f"{{{SSV}}}Parameter", {"name": each.name})
        unit = {} if each.unit == "1" else {"unit": each.unit}
        SubElement(entry, f"{{{SSV}}}Real", {"value": repr(value), **unit})
    units = SubElement(root, f"{{{SSV}}}Units")
    _units(units, f"{{{SSC}}}", (each.unit for each in parameters))
    return _bytes(root)


def _units(parent: Element, namespace: str, names: Iterable[str]) -> None:
    for name in dict.fromkeys(names):
        if name != "1":
            unit = SubElement(parent, f"{namespace}Unit", {"name": name})
            SubElement(unit, f"{namespace}BaseUnit", dict(UNITS[name]))


def _bytes(root: Element) -> bytes:
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def compiled(files: Mapping[str, bytes]) -> tuple[dict[str, bytes], list[str]]:
    """Return the binary of an FMU for this platform by path, or why there is none.

    Args:
        files: From `fmu_files`.
    """
    alone = "The FMU holds its sources alone, which many simulators compile themselves"
    try:
        import cmake
        import fmpy
        from fmpy.build import create_cmake_settings
    except ImportError:
        return {}, [f'{alone}: FMPy compiles it here, pip install "heatrun[fmu]".']
    with tempfile.TemporaryDirectory() as place:
        folder, work = Path(place, "fmu"), Path(place, "build")
        for path, content in files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(content)
        work.mkdir()
        create_cmake_settings(folder, work)
        program = str(Path(cmake.CMAKE_BIN_DIR) / "cmake")
        headers = Path(fmpy.__file__).parent / "c-code"
        for words in (
            ["-S", str(headers), "-B", str(work)],
            ["--build", str(work), "--target", "install", "--config", "Release"],
        ):
            done = subprocess.run([program, *words], capture_output=True, text=True, check=False)
            if done.returncode:
                lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
                reason = in_comment(lines[0] if lines else "no reason given")
                return {}, [f"{alone}: no C compiler built it here (CMake: {reason})."]
        built = sorted((folder / "binaries").rglob(f"{NAME}.*"))
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in built}, []
