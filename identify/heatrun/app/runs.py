"""Run folders that the page can show: their results, bands and files."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import pandas as pd

from ..errors import InputError
from ..run_folder import MANIFEST, load_result
from .folder import Stamp
from .plots import Band
from .store import Opened

DOWNLOADS = ("sheet.pdf", "sheet.xlsx", "sheet.json", "fit.json", "discovery.pdf", "discovery.json")
"""Files of a run that the page hands out."""


@dataclass(frozen=True)
class Run:
    """A whole run folder."""

    path: Path

    @property
    def discovery(self) -> dict[str, Any] | None:
        """What `heatrun discover` found, or None."""
        return _discovery(self.path, self.stamp)

    @property
    def calibration(self) -> dict[str, Any] | None:
        """What `heatrun calibrate` found, or None."""
        return _calibration(self.path, self.stamp)

    @property
    def stamp(self) -> Stamp:
        """State of the run's manifest: another one means another run under the same name."""
        return Stamp.of(self.path / MANIFEST)

    def figures(self) -> list[Path]:
        """Return the figures, those of the discovery first."""
        folders = [self.path / "discovery", self.path / "figures"]
        return [file for folder in folders for file in sorted(folder.glob("*.png"))]

    def downloads(self) -> list[Path]:
        """Return the files that the page hands out."""
        courses = sorted(self.path.glob("course_*.csv"))
        named = [self.path / name for name in DOWNLOADS]
        return [path for path in named if path.is_file()] + courses

    def bands(self, tests: Sequence[Opened]) -> list[Band]:
        """Return the predicted courses of those tests that the run has seen.

        A test is the same if its file's digest is; the second order counts where both are there.
        """
        result = self.calibration
        if result is None:
            return []
        found = []
        for number, entry in enumerate(result["tests"], start=1):
            for opened in tests:
                if entry["sha256"] == opened.record.sources[0].sha256:
                    band = self._band(number, opened.record.name)
                    found += [band] if band else []
        return found

    def _band(self, number: int, test: str) -> Band | None:
        file = self.path / f"course_{number}.csv"
        try:
            course = pd.read_csv(file)
        except (OSError, ValueError):
            return None
        order = "second" if "second_winding_degC" in course else "first"
        columns = [f"{order}_winding_degC", f"{order}_total_95_low_degC",
                   f"{order}_total_95_high_degC"]  # fmt: skip
        if "time_s" not in course or any(name not in course for name in columns):
            return None
        median, low, high = (course[name].to_numpy(float) for name in columns)
        label = f"simulated, 95 % ({order}) · {test}"
        return Band(label, course["time_s"].to_numpy(float), median, low, high)


def runs_under(folders: Sequence[Path]) -> list[Run]:
    """Return the run folders directly in some folders, the youngest first."""
    found = {
        path.parent.resolve()
        for folder in folders
        if folder.is_dir()
        for path in folder.glob(f"*/{MANIFEST}")
    }
    return sorted(map(Run, found), key=lambda run: run.stamp.changed_ns, reverse=True)


@lru_cache(maxsize=256)
def _calibration(path: Path, stamp: Stamp) -> dict[str, Any] | None:
    """Return `fit.json`, checked and parsed once for as long as the manifest stays."""
    try:
        return load_result(path)
    except InputError:
        return None


@lru_cache(maxsize=256)
def _discovery(path: Path, stamp: Stamp) -> dict[str, Any] | None:
    return _json(path / "discovery.json")


def _json(file: Path) -> dict[str, Any] | None:
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
