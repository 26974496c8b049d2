"""A virtual prototype's record: what identified parameters say of the load of a real test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .bench import Record, require
from .bench.blocks import Blocks
from .bench.checks.samples import needed_channels
from .bench.joined import read_test
from .inference.catalogue import known_effects
from .inference.draws import NUM_NOISE, Draws
from .inference.model import Model
from .inference.model_parameters import parameters
from .inference.networks import NetworkForm
from .inference.predict import Prediction, predict
from .inference.virtual import reduce_driven, refuse_coarse_steps, refuse_runaway, virtual_record
from .io.file_set import together
from .io.free_names import is_other, numbered, refuse_replacing
from .io.whole_files import writable, write_whole
from .motor import Motor, ParameterOverride
from .parameter_files import read_parameters
from .runs.run import open_run


def simulate_file(
    motor: Motor,
    source: str,
    path: Path,
    network: str | None,
    folder: Path | None,
    seed: int,
    *,
    is_replacing: bool = False,
) -> dict[str, Any]:
    """Simulate the load of a test and write the virtual record as CSV.

    Args:
        motor: The machine.
        source: A run folder, a TOML file with parameters by name, or a `prova.mat`.
        path: The test whose currents, losses and sink drive the model.
        network: Name of the network; None for the last one of a run, that of a `prova.mat`, or
            the second order.
        folder: Where `NAME_virtual.csv` goes; None for here, numbered where that name is taken
            by another record.
        seed: Of the draws behind the bands, which a run gives: columns such as
            `winding_95_low_degC`, with the noise of a block mean.
        is_replacing: Whether another record in `folder` is replaced.

    Returns:
        Name of the file, number of rows, network and effects, the error to a measured winding
        where there is one, why there are no bands where there are none, and notes.

    Raises:
        InputError: If parameters are missing, the record lacks a channel, or another record is in
            `folder` under that name.
    """
    record = read_driven(path, motor)
    lacking, notes = "", ()
    if Path(source).is_dir():
        found = open_run(source).predict(record, network=network, motor=motor, seed=seed)
    else:
        given = read_parameters(Path(source), network, motor)
        found = predict_values(given.motor, given.values_for(record), record, given.form)
        lacking, notes = "a file of parameters says nothing of their uncertainty", given.notes
    table = virtual_record(found, record, motor)
    text = table.to_csv(index=False, float_format="%.6g").encode()
    target = (folder or Path()) / f"{record.name}_virtual.csv"
    if folder is None:
        target = next(at for at in numbered(target) if not is_other(at, text))
    elif not is_replacing and is_other(target, text):
        refuse_replacing(target, "another record")
    with writable("the record", target), together(target.parent, "virtual") as files:
        write_whole(files.aside / target.name, text)
    return {
        "file": str(target),
        "num_rows": len(table),
        "network": found.model.name,
        "effects": [kind.card.id for kind in found.model.effects],
        "rmse_K": found.rmse_K if np.isfinite(found.rmse_K) else None,
        "test": record.name,
        "no_bands": lacking,
        "notes": list(notes),
    }


def read_driven(path: Path, motor: Motor) -> Record:
    """Read a test whose current, losses and sink drive a model.

    Args:
        path: As `heatrun.bench.joined.read_test`.
        motor: How its bench measures.

    Raises:
        InputError: If it cannot be read, or lacks one of these channels.
    """
    record = read_test(path, motor)
    require(record, [name for name in needed_channels(record, motor) if name != "winding_degC"])
    return record


def simulate_values(
    motor: Motor, values: Mapping[str, float], record: Record, network: str | NetworkForm
) -> pd.DataFrame:
    """Return the virtual record of given parameters.

    Args:
        motor: The machine.
        values: Parameters by name, those of the motor file's known effects as
            `speed_cooling.g`; a start temperature that is not given is taken from the record's
            first readings, or from the sink where no winding was measured.
        record: Currents, losses and sink.
        network: Name of a network, or the network.

    Raises:
        InputError: If the record lacks a channel, or the model leaves the temperatures at which
            there is a machine.
    """
    found = predict_values(motor, values, record, network)
    return virtual_record(found, record, motor)


def predict_values(
    motor: Motor, values: Mapping[str, float], record: Record, network: str | NetworkForm
) -> Prediction:
    """Return the prediction of given parameters, taken as exact; arguments as `simulate_values`."""
    blocks = reduce_driven(record, motor)
    model = Model.of(network, motor, known_effects(motor))
    draws = exact_draws(model, motor, values, blocks)
    exactly = {p.name: p.fixed for p in draws.parameters.by_test[0].values() if p.fixed is not None}
    refuse_coarse_steps(model, exactly, blocks)
    found = predict(draws, blocks)
    refuse_runaway(found, record.name)
    return found


def exact_draws(model: Model, motor: Motor, values: Mapping[str, float], blocks: Blocks) -> Draws:
    """Return the one draw of parameters that are taken as exact.

    Args:
        model: The network with its effects.
        motor: The machine.
        values: Parameters by name; one that is not given is at the centre of its prior.
        blocks: The test.
    """
    starts = {name for _, name in model.form.starts}
    given = {name: ParameterOverride(fixed=values[name]) for name in starts & set(values)}
    motor = replace(motor, parameters={**motor.parameters, **given})
    known = parameters(model, motor, [blocks])
    fixed = {}
    for name, parameter in known.by_test[0].items():
        if name not in starts and not parameter.per_test:
            default = parameter.centre if parameter.fixed is None else parameter.fixed
            fixed[name] = replace(parameter, fixed=values.get(name, default))
    exact = replace(known, by_test=(fixed,), slots=())
    return Draws(model, motor, exact, np.zeros((1, NUM_NOISE)))
