"""`heatrun population`: what the machines of a type have in common, and which do not fit."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatrun.commands import words
from heatrun.commands.console import DONE, NOT_ALLOWED, printable, say
from heatrun.errors import UsageError
from heatrun.io.quantities import aligned, clean

if TYPE_CHECKING:
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

HEADS = ("", "median (95 %)", "spread (95 %)", "95 % of the machines (at 95 %)")


def population_text(written: Written) -> str:
    """Return a population in the words of its sheet, or why there is none."""
    from .sheet import type_sheet_content  # slow to import

    named = f"Type {clean(written.type)}" if written.type else "Machines without a type"
    if written.result is None:
        return f"{named}: no population. {written.refusal}"
    files = [f"Folder: {written.files[0].parent}", *(f"  {path.name}" for path in written.files)]
    if not any(path.suffix == ".parquet" for path in written.files):
        files.append(f"  {PARQUET_HINT}")
    return "\n".join([*_lines(type_sheet_content(written.result), named), "", *files])


def _lines(said: Mapping[str, Any], named: str) -> list[str]:
    lines = [f"{named}: {said['sentence']}"]
    lines += _first(said["left_out"], said["more_left_out"], "left out {}: {}")
    lines += [f"  note: {note}" for note in said["notes"]]
    lines += _table(said["parameters"])
    lines += [f"  {what}: {changes}" for what, changes in said["covariates"]]
    outlier = "{} (probability {}; different: {})"
    lines += _first(said["outliers"], said["more_outliers"], f"does not fit: {outlier}")
    if said["noise"]:
        lines += ["  noise, and heat that the network misses:", *_table(said["noise"])]
        more = said["more_noise_outliers"]
        lines += _first(said["noise_outliers"], more, f"another noise: {outlier}")
    return lines


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    return aligned([HEADS, *(row[: len(HEADS)] for row in rows)], "  ")


def _first(rows: Sequence[Sequence[str]], more: int, form: str) -> list[str]:
    lines = [f"  {form.format(*row)}" for row in rows[:MOST_NAMED]]
    more += len(rows) - len(lines)
    return [*lines, f"  and {more} more, all in the files."] if more else lines
