"""Calibrations killed and interrupted at random moments of every phase; the table of outcomes.

Each run goes into one folder until it ends: killed up to three times, started again with the same
command each time, then left alone. Whatever lies at the destination must be a whole run, the
exit code and message right, and the posterior the same to the last bit as that of a run that
nobody disturbed.

    python tests/faults/campaign.py [--kills 40] [--minutes 22] [--seed 2] [--results FOLDER]
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from report import write_table

DATA = Path(__file__).parents[2] / "data" / "synthetic"
METHODS = {"quick": ["--quick"], "emcee": []}
PHASES = {
    "reading": "",
    "fitting": "least squares",
    "sampling": "sampling the posterior",
    "writing": "writing the sheet",
}
"""What a command says on stderr when a phase begins."""

MOST_KILLS = 3  # of one run, after which it is left to end


@dataclass
class Tally:
    """What was seen; the campaign fails if `faults` is not empty."""

    kills: Counter = field(default_factory=Counter)
    num_finished: int = 0
    num_resumed: int = 0
    num_early: int = 0
    faults: list[str] = field(default_factory=list)


def listen() -> None:
    """Let a process be interrupted even where a shell in the background started this one."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Command:
    """A command in a process of its own, with the times at which its phases began."""

    def __init__(self, words: list[str]) -> None:
        self.began = {"reading": time.monotonic()}
        self.err: list[str] = []
        self.process = subprocess.Popen(
            words,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=listen,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.err.append(line)
            for phase, words in PHASES.items():
                if words and words in line:
                    self.began.setdefault(phase, time.monotonic())

    def wait(self) -> int:
        """Return the exit code, after all that it said was read."""
        code = self.process.wait()
        self._reader.join()
        return code


def words_of(folder: Path, method: str, out: Path) -> list[str]:
    """Return the command that is run again and again."""
    head = [sys.executable, "-m", "heatrun.cli", "calibrate", str(folder / "motor.toml")]
    tail = [str(folder / "duty.csv"), "--out", str(out)]
    return [*head, *tail, *METHODS[method]]


def prepare(folder: Path) -> None:
    """Write the motor and the bundled 30-minute duty at 1 Hz."""
    (folder / "motor.toml").write_bytes((DATA / "motor.toml").read_bytes())
    with gzip.open(DATA / "duty_30min.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    (folder / "duty.csv").write_text("\n".join([lines[0], *lines[1::10]]) + "\n")


def posterior(run: Path) -> dict[str, object]:
    """Return all draws of a run, bit by bit, and the models of its fit.json."""
    content: dict[str, object] = {"models": json.loads((run / "fit.json").read_text())["models"]}
    for order in ("first", "second"):
        with h5py.File(run / f"posterior_{order}.nc") as file:
            for group in ("posterior", "sample_stats", "observed_data"):
                for name, values in file[group].items():
                    array = np.asarray(values)
                    # not the bytes of texts, which are addresses
                    content[f"{order}/{group}/{name}"] = (
                        array.tolist() if array.dtype == object else array.tobytes()
                    )
    return content


def is_whole(run: Path) -> bool:
    """Whether every file that the manifest lists is there as it was, and nothing else."""
    try:
        files = json.loads((run / "manifest.json").read_text())["files"]
        return all(
            hashlib.sha256((run / name).read_bytes()).hexdigest() == digest
            for name, digest in files.items()
        )
    except (OSError, ValueError, KeyError):
        return False


def disturb(words: list[str], phase: str, delay_s: float, number: signal.Signals) -> Command:
    """Run a command and send it a signal some time after a phase began."""
    command = Command(words)
    while command.process.poll() is None:
        begun = command.began.get(phase)
        if begun is not None and time.monotonic() >= begun + delay_s:
            command.process.send_signal(number)
            break
        time.sleep(0.005)
    return command


def lengths(command: Command, ended: float) -> dict[str, float]:
    """Return how long each phase of a command took [s]."""
    starts = [*command.began.values(), ended]
    return dict(zip(command.began, np.diff(starts), strict=True))


def campaign(folder: Path, num_kills: int, seed: int, limit_s: float) -> Tally:
    """Kill and interrupt until so many signals have struck a running command, or time is up."""
    end = time.monotonic() + limit_s
    prepare(folder)
    draw = random.Random(seed)
    tally = Tally()
    expected, spans = {}, {}
    for method in METHODS:
        # the second run finds everything compiled, as those that are disturbed will
        for _ in range(2):
            command = Command(words_of(folder, method, folder / f"clean_{method}"))
            if command.wait() != 0:
                raise SystemExit("the undisturbed run failed:\n" + "".join(command.err))
        spans[method] = lengths(command, time.monotonic())
        expected[method] = posterior(folder / f"clean_{method}")
    number = 0
    while sum(tally.kills.values()) < num_kills and time.monotonic() < end:
        number += 1
        method = draw.choice(list(METHODS))
        out = folder / f"run_{number}"
        words = words_of(folder, method, out)
        resumes = False
        for _ in range(draw.randint(1, MOST_KILLS)):
            phase = draw.choice(list(PHASES))
            sent = draw.choice([signal.SIGKILL, signal.SIGINT])
            delay = draw.uniform(0.0, spans[method][phase])
            command = disturb(words, phase, delay, sent)
            code, said = command.wait(), "".join(command.err)
            where = f"run {number}, {method}, {sent.name} {delay:.2f} s into {phase}"
            if is_early(sent, code, said):
                tally.num_early += 1
                continue
            tally.faults += [f"{where}: {fault}" for fault in judge(out, sent, code, said)]
            if code == 0:
                break
            tally.kills[method, list(command.began)[-1], sent.name] += 1
            if out.exists():  # struck between the last rename and the end of the process
                break
            resumes = (folder / f"run_{number}.partial").exists()
        if not out.exists():
            command = Command(words)
            code, said = command.wait(), "".join(command.err)
            tally.num_resumed += "taking up the unfinished run" in said
            if code != 0 or (resumes and "taking up" not in said):
                tally.faults.append(f"run {number}: going on ended with {code}: {said[-300:]}")
        tally.num_finished += 1
        if not is_whole(out) or posterior(out) != expected[method]:
            tally.faults.append(f"run {number}: the posterior is not that of the clean run")
        left = [path.name for path in folder.iterdir() if f"run_{number}." in path.name]
        if left:
            tally.faults.append(f"run {number}: {left} stayed behind")
        print(f"{number}: {sum(tally.kills.values())} signals", file=sys.stderr, flush=True)
    return tally


def is_early(sent: signal.Signals, code: int, said: str) -> bool:
    """Whether an interrupt struck while Python started, before any line of the package ran."""
    in_python = "Traceback" in said and "heatrun" not in said
    return sent is signal.SIGINT and code == -signal.SIGINT and (in_python or not said)


def judge(out: Path, sent: signal.Signals, code: int, said: str) -> list[str]:
    """Return what is wrong with how a disturbed command ended."""
    faults = []
    if out.exists() and not is_whole(out):
        faults.append("a half-written run lies at the destination")
    if "Traceback" in said or "Exception ignored" in said:
        faults.append(f"a traceback was shown: {said[-400:]}")
    if sent is signal.SIGINT and code not in (0, 130):
        faults.append(f"exit code {code} after an interrupt: {said[-200:]}")
    if code == 130 and "interrupted" not in said:
        faults.append("no word about the interrupt")
    return faults


def main() -> int:
    """Run the campaign and write its table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--minutes", type=float, default=22.0, help="after which it stops")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--results", type=Path, default=Path("results") / "faults")
    options = parser.parse_args()
    os.environ["JAX_COMPILATION_CACHE_DIR"] = tempfile.mkdtemp()
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        tally = campaign(Path(name), options.kills, options.seed, 60.0 * options.minutes)
    minutes = (time.monotonic() - began) / 60.0
    write_table(tally, options.results, options.kills, options.seed, minutes)
    print("\n".join(tally.faults), file=sys.stderr)
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
