"""A test that no run knows, with parameters of a run or of a file: load the data, run the model.

Reference: G. Agostino, Powertrain Retrofit kit testing and thermal modeling, Politecnico di
    Torino, 2023, section 4.4.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..bench.joined import files_of
from ..bench.record import Record
from ..errors import UsageError
from ..motor import Motor
from ..parameter_files import read_parameters
from ..runs.run import open_run
from ..simulation import predict_values, read_driven
from .rerun import RunAndTest, of_record


def read_new_test(
    source: Path, test: Path, *, motor: Motor | None = None, network: str | None = None
) -> RunAndTest:
    """Read a test, and give it the parameters of a run or of a file.

    Args:
        source: A run folder, a TOML file of parameters, or a `prova.mat`.
        test: As `heatrun.bench.joined.read_test`.
        motor: How the bench of the test measures; None for the run's own motor file, which the
            run keeps a copy of.
        network: As `heatrun.simulation.simulate_file`.

    Returns:
        The test. One that the run was fitted to has its name and its values there; any other
        starts from the state of the bench and its first readings.

    Raises:
        InputError: As `heatrun.simulation.simulate_file`.
        UsageError: If there is no motor file for a file of parameters.
    """
    files = tuple(path for path, _ in files_of(test))
    if source.is_dir():
        run = open_run(source)
        machine = motor or run.motor
        record = _with_winding(read_driven(test, machine))
        fitted_as = run.fitted_as(record)
        record = record if fitted_as is None else replace(record, name=fitted_as)
        found = of_record(run, record, machine, network, is_held_out=fitted_as is None)
        return replace(found, inputs=(*found.inputs, *files))
    if motor is None:
        raise UsageError(
            "a file of parameters says nothing of the machine: pass --motor MOTOR.toml"
        )
    record = _with_winding(read_driven(test, motor))
    given = read_parameters(source, network, motor)
    found = predict_values(given.motor, given.values_for(record), record, given.form)
    return RunAndTest(
        run=source,
        model=found.model,
        motor=given.motor,
        record=record,
        values=found.middle,
        is_held_out=True,
        blocks=found.test,
        inputs=(source, Path(motor.path), *files) if motor.path else (source, *files),
        notes=given.notes,
    )


def _with_winding(record: Record) -> Record:
    """Return the record with a column of the winding, NaN where nothing was read."""
    if "winding_degC" in record:
        return record
    nothing = np.full(record.time_s.size, np.nan)
    return replace(record, channels={**record.channels, "winding_degC": nothing})
