"""Make the bundled records again: `python data/synthetic/generate.py`.

Writes the records and their truth, and prints the checksums that README.md states.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from generator import (
    Instruments,
    Profile,
    Room,
    Truth,
    constant_load,
    duty,
    measure,
    reference_motor,
    simulate,
)
from numpy.typing import NDArray

DECIMALS = {"Is": 3, "Pd": 3, "Te": 1, "Tw_m": 0, "speed_rpm": 0}
TRUTH_EVERY_S = 60  # enough to check a fit by eye; the generator gives all of it

# A single-precision clock that ran for two seconds before the test. The fraction puts its stamps
# where those of the published worksheet lie: 0.100000143, 0.200000048, 0.300000191, ...
CLOCK_START_S = 2.0000001


def exact_clock(time_s: NDArray[np.float64]) -> list[str]:
    """Return time stamps [s] with one decimal."""
    return [f"{time:.1f}" for time in time_s]


def single_precision_clock(time_s: NDArray[np.float64]) -> list[str]:
    """Return time stamps [s] of a logger that subtracts two single-precision clock readings."""
    readings = (CLOCK_START_S + time_s).astype(np.float32).astype(np.float64)
    return [f"{time:.9f}".rstrip("0").rstrip(".") for time in readings - readings[0]]


@dataclass(frozen=True)
class Recipe:
    """How one record is made.

    Attributes:
        profile: Load, in parts of the rated torque and speed.
        seed: Of the instruments' noise.
        says: One phrase on the load, for the truth file.
        clock: Turns times [s] into time stamps.
        separator: Between columns.
        decimal: Decimal sign.
    """

    profile: Profile
    seed: int
    says: str
    clock: Callable[[NDArray[np.float64]], list[str]] = exact_clock
    separator: str = ","
    decimal: str = "."


RECIPES = {
    "step_30min": Recipe(
        constant_load(1800.0, torque=0.63, speed=0.67), 101, "105 A at 4020 rpm from t = 60 s"
    ),
    "step_90min": Recipe(
        constant_load(5400.0, torque=0.53, speed=0.75),
        102,
        "92 A at 4500 rpm from t = 60 s",
        clock=single_precision_clock,
    ),
    "duty_30min": Recipe(
        duty(1800.0), 103, "staircase, pulses and cool-downs", separator=";", decimal=","
    ),
    "duty_90min": Recipe(duty(5400.0), 104, "staircase, pulses and cool-downs"),
}


def table(columns: dict[str, NDArray[np.float64]], recipe: Recipe) -> str:
    """Return the text of a record.

    Args:
        columns: As `generator.measure` returns them.
        recipe: Clock, separator and decimal sign.

    Returns:
        A head line and one line per sample.
    """
    # Adding zero turns the -0.0 of a rounded small negative number into 0.0.
    cells = [recipe.clock(columns["t"])] + [
        [f"{value:.{decimals}f}" for value in np.round(columns[name], decimals) + 0.0]
        for name, decimals in DECIMALS.items()
    ]
    head = recipe.separator.join(["t", *DECIMALS])
    rows = (
        recipe.separator.join(row).replace(".", recipe.decimal) for row in zip(*cells, strict=True)
    )
    return "\n".join([head, *rows, ""])


def truth_of(truth: Truth, recipe: Recipe) -> dict[str, object]:
    """Return what is known of a record, for the truth file: temperatures [degC] at some times."""
    each = slice(None, None, round(TRUTH_EVERY_S / (truth.time_s[1] - truth.time_s[0])))
    return {
        "load": recipe.says,
        "seed": recipe.seed,
        "time_s": np.round(truth.time_s[each]).astype(int).tolist(),
        "winding_degC": np.round(truth.winding_degC[each], 4).tolist(),
        "stator_degC": np.round(truth.stator_degC[each], 4).tolist(),
    }


def write_compressed(text: str, path: Path) -> None:
    """Write text with gzip, without the time and name that would make each run's bytes differ."""
    with path.open("wb") as raw, gzip.GzipFile("", "wb", 9, raw, mtime=0) as packed:
        packed.write(text.encode("ascii"))


def main(arguments: list[str] | None = None) -> None:
    """Make the records named on the command line, by default all of them and the truth file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"any of {', '.join(RECIPES)}; default: all")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent, help="folder")
    chosen = parser.parse_args(arguments)
    if unknown := set(chosen.names) - set(RECIPES):
        parser.error(f"no record called {', '.join(sorted(unknown))}; there are {list(RECIPES)}")
    machine, room, instruments = reference_motor(), Room(), Instruments()
    known: dict[str, object] = {
        "motor": asdict(machine),
        "room": asdict(room),
        "instruments": asdict(instruments),
    }
    written: list[Path] = []
    for name in chosen.names or RECIPES:
        recipe = RECIPES[name]
        truth = simulate(machine, recipe.profile, room=room)
        columns = measure(truth, np.random.default_rng(recipe.seed), instruments)
        written.append(chosen.out / f"{name}.csv.gz")
        write_compressed(table(columns, recipe), written[-1])
        known[name] = truth_of(truth, recipe)
    if not chosen.names:
        written.append(chosen.out / "truth.json")
        entries = ",\n".join(f"{json.dumps(key)}: {json.dumps(known[key])}" for key in known)
        written[-1].write_bytes(f"{{\n{entries}\n}}\n".encode("ascii"))
    for path in written:
        sys.stdout.write(f"| `{path.name}` | `{hashlib.sha256(path.read_bytes()).hexdigest()}` |\n")


if __name__ == "__main__":
    main()
