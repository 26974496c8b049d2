"""The cases of a study in worker processes, and what is written of them."""

from __future__ import annotations

import json
import multiprocessing
import platform
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

PACKAGES = ("heatrun", "jax", "numpy", "scipy", "optimistix")

TASKS = 40
"""Cases of one worker process, which is then replaced: what it has compiled stays in memory."""

Row = dict[str, Any]


def rows_as_they_come(
    jobs: Sequence[Row],
    run: Callable[[Row], Row],
    *,
    processes: int,
    minutes: float,
    tasks: int = TASKS,
) -> Iterator[list[Row]]:
    """Yield the rows that were just finished.

    Args:
        jobs: The cases in the order in which they are begun.
        run: Works out one; importable, for it runs in another process.
        processes: So many at once.
        minutes: No case is begun after this [min].
        tasks: Cases after which a process is replaced, for what it has compiled stays in it.
    """
    begin = time.monotonic()
    context = multiprocessing.get_context("spawn")  # JAX must not be forked
    left = iter(jobs)
    with ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=tasks) as pool:
        pending = {pool.submit(run, job) for job in islice(left, processes)}
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            if time.monotonic() - begin < 60.0 * minutes:
                pending |= {pool.submit(run, job) for job in islice(left, len(done))}
            yield [future.result() for future in done]


def rows_done(path: Path, seed: int) -> list[Row]:
    """Return the rows of an unfinished study; none where there is no such study yet.

    Args:
        path: What `write_rows` wrote.
        seed: The first of the study that goes on.
    """
    if not path.exists():
        return []
    content = json.loads(path.read_text(encoding="utf-8"))
    if content["seed"] != seed:
        raise SystemExit(f"{path} is of seed {content['seed']}, not {seed}: give another --out.")
    return content["rows"]


def said_of(row: Row) -> str:
    """Return what is printed behind the name of a finished case."""
    names = [finding[0] for finding in row.get("findings", [])]
    return f"{names} {row['processor_s']:.0f} s {row.get('failure', '')}"


def write_rows(
    path: Path, rows: Sequence[Row], *, seed: int, planned: int, command: str = ""
) -> None:
    """Write the rows of a study with command, seed and versions as JSON, a line for each row."""
    content = {
        "command": command or " ".join(sys.argv),
        "seed": seed,
        "planned": planned,
        "python": platform.python_version(),
        "versions": {name: version(name) for name in PACKAGES},
    }
    head = json.dumps(content, indent=1).removesuffix("\n}")
    lines = ",\n".join(f"  {json.dumps(row)}" for row in rows)
    path.write_text(f'{head},\n "rows": [\n{lines}\n ]\n}}\n', encoding="utf-8")
