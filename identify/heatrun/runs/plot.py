"""The figure of a run: measured and predicted courses with their bands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd


def plot_courses(
    tests: Sequence[tuple[str, str]], courses: Sequence[pd.DataFrame], network: str
) -> Any:
    """Return a matplotlib figure with one axis for each test.

    Args:
        tests: Name and role of each test.
        courses: Their courses as a run holds them.
        network: Whose prediction is drawn.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 2.6 * len(tests)), layout="constrained")
    axes = figure.subplots(len(tests), 1, squeeze=False)[:, 0]
    for axis, (name, role), table in zip(axes, tests, courses, strict=True):
        minutes = table["time_s"] / 60.0
        columns = [f"{network}_{part}_degC" for part in ("winding", "total_95_low",
                                                         "total_95_high")]  # fmt: skip
        median, low, high = (table[column] for column in columns)
        axis.fill_between(minutes, low, high, alpha=0.25, label="95 % with noise")
        axis.plot(minutes, table["measured_degC"], "k.", ms=2, label="measured")
        axis.plot(minutes, median, lw=1.2, label=f"{network} network")
        axis.set_title(f"{name} ({role})", fontsize=9)
        axis.set_ylabel("winding [°C]")
    axes[0].legend(fontsize=8)
    axes[-1].set_xlabel("time [min]")
    return figure
