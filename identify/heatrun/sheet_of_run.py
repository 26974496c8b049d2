"""From a calibration, or a run folder, to what the parameter sheet is made of."""

from __future__ import annotations

from pathlib import Path


def write_sheet_of(found, folder: Path) -> list[Path]:
    return []


def rewrite_sheet(run: Path, folder: Path) -> list[Path]:
    return []
