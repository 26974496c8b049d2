"""Random kills of clients and workers of a fleet; its file is that of an undisturbed run.

Each trial begins with an empty folder. The command is struck, by a signal to it or by SIGKILL to
one of its workers, at a drawn moment, started again, and in the end left to finish. Half of the
moments are drawn from the time that the command usually takes, half from the number of its parts,
so that not all strikes fall into its start. After each strike: no worker outlives its command, and
every file that is there is whole and that of the undisturbed run, byte by byte.

The trials take two fleets in turn: machines that are fitted one by one, and machines that are
fitted together.

    python tests/fleet/kills_campaign.py [--kills 60] [--seed 0] [--results results/fleet]

A campaign that was stopped goes on from `kills.json`; `--minutes` bounds this part of it.
"""

from __future__ import annotations

import argparse
import datetime
import hashlib
import json
import os
import platform
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from importlib.metadata import version
from pathlib import Path
from typing import Any

import psutil
from simulated_fleet import write_fleet

FLEETS = {"one by one": (16, 2), "together": (64, 16)}
"""Machines, and machines of a batch; 16 of a kind are the fewest that are fitted together."""

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SHARE_AT_PARTS = 0.5
"""Of the moments; the others are drawn from the time that the command takes."""

SHARE_OF_WORKERS = 0.5
"""Of the strikes; the others go to the command itself."""

MOST_STRIKES = 4
"""Strikes at the command in one trial; then it is left to end."""

LONGEST_S = 900.0
JUST_AFTER_S = 2.0
"""A strike at a part falls within that time after it has been written."""

GONE_S = 60.0
"""Until then the workers of a killed command have ended."""

PACKAGES = ("heatrun", "jax", "numpy", "distributed", "pyarrow")

Row = dict[str, Any]


class Bench:
    """A fleet, its undisturbed run, and the folder that is struck."""

    def __init__(self, folder: Path, num: int, batch: int) -> None:
        self.folder, self.out = folder, folder / "out"
        self.batch, self.num_parts = batch, num // batch
        write_fleet(folder / "bench", num)
        self.environment = {**os.environ, "JAX_COMPILATION_CACHE_DIR": str(folder / "jax"),
                            "OPENBLAS_NUM_THREADS": "1"}  # fmt: skip
        reference = folder / "reference"
        for out in (reference, folder / "compiled"):  # the second time is the usual one
            begun = time.monotonic()
            code, said = self.started(out, 0).communicate_code()
            if code != 0:
                raise SystemExit(f"the undisturbed run failed: {said}")
            self.usual_s = time.monotonic() - begun
        self.expected = files_of(reference)

    def started(self, out: Path, workers: int) -> Command:
        """Start the command on the fleet."""
        fleet = self.folder / "bench" / "FLEET.toml"
        words = [sys.executable, "-m", "heatrun.cli", "fleet", str(fleet), "--batch",
                 str(self.batch), "--workers", str(workers), "--out", str(out)]  # fmt: skip
        return Command(words, self.environment)

    def num_done(self) -> int:
        """Return the number of parts that are there."""
        return len(list((self.out / "parts").glob("*.parquet")))

    def wait(self, command: Command, draw: random.Random) -> None:
        """Wait for a drawn moment of the command, or for its end."""
        if draw.random() < SHARE_AT_PARTS:
            wanted = draw.randrange(min(self.num_done(), self.num_parts - 1), self.num_parts)
            after = draw.uniform(0.0, JUST_AFTER_S)
            while self.num_done() <= wanted and command.process.poll() is None:
                time.sleep(0.01)
        else:
            after = draw.uniform(0.0, self.usual_s)
        time.sleep(after)

    def faults(self) -> list[str]:
        """Return what is wrong with the files of a struck run."""
        found = files_of(self.out)
        return [
            f"{name} is not that of the undisturbed run"
            for name, sha in found.items()
            if name in self.expected and sha != self.expected[name]
        ] + [f"{name} is a part of no batch" for name in found if name not in self.expected]


class Command:
    """A started command; its workers are its children."""

    def __init__(self, words: list[str], environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            words, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )  # fmt: skip

    def children(self) -> list[psutil.Process]:
        """Return the processes that it has started, and theirs."""
        try:
            return psutil.Process(self.process.pid).children(recursive=True)
        except psutil.NoSuchProcess:
            return []

    def workers(self) -> list[psutil.Process]:
        """Return its workers."""
        return [p for p in self.children() if "spawn_main" in " ".join(cmdline(p))]

    def communicate_code(self) -> tuple[int, str]:
        """Wait for the end; return exit code and what was said."""
        _, said = self.process.communicate(timeout=LONGEST_S)
        return self.process.returncode, said.decode(errors="replace")


def cmdline(process: psutil.Process) -> list[str]:
    """Return the words of a process, none if it has ended."""
    try:
        return process.cmdline()
    except psutil.Error:
        return []


def files_of(out: Path) -> dict[str, str]:
    """Return digests of the result and of the parts; times and dates differ from run to run."""
    paths = [out / "machines.parquet", *sorted((out / "parts").glob("*.parquet"))]
    return {str(p.relative_to(out)): hashlib.sha256(p.read_bytes()).hexdigest()
            for p in paths if p.exists()}  # fmt: skip


def trial(bench: Bench, draw: random.Random) -> list[Row]:
    """Strike a fleet until it is done; return a row for each strike and one for the end."""
    shutil.rmtree(bench.out, ignore_errors=True)
    rows: list[Row] = []
    for left in reversed(range(MOST_STRIKES + 1)):
        workers = draw.choice((1, 2, 4))
        command = bench.started(bench.out, workers)
        if left == 0 or draw.random() < SHARE_OF_WORKERS:
            rows += _strike_workers(command, bench, draw, num=0 if left == 0 else 3)
            code, said = command.communicate_code()
            faults = bench.faults() + ([] if code == 0 else [f"exit code {code}: {said[-300:]}"])
            missing = sorted(set(bench.expected) - set(files_of(bench.out)))
            rows.append({"kind": "end", "faults": faults + [f"{m} is missing" for m in missing]})
            return rows
        rows.append(_strike_command(command, bench, draw))
    return rows


def _strike_workers(command: Command, bench: Bench, draw: random.Random, num: int) -> list[Row]:
    rows: list[Row] = []
    while len(rows) < num and command.process.poll() is None:
        bench.wait(command, draw)
        workers = command.workers()
        if not workers:  # it reads, starts them or joins the parts
            continue
        chosen = draw.choice(workers)
        try:
            chosen.kill()
        except psutil.NoSuchProcess:
            continue
        rows.append(
            {"kind": "worker", "signal": "SIGKILL", "parts": bench.num_done(), "faults": []}
        )
    return rows


def _strike_command(command: Command, bench: Bench, draw: random.Random) -> Row:
    sent = draw.choice(SIGNALS)
    bench.wait(command, draw)
    children = command.children()
    was_running = command.process.poll() is None
    command.process.send_signal(sent)
    code, said = command.communicate_code()
    _, alive = psutil.wait_procs(children, timeout=GONE_S)
    faults = [f"{len(alive)} processes outlive the command"] if alive else []
    if was_running and code not in (-sent, 130, 0):
        faults.append(f"exit code {code} after {sent.name}: {said[-300:]}")
    return {"kind": "command" if was_running else "late", "signal": sent.name,
            "parts": bench.num_done(), "faults": faults + bench.faults()}  # fmt: skip


def table(rows: list[Row], arguments: argparse.Namespace) -> str:
    """Return the page of the campaign."""
    strikes = [row for row in rows if row["kind"] in ("command", "worker")]
    ends = [row for row in rows if row["kind"] == "end"]
    faults = [fault for row in rows for fault in row["faults"]]
    by_kind = Counter((row["fleet"], row["kind"], row["signal"]) for row in strikes)
    midway = sum(0 < row["parts"] < row["of"] for row in strikes)
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            cwd=Path(__file__).parent, check=False).stdout.strip()  # fmt: skip
    lines = [
        "# A fleet whose client and workers are killed at random", "",
        *(f"- fitted {name}: {num} simulated machines in batches of {batch}"
          for name, (num, batch) in FLEETS.items()), "",
        "Worked out by 1, 2 or 4 workers. Commands are struck by a signal, workers by SIGKILL, at "
        "drawn moments; a struck",
        "command is started again and in the end left to finish. After each strike and at each "
        "end, every part and the",
        "joined file are compared byte by byte with those of an undisturbed run without workers, "
        "and no process may",
        "outlive its command.", "",
        "| machines fitted | what is struck | signal | strikes |", "|---|---|---|---|",
        *(f"| {' | '.join(words)} | {num} |" for words, num in sorted(by_kind.items())),
        f"| **all** ({arguments.kills} planned) | | | **{len(strikes)}** |", "",
        f"- struck while some but not all parts were there: {midway}",
        f"- runs left to finish: {len(ends)}; identical to the last bit: "
        f"{sum(not row['faults'] for row in ends)}",
        f"- faults: {len(faults)}",
        *(f"  - {fault}" for fault in faults), "",
        f"`make study-fleet-kills` (`python tests/fleet/kills_campaign.py --kills "
        f"{arguments.kills} --seed {arguments.seed}`),",
        f"{datetime.date.today().isoformat()}, commit {commit}, "
        f"Python {platform.python_version()}, {versions}.", "",
    ]  # fmt: skip
    return "\n".join(lines)


def _num_strikes(trials: list[list[Row]]) -> int:
    return sum(row["kind"] in ("command", "worker") for rows in trials for row in rows)


def _trials_done(path: Path, seed: int) -> list[list[Row]]:
    """Return the trials of an unfinished campaign."""
    if not path.exists():
        return []
    content = json.loads(path.read_text())
    if content["seed"] != seed:
        raise SystemExit(f"{path} is of seed {content['seed']}, not {seed}: give other --results.")
    return content["trials"]


def main() -> None:
    """Strike until there were enough strikes, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # pyright: ignore[reportOptionalMemberAccess]
    parser.add_argument("--kills", type=int, default=60)
    parser.add_argument("--minutes", type=float, default=60.0, help="no trial begins after it")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--results", type=Path, default=Path("results/fleet"))
    arguments = parser.parse_args()
    kept = arguments.results / "kills.json"
    trials: list[list[Row]] = _trials_done(kept, arguments.seed)
    arguments.results.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="fleet-kills-") as folder:
        benches = {}
        for name, (num, batch) in FLEETS.items():
            benches[name] = Bench(Path(folder) / name.replace(" ", "_"), num, batch)
            print(f"{name}, undisturbed: {benches[name].usual_s:.0f} s", flush=True)
        begun = time.monotonic()
        while _num_strikes(trials) < arguments.kills:
            if time.monotonic() - begun > 60.0 * arguments.minutes:
                break
            name = list(FLEETS)[len(trials) % len(FLEETS)]
            bench, draw = benches[name], random.Random(f"{arguments.seed} {len(trials)}")
            about = {"fleet": name, "of": bench.num_parts}
            trials.append([about | row for row in trial(bench, draw)])
            content = {"seed": arguments.seed, "trials": trials}
            kept.write_text(json.dumps(content, indent=1) + "\n")
            print(
                _num_strikes(trials), [f for row in trials[-1] for f in row["faults"]], flush=True
            )
    rows = [row for each in trials for row in each]
    (arguments.results / "kills.md").write_text(table(rows, arguments), encoding="utf-8")
    if any(row["faults"] for row in rows):
        raise SystemExit("there were faults")


if __name__ == "__main__":
    main()
