"""Courses of a run as tables, one per test: measured, predicted, bands, Tsr and heat flows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ...inference.predict import Prediction


def band_table(predictions: Mapping[str, Prediction]) -> pd.DataFrame:
    """Return the courses of one test, a row per block.

    Args:
        predictions: By order, all of one test.

    Returns:
        Columns with units in their names; those of an order begin with `first_` or `second_`.
    """
    test = next(iter(predictions.values())).test
    rows = test.weight.shape

    def mean(values) -> np.ndarray:
        return np.asarray(values).reshape(rows).mean(axis=1)

    columns: dict[str, np.ndarray] = {
        "time_s": test.time + test.first_s,
        "measured_degC": test.measured,
        "phase_current_A": np.sqrt(mean(test.inputs.current_squared)),
        "losses_W": mean(test.inputs.losses),
        "sink_degC": mean(test.inputs.ambient),
    }
    if test.inputs.speed is not None:
        columns["speed_rpm"] = mean(test.inputs.speed) * 30.0 / np.pi
    for order, prediction in predictions.items():
        columns[f"{order}_winding_degC"] = prediction.median
        for level, (low, high) in prediction.parameters.items():
            columns[f"{order}_parameters_{level}_low_degC"] = low
            columns[f"{order}_parameters_{level}_high_degC"] = high
        for level, (low, high) in prediction.total.items():
            columns[f"{order}_total_{level}_low_degC"] = low
            columns[f"{order}_total_{level}_high_degC"] = high
        columns[f"{order}_residual_K"] = prediction.residual
        if "stator" in prediction.nodes:
            columns[f"{order}_stator_degC"] = prediction.nodes["stator"]
            low, high = prediction.nodes_95["stator"]
            columns[f"{order}_stator_95_low_degC"] = low
            columns[f"{order}_stator_95_high_degC"] = high
            columns["P_ws_W"] = prediction.flows["winding", "stator"]
            columns["P_se_W"] = prediction.flows["stator", "ambient"]
    return pd.DataFrame(columns)
