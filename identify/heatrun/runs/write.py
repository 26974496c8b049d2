"""What a run folder holds beside its reports: result, models, draws, motor, courses.

The motor file is TOML again, so that a run folder stands for itself. Of `[tests.NAME]` it
keeps the columns and the load in gaps: a run knows the parts of its tests by itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from ..io.whole_files import write_whole
from ..posterior.posterior import Posterior
from ..posterior.predict import Prediction
from ..record.findings import OUTPUT_FAILED, Attempts
from ..record.motor import Adequacy, Motor, PartsOfTest, ShutDown
from ..results import FitResult, from_json, to_json
from . import netcdf
from .netcdf import densities as densities_of
from .run import MOTOR, ModelOfRun, Run, course_name, draws_name, model_name, model_text
from .run_folder import RunFolder
from .verdict import judged


def write_run(
    folder: RunFolder,
    motor: Motor,
    result: FitResult,
    posteriors: Mapping[str, Posterior],
    predictions: Mapping[str, Sequence[Prediction]],
) -> Run:
    """Write everything that `heatrun.open_run` reads into an unfinished run folder.

    Returns:
        The run as it is in its unfinished folder.

    Raises:
        OSError: If a file cannot be written.
    """
    attempts = Attempts(OUTPUT_FAILED)
    write_whole(folder.partial / MOTOR, motor_text(motor))
    for name, posterior in posteriors.items():
        problem = posterior.fit.problem
        found = ModelOfRun(problem.model, problem.parameters)
        write_whole(folder.partial / model_name(name), model_text(found))
        path = folder.partial / draws_name(name)
        # a quick run is for a look
        densities = None
        if posterior.method == "emcee":
            densities = attempts.of(
                "the pointwise log likelihood", partial(densities_of, posterior), None, where=name
            )
        netcdf.write(posterior, path, densities)
    for index in range(len(result.tests)):
        table = band_table({name: rows[index] for name, rows in predictions.items()})
        text = table.to_csv(index=False)  # to all digits
        write_whole(folder.partial / course_name(index + 1), text.encode())
    result = judged(replace(result, findings=(*result.findings, *attempts.findings)))
    folder.write_json("fit.json", result)
    # as it will be read, so that a sheet made now and one made later are the same
    read_back = from_json(to_json(result).encode(), FitResult, "fit.json", str(folder.path))
    return Run(folder.partial, read_back, is_finished=False)


FLOWS = {("winding", "stator"): "P_ws_W", ("stator", "ambient"): "P_se_W"}
"""Columns of the heat flows that have a symbol, by link."""


def band_table(predictions: Mapping[str, Prediction]) -> pd.DataFrame:
    """Return the courses of one test, a row per block.

    Args:
        predictions: By name of the network, all of one test.

    Returns:
        Columns with units in their names; those of a network begin with its
        name, such as `second_`.
    """
    test = next(iter(predictions.values())).test
    rows = test.weight.shape

    def mean(values) -> np.ndarray:
        return np.asarray(values).reshape(rows).mean(axis=1)

    columns: dict[str, np.ndarray] = {
        "time_s": test.time + test.first_s,
        "measured_degC": test.measured,
        "phase_current_A": np.sqrt(mean(test.inputs.current_squared))
        if test.has_current
        else np.full(test.time.shape, np.nan),
        "losses_W": mean(test.inputs.losses),
        "sink_degC": mean(test.inputs.ambient),
    }
    forms = [prediction.model.form for prediction in predictions.values()]
    if test.inputs.second_sink is not None and any(form.second_sink for form in forms):
        columns["second_sink_degC"] = mean(test.inputs.second_sink)
    if test.inputs.speed is not None:
        columns["speed_rpm"] = mean(test.inputs.speed) * 30.0 / np.pi
    for body in test.bodies:
        columns[f"measured_{body.channel}"] = body.measured
    for network, prediction in predictions.items():
        columns[f"{network}_winding_degC"] = prediction.median
        for level, (low, high) in prediction.parameters.items():
            columns[f"{network}_parameters_{level}_low_degC"] = low
            columns[f"{network}_parameters_{level}_high_degC"] = high
        for level, (low, high) in prediction.total.items():
            columns[f"{network}_total_{level}_low_degC"] = low
            columns[f"{network}_total_{level}_high_degC"] = high
        columns[f"{network}_residual_K"] = prediction.residual
        for node in _unmeasured(prediction):
            columns[f"{network}_{node}_degC"] = prediction.nodes[node]
            low, high = prediction.nodes_95[node]
            columns[f"{network}_{node}_95_low_degC"] = low
            columns[f"{network}_{node}_95_high_degC"] = high
        if len(prediction.nodes) > 1:
            for link, flow in prediction.flows.items():
                columns[FLOWS.get(link, f"flow_{link[0]}_{link[1]}_W")] = flow
    return pd.DataFrame(columns)


def _unmeasured(prediction: Prediction) -> list[str]:
    """Return the nodes beside the one that is measured, in the order of the network."""
    measured = prediction.model.form.measured_node
    own = [node for node in prediction.model.form.nodes if node in prediction.nodes]
    added = [node for node in prediction.nodes if node not in own]
    return [node for node in (*own, *added) if node != measured]


OF_MOTOR = ("name", "phases", "losses", "sink", "insulation_class", "equilibrium",
            "rated_speed_rpm", "rated_current_A", "mass_kg", "raster_s", "decimal")  # fmt: skip
OF_WINDING = ("resistance_coefficient_degC", "phase_resistance_ohm", "reference_temperature_degC",
              "measured_resistance_ohm", "lead_resistance_ohm", "conductor_mass_kg")  # fmt: skip
OF_VEHICLE = ("gear_ratio", "wheel_radius_m")


def motor_text(motor: Motor) -> bytes:
    """Return a motor file that reads back to the same machine."""
    import tomli_w

    content: dict[str, Any] = {}
    for section, keys in (("motor", OF_MOTOR), ("winding", OF_WINDING), ("vehicle", OF_VEHICLE)):
        values = {key: getattr(motor, key) for key in keys}
        content[section] = {key: value for key, value in values.items() if value is not None}
    content["model"] = {"effects": list(motor.effects)} if motor.effects else {}
    if motor.adequacy != Adequacy():
        content["adequacy"] = asdict(motor.adequacy)
    if motor.shutdown != ShutDown():
        said = asdict(motor.shutdown)
        content["shutdown"] = {key: value for key, value in said.items() if value is not None}
    scales = {key: value for key, value in asdict(motor.scales).items() if value is not None}
    content["scales"] = scales
    content["columns"] = dict(motor.columns)
    content["constants"] = dict(motor.constants)
    content["tests"] = {name: kept for name, parts in motor.tests.items() if (kept := _kept(parts))}
    content["sensors"] = dict(motor.sensors)
    content["parameters"] = {
        name: {key: value for key, value in asdict(said).items() if value is not None}
        for name, said in motor.parameters.items()
    }
    content["certificate"] = motor.certificate.as_section()
    return tomli_w.dumps({key: value for key, value in content.items() if value}).encode()


def _kept(parts: PartsOfTest) -> dict[str, Any]:
    gap = {} if parts.gap_load is None else {"gap": {"load": parts.gap_load}}
    return gap | ({"columns": dict(parts.columns)} if parts.columns else {})
