"""What a fleet's folder says in a few lines: how many machines, which not and why, and the types.

Medians and quantiles here are of the machines' values as they are; they hold the uncertainty of
each machine as well as the spread of the type.
"""

from __future__ import annotations

import json
from collections import defaultdict
from typing import Any

import numpy as np

from heatrun.io.quantities import printed_unit, rounded

from .job import FleetResult
from .rows import FITTED

MOST_NAMED = 10
"""Machines that are named with their reason on the terminal; all stand in the file."""

COLUMNS = ("machine", "type", "status", "findings", "result", "parameters", "parameter_units",
           "parameter_values",
           "is_converged")  # fmt: skip


def summary(result: FleetResult) -> dict[str, Any]:
    """Return the object that `heatrun fleet --json` prints.

    Args:
        result: The fleet.
    """
    from pyarrow.parquet import ParquetFile

    with ParquetFile(result.machines_path) as file:
        rows = file.read(columns=list(COLUMNS)).to_pylist()
    said = result.manifest
    apart = [
        {
            "machine": row["machine"],
            "status": row["status"],
            "result": row["result"],
            "findings": json.loads(row["findings"]),
        }
        for row in rows
        if row["status"] != FITTED
    ]
    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    units: dict[str, str] = {}
    for row in rows:
        if row["status"] == FITTED:
            units |= dict(zip(row["parameters"], row["parameter_units"], strict=True))
            for name, value in zip(row["parameters"], row["parameter_values"], strict=True):
                values[row["type"]][name].append(value)
    types = {
        type: {name: _spread(each, units[name]) for name, each in parameters.items()}
        for type, parameters in values.items()
    }
    return {
        "format": said["format"],
        "fleet": said["fleet"],
        "model": said["model"],
        "machines": said["machines"],
        "not_converged": [row["machine"] for row in rows
                          if row["status"] == FITTED and not row["is_converged"]],
        "apart": apart,
        "types": types,
        "run": str(result.path),
    }  # fmt: skip


def summary_text(found: dict[str, Any]) -> str:
    """Return a summary as plain text for the terminal.

    Args:
        found: From `summary`.
    """
    machines = found["machines"]
    lines = [
        f"{found['fleet']}: {machines.get(FITTED, 0)} of {machines['all']} machines fitted "
        f"(network: {found['model']})."
    ]
    if found["not_converged"]:
        lines.append(f"Not converged: {', '.join(found['not_converged'][:MOST_NAMED])}"
                     f"{_more(found['not_converged'])}.")  # fmt: skip
    for each in found["apart"][:MOST_NAMED]:
        errors = [f for f in each["findings"] if f["severity"] == "error"]
        why = errors[0] if errors else {"message": each["result"], "where": "", "id": "failed"}
        head = f"{why['where']}: " if why["where"] else ""
        lines.append(
            f"{each['status']:<8} {each['machine']}: {head}{why['message']}  ({why['id']})"
        )
    if len(found["apart"]) > MOST_NAMED:
        lines.append(f"         and {len(found['apart']) - MOST_NAMED} more, all in the file.")
    for type, parameters in found["types"].items():
        lines.append(f"\n{'Type ' + type if type else 'All machines'}: median, and 90 % of the "
                     "machines between")  # fmt: skip
        for name, each in parameters.items():
            low, high = each["interval_90"]
            lines.append(f"  {name:<16} {rounded(each['median'], 4):>10}   {rounded(low, 4)} … "
                         f"{rounded(high, 4)} {printed_unit(each['unit'])}".rstrip())  # fmt: skip
    return "\n".join(lines)


def _spread(values: list[float], unit: str) -> dict[str, Any]:
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    return {"median": float(middle), "interval_90": [float(low), float(high)], "unit": unit,
            "num_machines": len(values)}  # fmt: skip


def _more(names: list[str]) -> str:
    return f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
