"""The cases of a study in worker processes, what is written of them, and the options for that."""

import argparse
import contextlib
import io
import json
import multiprocessing
import platform
import sys
import tempfile
import time
import traceback
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


def options_of(doc: str | None, out: str, seed: int, **counts: int) -> argparse.ArgumentParser:
    """Return the options that studies share."""
    parser = argparse.ArgumentParser(description=doc)
    for name, count in {"seed": seed, **counts, "processes": 1}.items():
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--minutes", type=float, default=float("inf"),
                        help="no case is begun after this")  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("results") / out)
    return parser


def run_study(
    options: argparse.Namespace,
    jobs: Sequence[Row],
    run: Callable[[Row], Row],
    table: Callable[[list[Row]], str],
    *,
    files: tuple[str, str] = ("study.json", "table.md"),
    command: str = "",
    said: Callable[[Row], object] = lambda row: said_of(row),
    same: str = "",
    tasks: int = TASKS,
) -> list[Row]:
    """Work out the cases that are left, writing as they come; return all rows.

    Args:
        options: Of `options_of`; without `processes` all is done in this process.
        jobs: All cases, each with a seed of its own.
        run: Works out one; importable.
        table: Makes the page in Markdown of rows; of a row `place` says how many came before it.
        files: Of the rows, from which an unfinished study goes on, and of the page.
        command: As `write_rows`.
        said: What is printed of a row.
        same: What those rows must have as the options say.
        tasks: As `rows_as_they_come`.
    """
    options.out.mkdir(parents=True, exist_ok=True)
    path, page = (options.out / name for name in files)
    rows = rows_done(path, options.seed)
    if same and any(row[same] != getattr(options, same) for row in rows):
        raise SystemExit(f"{path} has others of {same}: give another --out.")

    def write() -> None:
        rows.sort(key=lambda row: row["seed"])
        write_rows(path, rows, seed=options.seed, planned=len(jobs), command=command)
        page.write_text(table(rows), encoding="utf-8")

    done = {row["seed"] for row in rows}
    left = [job for job in jobs if job["seed"] not in done]
    processes = getattr(options, "processes", 0)
    for finished in rows_as_they_come(
        left, run, processes=processes, minutes=options.minutes, tasks=tasks
    ):
        for row in finished:
            rows.append(row | {"place": len(rows)})
            print(f"{len(rows)}/{len(jobs)} {said(row)}", flush=True)
        write()
    write()
    return rows


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
        processes: So many at once; 0 for this process alone.
        minutes: No case is begun after this [min].
        tasks: Cases after which a process is replaced, for what it has compiled stays in it.
    """
    begin = time.monotonic()
    left = iter(jobs)
    if not processes:
        for job in left:
            if time.monotonic() - begin > 60.0 * minutes:
                return
            yield [run(job)]
        return
    context = multiprocessing.get_context("spawn")  # JAX must not be forked
    with ProcessPoolExecutor(processes, mp_context=context, max_tasks_per_child=tasks) as pool:
        pending = {pool.submit(run, job) for job in islice(left, processes)}
        while pending:
            done, pending = wait(pending, return_when=FIRST_COMPLETED)
            if time.monotonic() - begin < 60.0 * minutes:
                pending |= {pool.submit(run, job) for job in islice(left, len(done))}
            yield [future.result() for future in done]


def rows_done(path: Path, seed: int) -> list[Row]:
    """Return the rows that `write_rows` wrote of an unfinished study; a whole one is run anew."""
    content = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"rows": []}
    if len(content["rows"]) >= content.get("planned", 0):
        return []
    if content["seed"] != seed:
        raise SystemExit(f"{path} is of seed {content['seed']}, not {seed}: give another --out.")
    return content["rows"]


def said_of(row: Row) -> str:
    names = [finding[0] for finding in row.get("findings", [])]
    words = " ".join(str(row[key]) for key in ("kind", "variant", "seed") if key in row)
    return f"{words}: {names} {row.get('processor_s', 0.0):.0f} s {row.get('failure', '')}"


def about(seed: int, planned: int, command: str = "") -> Row:
    """Return what stands before the rows of a study: command, seed and versions."""
    return {
        "command": command or " ".join(sys.argv),
        "seed": seed,
        "planned": planned,
        "python": platform.python_version(),
        "versions": {name: version(name) for name in PACKAGES},
    }


def write_rows(
    path: Path, rows: Sequence[Row], *, seed: int, planned: int, command: str = ""
) -> None:
    """Write the rows of a study, a line for each, behind what is said `about` it."""
    content = about(seed, planned, command)
    head = json.dumps(content, indent=1).removesuffix("\n}")
    lines = ",\n".join(f"  {json.dumps(row)}" for row in rows)
    path.write_text(f'{head},\n "rows": [\n{lines}\n ]\n}}\n', encoding="utf-8")


@contextlib.contextmanager
def temporary() -> Iterator[Path]:
    """Give a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def put(path: Path, text: str) -> None:
    """Write a page into a folder that may not be there yet."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def command(arguments: list[str]) -> tuple[int | None, str]:
    """Return the exit code of `heatrun` and what it wrote to the error stream."""
    from heatrun.cli import main

    out, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
        try:
            code = main(arguments)
        except Exception:  # a traceback is a result too
            return None, traceback.format_exc()
    return code, said.getvalue()
