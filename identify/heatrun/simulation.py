"""A virtual prototype's record: what identified parameters say of the load of a real test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from .bench import Record, read_record, require
from .bench.readers.open_file import read_start
from .errors import InputError
from .inference.catalogue import known_effects
from .inference.draws import NUM_NOISE, Draws
from .inference.effect_parameters import effect_names
from .inference.model import Model, override_names, parameters
from .inference.networks import NetworkForm, network_named
from .inference.predict import Prediction, predict
from .inference.virtual import reduce_driven, refuse_coarse_steps, refuse_runaway, virtual_record
from .io.file_set import together
from .io.toml_text import LARGEST_BYTES, parse_toml
from .io.whole_files import writable, write_whole
from .motor import Motor
from .runs.run import open_run

LARGEST = 1e30
"""Beyond it no parameter means anything in any unit, and its square is no float64."""


def simulate_file(
    motor: Motor, source: str, path: Path, network: str | None, folder: Path, seed: int
) -> dict[str, Any]:
    """Simulate the load of a test and write the virtual record as CSV.

    Args:
        motor: The machine.
        source: A run folder, or a TOML file with parameters by name.
        path: The test whose currents, losses and sink drive the model.
        network: Name of the network; None for the last one of a run, or the second order.
        folder: Where `NAME_virtual.csv` goes.
        seed: Of the draws behind the bands, which a run gives: columns such as
            `winding_95_low_degC`, with the noise of a block mean.

    Returns:
        Name of the file, number of rows, network and effects, the error to a measured winding
        where there is one, and why there are no bands where there are none.

    Raises:
        InputError: If parameters are missing, or the record lacks a channel.
    """
    record = read_record(path, motor)
    require(record, ["phase_current_A", "losses_W", f"{motor.sink}_degC"])
    lacking = ""
    if Path(source).is_dir():
        found = open_run(source).predict(record, network=network, motor=motor, seed=seed)
    else:
        form = network_named(network or "second")
        found = predict_values(motor, parameters_from(Path(source), form, motor), record, form)
        lacking = "a TOML file of parameters says nothing of their uncertainty"
    table = virtual_record(found, record, motor)
    target = folder / f"{record.name}_virtual.csv"
    with writable("the record", target), together(folder, "virtual") as files:
        text = table.to_csv(index=False, float_format="%.6g")
        write_whole(files.aside / target.name, text.encode())
    return {
        "file": str(target),
        "num_rows": len(table),
        "network": found.model.name,
        "effects": [kind.card.id for kind in found.model.effects],
        "rmse_K": found.rmse_K if np.isfinite(found.rmse_K) else None,
        "test": record.name,
        "no_bands": lacking,
    }


def simulate_values(
    motor: Motor, values: Mapping[str, float], record: Record, network: str | NetworkForm
) -> pd.DataFrame:
    """Return the virtual record of given parameters.

    Args:
        motor: The machine.
        values: Parameters by name, those of the motor file's known effects as
            `speed_cooling.g`; the start is taken from the record's first readings, or from
            the sink where no winding was measured.
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
    known = parameters(model, motor, [blocks])
    starts = {name for _, name in model.form.starts} - set(values)
    fixed = {}
    for name, parameter in known.by_test[0].items():
        if name not in starts and not parameter.per_test:
            default = parameter.centre if parameter.fixed is None else parameter.fixed
            fixed[name] = replace(parameter, fixed=values.get(name, default))
    exact = replace(known, by_test=(fixed,), slots=())
    draws = Draws(model, motor, exact, np.zeros((1, NUM_NOISE)))
    given = {name: p.fixed for name, p in fixed.items() if p.fixed is not None}
    refuse_coarse_steps(model, given, blocks)
    found = predict(draws, blocks)
    refuse_runaway(found, record.name)
    return found


def parameters_from(
    source: Path, form: NetworkForm, motor: Motor | None = None
) -> dict[str, float]:
    """Return parameters by name from a TOML file.

    Args:
        source: The file.
        form: The network that they are for.
        motor: The machine, whose known effects may have parameters too.

    Raises:
        InputError: If there is no such file, or a parameter is missing or misnamed.
    """
    content = parse_toml(read_start(source, LARGEST_BYTES), str(source), "file of parameters")
    content = content.get("parameters", content)
    if not isinstance(content, dict):
        raise InputError(
            "expected a section [parameters].", where=str(source),
            remedy="Write lines such as Ceq_w = 666.75.",
        )  # fmt: skip
    effects = effect_names(known_effects(motor)) if motor and motor.effects else ()
    units = {parameter.name: parameter.unit for parameter in form.parameters}
    needed = [p.name for p in form.parameters if p.fixed is None]
    missing = [name for name in needed if name not in content]
    unknown = [name for name in content if name not in (*override_names(form), *effects)]
    if missing or unknown:
        what = [f"{', '.join(missing)} missing"] if missing else []
        what += [f"{', '.join(unknown)} unknown"] if unknown else []
        raise InputError(
            f"parameters of the {form.title}: {'; '.join(what)}.",
            where=str(source),
            remedy=f"Give {', '.join(needed)} (J/K and K/W).",
        )
    bad = [n for n, v in content.items() if isinstance(v, bool) or not isinstance(v, int | float)]
    if bad:
        raise InputError(
            f"{', '.join(bad)}: expected a number.", where=str(source), remedy="Write 666.75."
        )
    positive = {name for name, unit in units.items() if unit in ("J/K", "K/W")} | {"Rs0"}
    for name, value in content.items():
        # compared before it becomes a float, which a number of 400 digits cannot
        if not abs(value) < LARGEST or (name in positive and not value > 0):
            raise InputError(
                f"{name} = {value!s:.40}: expected a number"
                f"{' above 0' if name in positive else ''} below {LARGEST:g}.",
                where=str(source),
                remedy="Write 666.75.",
            )
    return {name: float(value) for name, value in content.items()}
