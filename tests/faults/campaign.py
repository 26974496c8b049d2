"""All commands and the page's jobs killed, on full disks and short of memory; the table of it.

Each trial takes one command, strikes it several times at drawn moments of its phases or before
drawn file operations, starts it again each time and lets it end. Whatever lies at the destination
must be whole, the exit code and message right, nothing may be left over, and the result must be
that of a command that nobody disturbed.

What was seen stands in a file to which every trial adds; started again, the campaign goes on.

    python tests/faults/campaign.py [--kills 1000] [--minutes 60] [--seed 2] [--workers 2]
        [--only NAME] [--parts kills,full,memory] [--results FOLDER] [--scratch FOLDER]
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).parents[2]
PARTS = ("kills", "full", "memory")
PER_DISK = 3
"""Trials of every case on each kind of full disk."""

WHOLE = 1000
"""Signals for which the targets of the cases are given."""

PER_TRIAL = 4.0
"""Signals of a trial, nearly."""

NICE = 10
"""How far the campaign stands back behind other work on the machine."""

Job = tuple[str, str, object]
"""Part, name of the case, and the limit of memory or the kind of disk."""


def open_jobs(rows: list[dict], parts: list[str], only: str, kills: int) -> list[tuple[Job, float]]:
    """Return what is still to be done, each with how much of it."""
    from commands import CASES, PAGE
    from limits import DISKS, MEMORY_MB

    cases = [case for case in (*CASES, *PAGE) if only in case.name]
    done = Counter(row["case"] for row in rows if row["kind"] == "kill")
    jobs: list[tuple[Job, float]] = []
    if "kills" in parts and sum(row["kind"] == "kill" for row in rows) < kills:
        wanted = {case.name: case.target * kills / WHOLE for case in cases}
        jobs += [(("kills", name, None), max(target - done[name], 0.05 * target) / PER_TRIAL)
                 for name, target in wanted.items()]  # fmt: skip
    plain = [case for case in cases if case not in PAGE]
    if "full" in parts:
        seen = Counter(
            (row["case"], row["way"]) for row in rows if row["kind"] in ("full", "skipped")
        )
        for case in plain:
            for way in DISKS:
                lacking = PER_DISK - seen[case.name, way]
                jobs += [(("full", case.name, way), 1.0 * lacking)] if lacking > 0 else []
    if "memory" in parts:
        tried = {(row["case"], row["size_MB"]) for row in rows if row["kind"] == "memory"}
        jobs += [(("memory", case.name, size), 1.0) for case in plain for size in MEMORY_MB
                 if (case.name, size) not in tried]  # fmt: skip
    return jobs


def work(options: argparse.Namespace) -> None:
    """Do trials until all is done or time is up; the process of one worker."""
    from bench import MARK, Bench, product
    from commands import CASES, PAGE
    from kills import disturb
    from limits import fill, squeeze
    from pages import disturb_page
    from started import warm_up
    from tally import Tally

    signal.signal(signal.SIGTERM, _leave)
    os.nice(options.nice)
    warm_up()
    cases = {case.name: case for case in (*CASES, *PAGE)}
    bench = Bench(options.scratch / f"worker_{options.worker}", os.environ[MARK])
    bench.prepare()
    tally = Tally(options.results / "kills.jsonl", product())
    trial = 0
    while time.time() < options.until:
        rows = tally.rows()
        jobs = open_jobs(rows, options.parts, options.only, options.kills)
        if not jobs:
            return
        trial += 1
        draw = random.Random(f"{options.seed} {len(rows)} {options.worker} {trial}")
        part, name, how = draw.choices([job for job, _ in jobs], [size for _, size in jobs])[0]
        case, began = cases[name], _seconds()
        if part == "full":
            found = fill(bench, case, str(how), draw)
        elif part == "memory":
            assert isinstance(how, int)
            found = squeeze(bench, case, how)
        else:
            found = (disturb_page if case in PAGE else disturb)(bench, case, draw)
        spent = [
            round((now - then) / len(found), 2) for now, then in zip(_seconds(), began, strict=True)
        ]
        same = {"case": name, "command": case.command, "seconds": spent[0], "cpu_s": spent[1]}
        found = [{**same, **row} for row in (*bench.learnt(), *found)]
        tally.add(_without_places(row, options.scratch) for row in found)


def _without_places(row: dict, scratch: Path) -> dict:
    """Return a row whose texts name no folder of this machine."""
    text = json.dumps(row)
    for place, name in ((scratch, "SCRATCH"), (ROOT, "."), (sys.base_prefix, "PYTHON")):
        text = text.replace(str(place), name)
    return json.loads(text)


def _seconds() -> tuple[float, float]:
    """Return the time, and the processor time of this process and its children [s]."""
    used = os.times()
    return time.monotonic(), sum(used[:4])


def _leave(number: int, frame: FrameType | None) -> None:
    raise SystemExit(128 + number)


def supervise(options: argparse.Namespace) -> int:
    """Start the workers, say how far they are, and wait for them; 1 if one failed."""
    from bench import MARK, product
    from tally import Tally, num_kills

    began, codes = time.monotonic(), []
    tally = Tally(options.results / "kills.jsonl", product())
    signal.signal(signal.SIGTERM, _leave)
    workers = []
    for number in range(options.workers):
        folder = options.scratch / f"worker_{number}"
        environment = {
            **os.environ,
            MARK: f"{os.getpid()} {number} {time.time_ns()};",
            # JAX reads them when it is imported, which is before the fork
            "JAX_COMPILATION_CACHE_DIR": str(folder / "cache"),
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3",
            "OPENBLAS_NUM_THREADS": "1",
            "NUMEXPR_MAX_THREADS": "1",
        }
        words = [sys.executable, __file__, *sys.argv[1:], "--scratch", str(options.scratch),
                 "--worker", str(number), "--until", str(options.until)]  # fmt: skip
        workers.append(subprocess.Popen(words, env=environment, start_new_session=True))
    try:
        minutes = 1
        while any(worker.poll() is None for worker in workers):
            time.sleep(0.2)
            if time.monotonic() - began > 60.0 * minutes:
                said = f"{num_kills(tally.rows())} signals, {minutes} min"
                print(said, file=sys.stderr, flush=True)
                minutes += 1
    finally:
        for worker in workers:
            if worker.poll() is None:
                worker.terminate()
        codes = [worker.wait() for worker in workers]
    return int(any(codes))


def main() -> int:
    """Go on with the campaign and write its table; 1 if there is a fault."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--kills", type=int, default=WHOLE)
    parser.add_argument("--minutes", type=float, default=60.0, help="after which it stops")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--nice", type=int, default=NICE)
    parser.add_argument("--only", default="", help="part of the name of a case")
    parser.add_argument("--parts", type=lambda text: text.split(","), default=list(PARTS))
    parser.add_argument("--results", type=Path, default=ROOT / "results" / "faults")
    parser.add_argument("--scratch", type=Path)
    parser.add_argument("--table", default="table.md", help="name of the table")
    parser.add_argument("--worker", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--until", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.results = options.results.resolve()
    options.until = options.until or time.time() + 60.0 * options.minutes
    options.scratch = (
        options.scratch or Path(tempfile.gettempdir()) / f"heatrun-faults-{os.getuid()}"
    )
    if options.worker is not None:
        work(options)
        return 0
    from bench import product
    from report import write_table
    from tally import Tally

    failed = supervise(options)
    tally = Tally(options.results / "kills.jsonl", product())
    num_faults = write_table(tally, options.results / options.table)
    print(f"{num_faults} faults; {options.results / options.table}", file=sys.stderr)
    return 1 if num_faults or failed else 0


if __name__ == "__main__":
    sys.exit(main())
