"""What a calibration does, in numbers that do not depend on the machine; prints one JSON object.

Run by `test_ratios.py` in a process of its own, where nothing has been compiled yet: compilations
by function, calls of the likelihood, the search and the noise, and the memory that the compiled
likelihood needs beside its arguments.
"""

import json
from collections import Counter
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest import mock

import heatrun  # noqa: F401  (sets XLA's options before JAX is used)

import jax  # isort: skip
import jax.numpy as jnp
import numpy as np

from heatrun.calibration import BenchTest, Settings, calibrate
from heatrun.fit import fit as fit_module
from heatrun.fit import restricted as restricted_module
from heatrun.model.problem import log_posterior_batch
from heatrun.motor.file import load_motor
from heatrun.posterior import importance as proposal_module
from heatrun.posterior.posterior import sample
from heatrun.readers.joined import read_test
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

DATA = Path(__file__).parents[2] / "data" / "synthetic"
COMPILED = "/jax/core/compile/backend_compile_duration"
STEPS = 500

compilations: Counter[str] = Counter()
calls: Counter[str] = Counter()


def listen(event: str, _: float, **about) -> None:
    """Count a compilation under the name of its function."""
    if event == COMPILED:
        compilations[str(about.get("fun_name"))] += 1


def counted(name: str, function):
    """Return the function with its calls counted, and the rows it was called with."""

    def call(*arguments):
        calls[name] += 1
        for argument in arguments:
            if isinstance(argument, jax.Array) and argument.ndim == 2:
                calls[f"{name} rows"] += argument.shape[0]
                break
        return function(*arguments)

    return call


@contextmanager
def counting():
    """Count calls and compilations inside; yields what the block is to fill in."""
    calls.clear()
    compilations.clear()
    found: dict = {}
    with (
        mock.patch.object(fit_module, "_solve", counted("search", fit_module._solve)),
        mock.patch.object(
            restricted_module, "_objective", counted("noise", restricted_module._objective)
        ),
        mock.patch.object(
            proposal_module, "log_posterior_batch", counted("likelihood", log_posterior_batch)
        ),
    ):
        yield found
    found |= {"calls": dict(calls), "compilations": dict(compilations)}


def warmer(record: Record) -> Record:
    """Return another record of the same shape: other numbers, nothing new to compile."""
    channels = dict(record.channels)
    channels["winding_degC"] = channels["winding_degC"] + 1.0
    return Record("warmer", channels)


def main() -> None:
    jax.monitoring.register_event_duration_secs_listener(listen)
    motor = load_motor(DATA / "motor.toml")
    record = read_test(DATA / "duty_30min.csv.gz", motor)
    result = {}
    for name, one in (("first", record), ("second", warmer(record))):
        test = BenchTest(one, reduce(one, motor), "calibration", ())
        with counting() as found:
            done = calibrate(motor, [test], Settings(networks=("second",), method="quick"))
        fitted = done.posteriors["second"].fit
        found["steps"] = fitted.stats["num_steps"]
        found["method"] = done.posteriors["second"].method
        result[name] = found
    with counting() as found:
        sample(fitted, most_steps=STEPS)
    result["emcee"] = found

    problem = fitted.problem
    num_rows = proposal_module.BATCH
    rows = jnp.asarray(np.zeros((num_rows, fitted.vector.size)))
    without = replace(problem, heat=None)
    sizes = [
        log_posterior_batch.lower(each.structure, each.data, rows).compile().memory_analysis()
        for each in (without, problem)
    ]
    assert problem.heat is not None
    result["memory"] = {
        "temporary_bytes": sizes[0].temp_size_in_bytes,
        "temporary_bytes_with_heat": sizes[1].temp_size_in_bytes,
        "num_heat": problem.heat[0].shape[1],
        "num_steps": problem.tests[0].inputs.num_time,
        "num_blocks": problem.tests[0].measured.size,
        "num_rows": num_rows,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
