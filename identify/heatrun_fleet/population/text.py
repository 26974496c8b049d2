"""A population in a few lines for the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from heatrun.io.printable import clean
from heatrun.io.quantities import printed_unit, rounded
from heatrun.reports.sheet.digits import signed
from heatrun.results.gap import ValueWithInterval

from ..results.population import PopulationNoise, PopulationParameter, PopulationResult
from .types import Written

MOST_NAMED = 10
"""Machines that are named with their reason on the terminal; all stand in the files."""

PARQUET_HINT = 'population.parquet needs pyarrow: pip install "heatrun[fleet]"'


def population_text(written: Written) -> str:
    """Return a population as plain text for the terminal.

    Args:
        written: The population, or why there is none.
    """
    if written.result is None:
        return f"{_named(written.type)}: no population. {written.refusal}"
    return "\n".join([*_lines(written.result), "", *_files(written.files)])


def _lines(result: PopulationResult) -> list[str]:
    out = f", {len(result.left_out)} left out" if result.left_out else ""
    lines = [f"{_named(result.type)}: {result.num_machines} machines{out}."]
    lines += [f"  left out {clean(each.name)}: {each.reason}"
              for each in result.left_out[:MOST_NAMED]]  # fmt: skip
    if len(result.left_out) > MOST_NAMED:
        lines.append(f"  and {len(result.left_out) - MOST_NAMED} more, all in the files.")
    lines += [f"  note: {note}" for note in result.notes]
    lines += _table(result.parameters)
    for label, covariate in result.covariate_columns.items():
        effects = ", ".join(
            f"{name} {change(each, name, result)}" for name, each in covariate.over_range.items()
        )
        over = f" from {covariate.first} to {covariate.last}" if covariate.first else ""
        against = f" against {covariate.reference}" if covariate.reference else ""
        lines.append(f"  {label}{against}{over}: {effects}")
    outliers = [machine for machine in result.machines if machine.is_outlier]
    for machine in outliers[:MOST_NAMED]:
        what = ", ".join(machine.different) or "no single parameter"
        lines.append(
            f"  does not fit: {clean(machine.name)} (probability "
            f"{machine.outlier_probability:.2f}; different: {what})"
        )
    if len(outliers) > MOST_NAMED:
        lines.append(f"  and {len(outliers) - MOST_NAMED} more that do not fit.")
    return lines + (_noise_lines(result.noise) if result.noise else [])


def _noise_lines(noise: PopulationNoise) -> list[str]:
    """Return noise and unmodelled heat over the machines."""
    lines = ["  noise, and heat that the network misses:", *_table(noise.parameters)]
    outliers = [machine for machine in noise.machines if machine.is_outlier]
    for machine in outliers[:MOST_NAMED]:
        what = ", ".join(machine.different) or "no single one"
        lines.append(
            f"  another noise: {clean(machine.name)} (probability "
            f"{machine.outlier_probability:.2f}; different: {what})"
        )
    if len(outliers) > MOST_NAMED:
        lines.append(f"  and {len(outliers) - MOST_NAMED} more with another noise.")
    return lines


def _table(parameters: Mapping[str, PopulationParameter]) -> list[str]:
    heads = ("median (95 %)", "spread (95 %)", "95 % of the machines (at 95 %)")
    rows = [("", *heads), *(_row(name, said) for name, said in parameters.items())]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return [
        "  "
        + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _row(name: str, said: PopulationParameter) -> tuple[str, str, str, str]:
    unit = printed_unit(said.unit)
    low, high = said.tolerance_95_95
    return (
        name,
        f"{_ranged(said.median)} {unit}".rstrip(),
        spread(said.spread, said.transform, said.unit),
        f"{rounded(low, 4)} … {rounded(high, 4)} {unit}".rstrip(),
    )


def spread(entry: ValueWithInterval, transform: str, unit: str) -> str:
    """Return a spread over machines as it is printed."""
    if transform == "linear":
        return f"{_ranged(entry, 3)} {printed_unit(unit)}".rstrip()
    low, high = entry.interval_95
    return f"{100 * entry.value:.1f} ({100 * low:.1f} … {100 * high:.1f}) %"


def change(entry: ValueWithInterval, name: str, result: PopulationResult) -> str:
    """Return what a covariate does to a parameter as it is printed."""
    parameter = result.parameters[name]
    if parameter.transform == "linear":
        return f"{_ranged(entry, 3)} {printed_unit(parameter.unit)}".rstrip()
    low, high = entry.interval_95
    said, low, high = (signed(100 * each, 1) for each in (entry.value, low, high))
    return f"{said} ({low} … {high}) %"


def _ranged(entry: ValueWithInterval, digits: int = 4) -> str:
    low, high = (rounded(end, digits) for end in entry.interval_95)
    return f"{rounded(entry.value, digits)} ({low} … {high})"


def _files(files: tuple[Path, ...]) -> list[str]:
    lines = [f"Folder: {files[0].parent}", *(f"  {path.name}" for path in files)]
    has_table = any(path.suffix == ".parquet" for path in files)
    return lines if has_table else [*lines, f"  {PARQUET_HINT}"]


def _named(type: str) -> str:
    return f"Type {clean(type)}" if type else "Machines without a type"
