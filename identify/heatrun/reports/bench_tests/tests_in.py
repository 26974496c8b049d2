"""The tests behind words of the command line: files, records, and folders of files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...bench.record import Record
from ...errors import InputError
from .card import CARDS

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
    """

    tests: tuple[Path | Record, ...]
    left_out: tuple[Path, ...]


def tests_in(named: Sequence[Path | Record]) -> ReportedTests:
    """Return records and files as they are, and for each folder its bench files by name.

    Whether a file of a folder is one is told by its ending; hidden files and folders are passed
    over, folders in it are entered.

    Args:
        named: Files, folders or records.

    Raises:
        InputError: If a folder holds no bench file.
    """
    tests: list[Path | Record] = []
    left_out: list[Path] = []
    for each in named:
        if isinstance(each, Record) or not each.is_dir():
            tests.append(each)
            continue
        files = _files(each)
        found = [path for path in files if is_bench_file(path)]
        if not found:
            raise InputError(
                "Expected a folder of bench files, found none in it.",
                where=str(each),
                remedy=f"Known endings are {', '.join(ENDINGS)}, also with .gz.",
            )
        tests += found
        left_out += [path for path in files if path not in found]
    return ReportedTests(tuple(tests), tuple(left_out))


def is_bench_file(path: Path) -> bool:
    """Return whether a file's name is that of a bench file."""
    name = path.name.lower()
    return name.removesuffix(".gz").endswith(ENDINGS) and not name.startswith(NO_TESTS)


def _files(folder: Path) -> list[Path]:
    def refuse(error: OSError) -> None:
        raise InputError(
            f"The folder cannot be read ({error.strerror}).",
            where=str(error.filename or folder),
            remedy="Check its permissions.",
        ) from error

    files = []
    for at, folders, names in os.walk(folder, onerror=refuse):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        files += [Path(at) / name for name in sorted(names) if not name.startswith(".")]
    return files
