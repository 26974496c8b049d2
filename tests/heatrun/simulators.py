"""FMU and Modelica of an export in simulators that are not ours: FMPy, and the compiler rumoca."""

import importlib.util
import io
import os
from dataclasses import replace
from functools import cache
from pathlib import Path

import fmpy
import numpy as np

from heatrun.export.fmu import NAME, compiled, fmu_files
from heatrun.export.laws import INPUTS
from heatrun.export.modelica import modelica
from heatrun.export.vectors import vectors

has_modelica = importlib.util.find_spec("rumoca") is not None

LIBRARY = os.environ.get("MODELICAPATH") or str(Path(__file__).with_name("modelica_library.mo"))
"""The standard library where it is there, else those of its parts that an export uses."""


@cache
def vectors_text(made):
    """Return the vectors of a source, made once."""
    return vectors(made, "duty")


def vectors_of(made):
    """Return the rows of its vectors with their names: the start, then each step."""
    text = vectors_text(made).decode()
    return np.genfromtxt(io.StringIO(text), delimiter=",", names=True, skip_header=1)


def unpacked(folder, made, parameters):
    """Write an FMU as a folder; return it."""
    files = fmu_files(made, parameters)
    binaries, why_none = compiled(files)
    assert not why_none
    for path, content in {**files, **binaries}.items():
        (folder / "fmu" / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / "fmu" / path).write_bytes(content)
    return folder / "fmu"


def simulated(fmu, rows, **words):
    """Return what FMPy makes of an FMU whose inputs are those of vectors."""
    inputs = [name for name in dict.fromkeys(INPUTS.values()) if name in rows.dtype.names]
    held = np.zeros(len(rows) - 1, [(name, float) for name in ("time", *inputs)])
    held["time"] = rows["time_s"][:-1]
    for name in inputs:
        held[name] = rows[name][1:]
    step = rows["time_s"][1]
    return fmpy.simulate_fmu(
        str(fmu), **{"stop_time": rows["time_s"][-1], "step_size": step, "output_interval": step,
                     "input": held, **words}
    )  # fmt: skip


def fmu_error(folder, made, parameters):
    """Return the largest difference of an FMU to lptn [K]."""
    fmu, rows = unpacked(folder, made, parameters), vectors_of(made)
    found = simulated(fmu, rows)
    assert fmpy.read_model_description(str(fmu)).coSimulation.modelIdentifier == NAME
    return max(np.abs(found[name] - rows[name]).max() for name in found.dtype.names[1:])


def modelica_error(made, parameters):
    """Return the largest difference of the Modelica to lptn [K], with loads held for a minute.

    The compiler takes no inputs over time: a model around it holds them as parameters, and each
    minute starts where the last ended.
    """
    import rumoca

    rows = vectors_of(replace(made, step=60.0))
    inputs = [name for name in dict.fromkeys(INPUTS.values()) if name in rows.dtype.names]
    outputs = [name for name in rows.dtype.names if name.endswith("_degC") and name not in inputs]
    around = "".join(f"parameter Real {name} = 0; " for name in inputs)
    around += "equation " + "".join(f"it.{name} = {name}; " for name in inputs)
    text = modelica(made, parameters).decode()
    session = rumoca.Session(roots=[LIBRARY])
    model = session.loads(
        f"{text}\nmodel Around\n  ThermalNetwork.Network it;\n  {around}\nend Around;\n",
        model="Around",
    )
    precise = rumoca.SimConfig(solver="rk-like", rtol=1e-12, atol=1e-10)
    start, errors = {}, []
    for row in rows[1:]:
        load = {name: float(row[name]) for name in inputs}
        found = model.simulate((0, 60), dt=60.0, params={**load, **start}, config=precise)
        at_end = {name: float(found[f"it.{name}"][-1]) for name in outputs}
        start = {f"it.{name.replace('_degC', '_start_degC')}": T for name, T in at_end.items()}
        errors += [at_end[name] - row[name] for name in outputs]
    return np.abs(errors).max()
