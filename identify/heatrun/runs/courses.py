"""Courses of a run as tables, one per test: measured, predicted, bands, Tsr and heat flows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ..posterior.predict import Prediction

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
