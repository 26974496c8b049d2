"""A virtual prototype's record: what identified parameters say of the load of a real test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd

from lptn import Trace, growth_rate

from .bench import Record, read_record, require
from .bench.blocks import Blocks
from .bench.readers.open_file import read_start
from .bench.reduction import reduce
from .errors import InputError
from .inference.model import ALL_NAMES, NETWORK, Model, Order, parameters
from .io.file_set import together
from .io.toml_text import LARGEST_BYTES, parse_toml
from .io.whole_files import writable, write_whole
from .motor import Motor
from .runs.run_folder import load_result

LARGEST = 1e30
"""Beyond it no parameter means anything in any unit, and its square is no float64."""

MELTING_DEGC = 1085.0
"""Melting point of copper [degC]: a simulation that passes it says nothing about a machine."""


def simulate_file(
    motor: Motor, source: str, path: Path, order: Order, folder: Path, seed: int
) -> dict[str, Any]:
    """Simulate the load of a test and write the virtual record as CSV.

    Args:
        motor: The machine.
        source: A run folder, or a TOML file with parameters by name.
        path: The test whose currents, losses and sink drive the model.
        order: First or second order.
        folder: Where `NAME_virtual.csv` goes.
        seed: Of the draws behind the bands, which a run gives: columns such as
            `winding_95_low_degC`, with the noise of a block mean.

    Returns:
        Name of the file, number of rows, the error to a measured winding where there is one, and
        why there are no bands where there are none.

    Raises:
        InputError: If parameters are missing, or the record lacks a channel.
    """
    values = parameters_from(Path(source), order)
    record = read_record(path, motor)
    require(record, ["phase_current_A", "losses_W", f"{motor.sink}_degC"])
    measured = record.channels.get("winding_degC")
    table = simulate_record(motor, values, record, order)
    lacking = "a TOML file of parameters says nothing of their uncertainty"
    if Path(source).is_dir():
        table, lacking = _with_bands(table, Path(source), record, motor, order, seed)
    target = folder / f"{record.name}_virtual.csv"
    with writable("the record", target), together(folder, "virtual") as files:
        text = table.to_csv(index=False, float_format="%.6g")
        write_whole(files.aside / target.name, text.encode())
    rmse = None
    if measured is not None and np.any(np.isfinite(measured)):
        virtual = np.interp(record.time_s, table["time_s"], table["winding_degC"])
        rmse = float(np.sqrt(np.nanmean((measured - virtual) ** 2)))
    return {
        "file": str(target),
        "num_rows": len(table),
        "rmse_K": rmse,
        "test": record.name,
        "no_bands": lacking,
    }


def _with_bands(
    table: pd.DataFrame, run: Path, record: Record, motor: Motor, order: Order, seed: int
) -> tuple[pd.DataFrame, str]:
    """Add 95 % limits of winding and stator after the draws of a run, or the reason for none.

    The limits are known by block; what is carried to the steps is their distance to the median,
    which moves slowly, also where the temperature does not.
    """
    from .reports.bench_tests.simulated import simulate_run

    try:
        found = simulate_run(run, _with_start(record, motor), motor, order=order, seed=seed)
    except InputError as error:
        return table, str(error)
    bands = {"winding": (found.median_degC, found.total_95_degC)}
    if "stator" in found.nodes_degC:
        bands["stator"] = (found.nodes_degC["stator"], found.nodes_95_degC["stator"])
    columns = {
        f"{node}_95_{side}_degC": table[f"{node}_degC"]
        + np.interp(table["time_s"], found.time_s, limit - median)
        for node, (median, limits) in bands.items()
        for side, limit in zip(("low", "high"), limits, strict=True)
    }
    return table.assign(**columns), ""


def simulate_record(
    motor: Motor, values: Mapping[str, float], record: Record, order: Order
) -> pd.DataFrame:
    """Return the virtual record: inputs, temperatures, loss split and heat flows by step.

    Args:
        motor: The machine.
        values: Parameters by name; the start is taken from the record's first readings, or from
            the sink where no winding was measured.
        record: Currents, losses and sink.
        order: First or second order.
    """
    blocks = reduce(_with_start(record, motor), motor)
    model = Model.of(order, motor)
    known = parameters(model, motor, [blocks]).by_test[0]
    full = {name: parameter.centre for name, parameter in known.items()}
    full |= {name: p.fixed for name, p in known.items() if p.fixed is not None}
    full |= {name: value for name, value in values.items() if name in full}
    physical = {n: jnp.asarray(v) for n, v in full.items()}
    try:
        trace = model.simulate(physical, blocks.inputs)
    except ValueError as error:
        raise InputError(
            str(error), where=record.name,
            remedy="Give a record at a higher rate, or look whether the units of the parameters "
            "are J/K and K/W.",
        ) from error  # fmt: skip
    _refuse_runaway(model, physical, blocks, trace)
    inside = np.asarray(trace.time[1:]) <= record.duration_s + 1e-9
    columns: dict[str, Any] = {"time_s": np.asarray(trace.time[1:]) + blocks.first_s}
    columns["phase_current_A"] = np.sqrt(np.asarray(blocks.inputs.current_squared))
    columns["losses_W"] = np.asarray(blocks.inputs.losses)
    columns[f"{motor.sink}_degC"] = np.asarray(blocks.inputs.ambient)
    if blocks.inputs.speed is not None:
        columns["speed_rpm"] = np.asarray(blocks.inputs.speed) * 30.0 / np.pi
    for node, T in trace.temperature.items():
        columns[f"{node}_degC"] = np.asarray(T[1:])
    columns["copper_loss_W"] = np.asarray(trace.copper_loss)
    columns["other_loss_W"] = np.asarray(trace.other_loss)
    for (start, end), flow in trace.flow.items():
        columns[f"flow_{start}_{end}_W"] = np.asarray(flow)
    return pd.DataFrame(columns)[inside].reset_index(drop=True)


def _with_start(record: Record, motor: Motor) -> Record:
    """A record whose sink stands in for a winding that was not measured, as start temperature."""
    if "winding_degC" in record:
        return record
    sink = record[f"{motor.sink}_degC"]
    return replace(record, channels={**record.channels, "winding_degC": sink})


def _refuse_runaway(
    model: Model, values: Mapping[str, jax.Array], blocks: Blocks, trace: Trace
) -> None:
    """Refuse a simulation that leaves the temperatures at which there is a machine.

    Raises:
        InputError: With whether the copper feeds itself.
    """
    hottest = np.max(np.stack([np.asarray(T) for T in trace.temperature.values()]), axis=0)
    is_beyond = ~(hottest < MELTING_DEGC)  # NaN too
    if not is_beyond.any():
        return
    first = int(np.argmax(is_beyond))
    squared = float(np.max(np.asarray(blocks.inputs.current_squared)))
    growth = growth_rate(model.network(values), model.losses(values), squared)
    reason = (
        f"At {np.sqrt(squared):.0f} A it runs away: the copper loss rises faster with the "
        "temperature than the heat that leaves."
        if growth > 0.0
        else "The losses are too large for these resistances."
    )
    raise InputError(
        f"the model passes {MELTING_DEGC:.0f} degC, where copper melts, after "
        f"{float(trace.time[first]):.0f} s. {reason}",
        where=blocks.name,
        remedy="Check the units of current (rms), losses (W) and parameters (J/K, K/W).",
    )


def parameters_from(source: Path, order: Order) -> dict[str, float]:
    """Return parameters by name from a run folder or a TOML file.

    Raises:
        InputError: If there is neither, or a parameter is missing or misnamed.
    """
    if source.is_dir():
        models = load_result(source).get("models")
        if not isinstance(models, dict):
            raise InputError(
                "the run's fit.json holds no models.", where=str(source),
                remedy="Calibrate again.",
            )  # fmt: skip
        if order not in models:
            raise InputError(
                f"the run holds no {order} order, only {', '.join(models)}.",
                where=str(source),
                remedy="Pass --model, or calibrate with --model both.",
            )
        try:
            return {n: float(e["value"]) for n, e in models[order]["parameters"].items()}
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"the run's fit.json does not hold parameters ({type(error).__name__}: {error}).",
                where=str(source),
                remedy="Calibrate again.",
            ) from error
    content = parse_toml(read_start(source, LARGEST_BYTES), str(source), "file of parameters")
    content = content.get("parameters", content)
    if not isinstance(content, dict):
        raise InputError(
            "expected a section [parameters].", where=str(source),
            remedy="Write lines such as Ceq_w = 666.75.",
        )  # fmt: skip
    needed = ("Ceq", "Req") if order == "first" else ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
    missing = [name for name in needed if name not in content]
    unknown = [name for name in content if name not in ALL_NAMES]
    if missing or unknown:
        what = [f"{', '.join(missing)} missing"] if missing else []
        what += [f"{', '.join(unknown)} unknown"] if unknown else []
        raise InputError(
            f"parameters of the {order} order: {'; '.join(what)}.",
            where=str(source),
            remedy=f"Give {', '.join(needed)} (J/K and K/W).",
        )
    bad = [n for n, v in content.items() if isinstance(v, bool) or not isinstance(v, int | float)]
    if bad:
        raise InputError(
            f"{', '.join(bad)}: expected a number.", where=str(source), remedy="Write 666.75."
        )
    known = {p.name for p in (*NETWORK["first"], *NETWORK["second"])} | {"Rs0"}
    for name, value in content.items():
        # compared before it becomes a float, which a number of 400 digits cannot
        if not abs(value) < LARGEST or (name in known and not value > 0):
            raise InputError(
                f"{name} = {value!s:.40}: expected a number"
                f"{' above 0' if name in known else ''} below {LARGEST:g}.",
                where=str(source),
                remedy="Write 666.75.",
            )
    return {name: float(value) for name, value in content.items()}
