"""The tests behind words of the command line: files, records, and folders of files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from heatrun.errors import InputError
from heatrun.io.own_files import is_run_folder, own_file_at
from heatrun.record.record import Record

from .bench_test_types import CARDS

ENDINGS = (
    *(".csv", ".txt", ".dat", ".tsv", ".asc", ".mat", ".parquet", ".mf4", ".mdf", ".tdms"),
    *(".xlsx", ".xlsm"),
)
"""Endings of bench files, alone or with `.gz`."""

NO_TESTS = (
    "readme",
    "license",
    "sheet.xlsx",
    "~$",
    *(card.stem.lower() for card in CARDS.values()),
)
"""Beginnings of names beside bench files that are none: notes, parameter sheets, locks of Excel,
and the reports themselves."""


@dataclass(frozen=True)
class ReportedTests:
    """What is to be reported on.

    Attributes:
        tests: Files and records in order.
        left_out: Files of folders that are taken for no bench files.
        own: Files and run folders that heatrun itself has written.
    """

    tests: tuple[Path | Record, ...]
    left_out: tuple[Path, ...]
    own: tuple[Path, ...] = ()


def tests_in(named: Sequence[Path | Record]) -> ReportedTests:
    """Return records and files as they are, and for each folder its bench files by name.

    Whether a file of a folder is one is told by its ending, and by its first line where it is one
    that heatrun has written; hidden files and folders are passed over, folders in it are entered,
    and run folders are not.

    Args:
        named: Files, folders or records.

    Raises:
        InputError: If a folder holds no bench file, or is a run.
    """
    tests: list[Path | Record] = []
    left_out: list[Path] = []
    own: list[Path] = []
    for each in named:
        if isinstance(each, Record) or not each.is_dir():
            tests.append(each)
            continue
        if is_run_folder(each):
            raise InputError(
                "Expected bench files, got a run folder of heatrun.",
                where=str(each),
                remedy="Name the bench file that the run was made from; a run goes behind --run.",
            )
        files, runs = _files(each)
        own_here = [path for path in files if is_bench_file(path) and own_file_at(path)]
        own += [*runs, *own_here]
        files = [path for path in files if path not in own_here]
        found = [path for path in files if is_bench_file(path)]
        if not found:
            only_own = " but what heatrun has written" if own_here or runs else ""
            raise InputError(
                f"Expected a folder of bench files, found none in it{only_own}.",
                where=str(each),
                remedy=f"Known endings are {', '.join(ENDINGS)}, also with .gz.",
            )
        tests += found
        left_out += [path for path in files if path not in found]
    return ReportedTests(tuple(tests), tuple(left_out), tuple(own))


def is_bench_file(path: Path) -> bool:
    """Return whether a file's name is that of a bench file."""
    name = path.name.lower()
    return name.removesuffix(".gz").endswith(ENDINGS) and not name.startswith(NO_TESTS)


def _files(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the files of a folder, and the run folders in it, which are not entered."""

    def refuse(error: OSError) -> None:
        raise InputError(
            f"The folder cannot be read ({error.strerror}).",
            where=str(error.filename or folder),
            remedy="Check its permissions.",
        ) from error

    files: list[Path] = []
    runs: list[Path] = []
    for at, folders, names in os.walk(folder, onerror=refuse):
        shown = sorted(name for name in folders if not name.startswith("."))
        folders[:] = [name for name in shown if not is_run_folder(Path(at) / name)]
        runs += [Path(at) / name for name in shown if name not in folders]
        files += [Path(at) / name for name in sorted(names) if not name.startswith(".")]
    return files, runs
