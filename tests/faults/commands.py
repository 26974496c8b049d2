"""The commands that the campaign disturbs: their inputs, words, destination and phases."""

import gzip
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

DATA = Path(__file__).parents[2] / "data" / "synthetic"
DISK = "disk"
"""Folder of the home where all results go; a small disk of its own where disks are to be full."""

OUT, RUN = f"{DISK}/out", f"{DISK}/run"
DUTY = "duty_2024_01_02_001.csv"
TEST, ROAD = "Test_2024_03_05_001.csv", "Road_2024_03_05_001.csv"
RECORDED = 1_700_000_000.0
"""Time of the last change of the inputs: one of them may give a report its date."""

FITTED = {"fitting": "least squares", "sampling": "sampling the posterior",
          "writing": "writing the "}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A command with all that is given to it."""

    command: str  # As it is counted.
    words: tuple[str, ...]  # After `heatrun`, for the home as working folder.
    target: int  # Signals that are to strike it in a campaign of 1000.
    place: str = OUT  # Where its result is, relative to the home.
    # What it says on stderr when a phase after the first begins. A command that says nothing is in
    # its last phase from its first file operation on.
    phases: Mapping[str, str] = field(default_factory=dict)
    variant: str = ""  # What tells it from others of the same command.

    @property
    def name(self) -> str:
        """What it is called in the tally."""
        return f"{self.command} {self.variant}".strip()


def _report(kind: str, target: int, motor: str, test: str, *more: str) -> Case:
    words = ("report", "--type", kind, motor, test, *more, "--out", OUT)
    return Case("report", words, target, variant=kind)


def _fit(command: str, target: int, *more: str, variant: str) -> Case:
    words = (command, "motor.toml", DUTY, *more, "--out", OUT)
    return Case(command, words, target, phases=FITTED, variant=variant)


CASES = (
    Case("check", ("check", "motor.toml", DUTY, "--json"), 70),
    _fit("calibrate", 60, "--quick", variant="quick"),
    _fit("calibrate", 60, variant="emcee"),
    _fit("compare", 50, "--quick", variant="quick"),
    _fit("discover", 75, "--quick", "--model", "first", variant="quick"),
    Case("demo", ("demo", "--quick", "--out", OUT), 12, phases=FITTED),
    Case("simulate", ("simulate", "motor.toml", RUN, DUTY, "--out", OUT), 110),
    _report("general", 70, "motor.toml", DUTY),
    _report("thermal", 50, "motor.toml", DUTY, "--run", RUN),
    _report("energy", 50, "prototype.toml", TEST),
    _report("virtual", 40, "motor.toml", DUTY, "--run", RUN),
    _report("real", 50, "prototype.toml", TEST, "--reference", ROAD),
    Case("sheet", ("sheet", RUN, "--out", OUT), 70, variant="to a folder"),
    Case("sheet", ("sheet", RUN), 60, RUN, variant="in place"),
    Case("export", ("export", RUN, "--to", "mat", "--out", OUT), 60, variant="to a folder"),
    Case("export", ("export", RUN, "--to", "mat"), 40, RUN, variant="in place"),
)

PAGE = (
    Case("page", ("calibrate", "bench/motor.toml", f"bench/{DUTY}", "--model", "both", "--out",
                  OUT, "--quick"), 50, phases=FITTED, variant="calibration"),
    Case("page", ("discover", "bench/motor.toml", f"bench/{DUTY}", "--model", "first", "--out",
                  OUT, "--quick"), 25, phases=FITTED, variant="discovery"),
    Case("page", ("report", "--type", "general", "bench/motor.toml", f"bench/{DUTY}", "--out",
                  OUT), 45, variant="report"),
)  # fmt: skip
"""What the buttons of `heatrun view` start; the server itself is struck as well."""


def write_inputs(folder: Path) -> None:
    """Write motors and short records: 30 minutes at 0.1 Hz, 18 minutes at 0.2 Hz."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(DATA / "motor.toml", folder / "motor.toml")
    shutil.copy(DATA / "prototypes" / "motor.toml", folder / "prototype.toml")
    _thin(DATA / "duty_30min.csv.gz", folder / DUTY, 100)
    _thin(DATA / "prototypes" / f"{TEST}.gz", folder / TEST, 25)
    _thin(DATA / "prototypes" / f"{ROAD}.gz", folder / ROAD, 5)
    (folder / "bench").mkdir(exist_ok=True)
    for name in ("motor.toml", DUTY):
        shutil.copy(folder / name, folder / "bench" / name)
    (folder / DISK).mkdir(exist_ok=True)
    for path in folder.rglob("*"):
        os.utime(path, (RECORDED, RECORDED))


def _thin(source: Path, path: Path, step: int) -> None:
    with gzip.open(source, "rt") as file:
        lines = file.read().splitlines()
    path.write_text("\n".join([lines[0], *lines[1::step]]) + "\n")


def fresh(home: Path, base: Path) -> None:
    """Make the home what it was before anything ran in it; the same paths each time."""
    shutil.rmtree(home, ignore_errors=True)
    shutil.copytree(base, home)  # keeps the times of the files
