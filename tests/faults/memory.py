"""Peak memory of reading large text files, each in a process of its own; the table of it.

python tests/faults/memory.py [--rows 10000000] [--results results/faults]
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

PROGRAM = """
import resource, sys
from heatrun.readers.read import read_record
from heatrun.errors import InputError
try:
    said = f"{read_record(sys.argv[1]).time_s.size} samples"
except InputError as error:
    said = f"refused: {error.problem}"
print(said, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024, sep="|")
"""
BATCH = 100_000


def write_rows(path: Path, num_rows: int) -> None:
    """Write a record at 1 kHz with five columns."""
    with path.open("w") as file:
        file.write("t,Is,Pd,Te,Tw_m\n")
        for first in range(0, num_rows, BATCH):
            time_s = np.arange(first, min(first + BATCH, num_rows)) * 1e-3
            columns = (time_s, 80 + 20 * np.sin(time_s / 300), 400 + 100 * np.sin(time_s / 300),
                       np.full(time_s.size, 22.1), 60 - 38 * np.exp(-time_s / 2000))  # fmt: skip
            np.savetxt(file, np.stack(columns, axis=1), fmt="%.3f,%.3f,%.2f,%.1f,%.0f")


def measure(path: Path) -> str:
    """Return a row of the table for a file."""
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)], capture_output=True, text=True, check=True
    )
    said, peak = done.stdout.strip().split("|")
    size = path.stat().st_size / 2**20
    return f"| {size:.0f} | {said} | {peak} | {time.monotonic() - began:.0f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--results", type=Path, default=Path("results") / "faults")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "test.csv"
        rows = []
        for num_rows in (1000, options.rows):
            write_rows(path, num_rows)
            rows.append(measure(path))
        with path.open("wb") as file:
            file.truncate(2**31)
        rows.append(measure(path))
    lines = [
        "# Memory of reading text",
        "",
        f"`make study-faults` (`python tests/faults/memory.py --rows {options.rows}`): peak of the "
        "resident memory of a process that reads one file; the first row is what the libraries "
        "take.",
        "",
        "| file [MB] | outcome | peak [MB] | seconds |",
        "|---:|---|---:|---:|",
        *rows,
    ]
    options.results.mkdir(parents=True, exist_ok=True)
    (options.results / "memory.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
