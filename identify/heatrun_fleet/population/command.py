"""`heatrun population`: what the machines of a type have in common, and which do not fit."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatrun.commands import words
from heatrun.commands.console import DONE, NOT_ALLOWED, printable, say
from heatrun.errors import UsageError
from heatrun.io.quantities import aligned, clean, printed_unit, rounded

if TYPE_CHECKING:
    from heatrun.results.discovery import ValueWithInterval

    from ..results import PopulationMachine, PopulationParameter, PopulationResult
    from .job import Written


def add_parser(commands: Any) -> argparse.ArgumentParser:
    """Add the command's words to the subparsers `commands`."""
    parser = commands.add_parser(
        "population", help="what the machines of a type have in common, and which do not fit"
    )
    parser.add_argument(
        "source",
        nargs="+",
        type=Path,
        metavar="FLEET_FOLDER|RUN",
        help="the folder that `heatrun fleet` wrote (or its machines.parquet), or a run folder for "
        "each of three machines or more",
    )
    parser.add_argument(
        "--type",
        default=None,
        metavar="TYPE",
        help="type of the machines, where a fleet has several (default: all of them, each in a "
        "folder of its own); of runs, its name for the record",
    )
    parser.add_argument(
        "--covariate",
        action="append",
        default=[],
        metavar="NAME",
        help="column of the fleet file that may shift the parameters, such as supplier or date: "
        "numbers as they are, dates (2026-03-31) in years, other texts as categories; may be given "
        "again",
    )
    words.add(
        parser, "--out: folder of the population, which [population] run of a motor file takes "
        "(default: results/populations/TYPE)", "--force", "--seed", "--json",
    )  # fmt: skip
    return parser


def run(options: argparse.Namespace) -> int:
    """Work out the populations, write their folders and print them."""
    from heatrun.results import to_json

    from .of_fleet import is_fleet

    if len(options.source) == 1 and is_fleet(options.source[0]):
        written = _of_fleet(options)
    else:
        written = [_of_runs(options)]
    if options.json:
        print(to_json({"populations": [each.described() for each in written]}))
    else:
        print(printable("\n\n".join(map(population_text, written))))
    return DONE if any(each.result is not None for each in written) else NOT_ALLOWED


def _of_fleet(options: argparse.Namespace) -> list[Written]:
    from .job import populations_of_fleet
    from .of_fleet import read_fleet

    fleet = read_fleet(options.source[0])
    num, types = sum(fleet.types.values()), list(fleet.types)
    if options.type is not None:
        types = [options.type]
        say(f"{num} machines in {fleet.path}; those of type {options.type} are taken")
    else:
        say(f"{num} machines{f' of {len(types)} types' if len(types) > 1 else ''} in {fleet.path}")
    return populations_of_fleet(fleet, types, options.out, options.covariate, seed=options.seed,
                                is_replacing=options.force)  # fmt: skip


def _of_runs(options: argparse.Namespace) -> Written:
    from heatrun.runs.run_folder import refuse_unwritable

    from .job import Written, default_folder, population, write_population

    if options.covariate:
        raise UsageError(
            "--covariate names columns of a fleet file; of runs, heatrun.population takes values"
        )
    name = options.type or ""
    out = options.out or default_folder(name)
    refuse_unwritable(out)
    source = options.source if len(options.source) > 1 else options.source[0]
    found = population(source, type_name=name, seed=options.seed).result
    files = write_population(out, found, is_named=options.out is not None,
                             is_replacing=options.force)  # fmt: skip
    return Written(name, found, files)


MOST_NAMED = 10
"""Machines that are named with their reason on the terminal; all stand in the files."""

PARQUET_HINT = 'population.parquet needs pyarrow: pip install "heatrun[fleet]"'


def population_text(written: Written) -> str:
    """Return a population, or why there is none."""
    named = f"Type {clean(written.type)}" if written.type else "Machines without a type"
    if written.result is None:
        return f"{named}: no population. {written.refusal}"
    lines = [f"Folder: {written.files[0].parent}", *(f"  {path.name}" for path in written.files)]
    if not any(path.suffix == ".parquet" for path in written.files):
        lines.append(f"  {PARQUET_HINT}")
    return "\n".join([*_lines(written.result, named), "", *lines])


def _lines(result: PopulationResult, named: str) -> list[str]:
    out = f", {len(result.left_out)} left out" if result.left_out else ""
    lines = [f"{named}: {result.num_machines} machines{out}."]
    lines += [f"  left out {clean(each.name)}: {each.reason}"
              for each in result.left_out[:MOST_NAMED]]  # fmt: skip
    if len(result.left_out) > MOST_NAMED:
        lines.append(f"  and {len(result.left_out) - MOST_NAMED} more, all in the files.")
    lines += [f"  note: {note}" for note in result.notes]
    lines += _table(result.parameters)
    for label, covariate in result.covariate_columns.items():
        effects = ", ".join(
            f"{name} {_change(each, result.parameters[name])}"
            for name, each in covariate.over_range.items()
        )
        over = f" from {covariate.first} to {covariate.last}" if covariate.first else ""
        against = f" against {covariate.reference}" if covariate.reference else ""
        lines.append(f"  {label}{against}{over}: {effects}")
    lines += _outliers(result.machines, "does not fit", "parameter", "that do not fit")
    if result.noise:
        lines += ["  noise, and heat that the network misses:", *_table(result.noise.parameters)]
        lines += _outliers(result.noise.machines, "another noise", "one", "with another noise")
    return lines


def _outliers(
    machines: Sequence[PopulationMachine], verdict: str, single: str, more: str
) -> list[str]:
    outliers = [machine for machine in machines if machine.is_outlier]
    lines = [
        f"  {verdict}: {clean(machine.name)} (probability {machine.outlier_probability:.2f}; "
        f"different: {', '.join(machine.different) or f'no single {single}'})"
        for machine in outliers[:MOST_NAMED]
    ]
    if len(outliers) > MOST_NAMED:
        lines.append(f"  and {len(outliers) - MOST_NAMED} more {more}.")
    return lines


def _table(parameters: Mapping[str, PopulationParameter]) -> list[str]:
    heads = ("", "median (95 %)", "spread (95 %)", "95 % of the machines (at 95 %)")
    return aligned([heads, *(_row(name, said) for name, said in parameters.items())], "  ")


def _row(name: str, said: PopulationParameter) -> tuple[str, str, str, str]:
    unit = printed_unit(said.unit)
    low, high = said.tolerance_95_95
    limits = f"{rounded(low, 4)} … {rounded(high, 4)} {unit}".rstrip()
    if said.transform == "linear":
        spread = f"{_ranged(said.spread, 3)} {unit}".rstrip()
    else:
        value, *ends = (100 * each for each in (said.spread.value, *said.spread.interval_95))
        spread = f"{value:.1f} ({ends[0]:.1f} … {ends[1]:.1f}) %"
    return (
        name,
        f"{_ranged(said.median)} {unit}".rstrip(),
        spread,
        limits if said.tells((low, high)) else "not determined",
    )


def _change(entry: ValueWithInterval, parameter: PopulationParameter) -> str:
    """Return what a covariate does to a parameter."""
    from heatrun.reports.printed import signed

    if parameter.transform == "linear":
        return f"{_ranged(entry, 3)} {printed_unit(parameter.unit)}".rstrip()
    said, low, high = (signed(100 * each, 1) for each in (entry.value, *entry.interval_95))
    return f"{said} ({low} … {high}) %"


def _ranged(entry: ValueWithInterval, digits: int = 4) -> str:
    low, high = (rounded(end, digits) for end in entry.interval_95)
    return f"{rounded(entry.value, digits)} ({low} … {high})"
