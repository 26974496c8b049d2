"""A home in which commands are disturbed, and what undisturbed ones leave there."""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from commands import CASES, DISK, RUN, Case, fresh, write_inputs
from started import End, Strike, run_forked
from wholeness import (
    Expected,
    differs_from_manifest,
    files_of,
    is_moving,
    marked_processes,
    pieces_of,
    torn,
)

from heatrun.commands.console import PROGRESS

MARK = "HEATRUN_FAULTS_MARK"
PACKAGES = ("identify", "models")
ROOT = Path(__file__).parents[2]

Fault = tuple[str, str]
"""Kind and detail."""

ENDS = {
    signal.SIGKILL: {-9},
    signal.SIGINT: {130},
    signal.SIGTERM: {-15, 143},
    signal.SIGHUP: {-1, 129},
}
"""Exit codes of a command that a signal ended."""

RAW = (
    (re.compile(r"Traceback \(most recent|Exception ignored|Error in atexit"), "traceback"),
    (re.compile(r"^\S*Warning: |: \w*Warning: ", re.M), "raw warning"),
    (re.compile(r"Fatal Python|terminate called|LLVM ERROR|Check failed|core dumped|std::\w+"),
     "native abort"),
    (re.compile(r"held up: ended by the campaign"), "did not end"),
)  # fmt: skip
GRACE_S = 10.0


def product() -> str:
    """Return the digest of the packages that are tried: figures of others are not mixed in."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


@dataclass(frozen=True)
class Known:
    """What is known of a case from undisturbed commands."""

    expected: Expected  # What it leaves.
    spans: dict[str, float]  # How long each phase takes [s].
    num_operations: int  # File operations of one.
    largest: int  # Size of its largest file [byte].


class Bench:
    """A folder of one worker with the home of its commands.

    Attributes:
        home: Working folder, made anew for each trial at the same path.
        base: What it is made of.
    """

    def __init__(self, folder: Path, mark: str) -> None:
        self.folder, self.mark = folder, mark
        self.home, self.base, self.temporary = folder / "home", folder / "base", folder / "tmp"
        self._known: dict[str, Known] = {}
        self._learnt: list[dict[str, object]] = []
        self._store = folder / f"known_{product()}.pickle"
        self.temporary.mkdir(parents=True, exist_ok=True)

    def prepare(self) -> None:
        """Write the inputs, or take up what an earlier campaign with these packages has learnt."""
        if self._store.is_file():
            self._known = pickle.loads(self._store.read_bytes())
            return
        for old in self.folder.glob("known_*.pickle"):  # what it knows is of another base
            old.unlink()
        shutil.rmtree(self.base, ignore_errors=True)
        write_inputs(self.base)
        self._save()

    def _make_run(self) -> None:
        """Write the run that sheets, exports and simulations read."""
        self.fresh()
        case = next(case for case in CASES if case.variant == "quick")
        end = self.run(Case("run", (*case.words[:-1], RUN), 0, phases=case.phases))
        if end.code != 0:
            raise SystemExit(f"the run that others read could not be made:\n{end.said}")
        shutil.copytree(self.home / RUN, self.base / RUN)

    def _save(self) -> None:
        self._store.write_bytes(pickle.dumps(self._known))

    def fresh(self) -> None:
        """Make the home as it was before anything ran in it."""
        fresh(self.home, self.base)

    def environment(self) -> dict[str, str]:
        """Return the environment of every command."""
        return {**os.environ, "TMPDIR": str(self.temporary), PROGRESS: "json"}

    def run(self, case: Case, strike: Strike | None = None, **limits: int) -> End:
        env = {"TMPDIR": str(self.temporary), PROGRESS: "json"}
        return run_forked(case.words, self.home, env, case.phases, strike, **limits)

    def command_line(self, case: Case) -> list[str]:
        """Return the case as a user would start it."""
        return [sys.executable, "-m", "heatrun.cli", *case.words]

    def known(self, case: Case, learn: Callable[[Bench, Case], Known] | None = None) -> Known:
        """Return what undisturbed commands leave; two are run where that is not known yet."""
        if case.name not in self._known:
            known = self._known[case.name] = (learn or Bench._learn)(self, case)
            leaves = {file: each[:6] for file, each in known.expected.varying.items()}
            self._learnt.append({"case": case.name, "kind": "learnt", "faults": [],
                                 "same": sorted(known.expected.digests),
                                 "varying": leaves})  # fmt: skip
            self._save()
        return self._known[case.name]

    def learnt(self) -> list[dict[str, object]]:
        """Return what was learnt since this was asked last, as rows of the tally."""
        rows, self._learnt = self._learnt, []
        return rows

    def _learn(self, case: Case) -> Known:
        if RUN in case.words and not (self.base / RUN).exists():
            self._make_run()
        before = frozenset(files_of(self.base / case.place))
        kept, end = [], None
        for number in (1, 2):
            self.fresh()
            end = self.run(case)
            if end.code != 0:
                raise SystemExit(f"undisturbed, {case.name} ended with {end.code}:\n{end.said}")
            kept.append(self.keep(case.place, number))
        assert end is not None
        expected = Expected.learn(kept[0], kept[1], before)
        sizes = [path.stat().st_size for path in files_of(kept[1]).values()]
        return Known(expected, end.spans, end.num_operations, max(sizes, default=1000))

    def keep(self, place: str, number: int) -> Path:
        """Copy a destination aside."""
        kept = self.folder / f"clean_{number}"
        shutil.rmtree(kept, ignore_errors=True)
        if (self.home / place).is_dir():
            shutil.copytree(self.home / place, kept)
        else:
            kept.mkdir()
        return kept

    def faults_at(self, case: Case, expected: Expected, disk: Path | None = None) -> list[Fault]:
        """Return what is wrong with what lies at the destination of a case that was disturbed."""
        place = (disk or self.home / DISK) / Path(case.place).name
        faults = [("half-written file", text) for text in torn(place)]
        if is_moving(place):
            return faults  # some of a complete set's files are at their places already
        lacking = expected.missing(place)
        if lacking:
            faults.append(("set incomplete", f"{', '.join(lacking[:4])} lack beside the others"))
        if place.exists() and ((place / "manifest.json").exists() or case.place == RUN):
            faults += [("not as its manifest", text) for text in differs_from_manifest(place)[:2]]
        return faults

    def orphans(self, *, grace_s: float = 0.3) -> list[Fault]:
        """Return the processes that outlived their command, and end them."""
        end = time.monotonic() + grace_s
        while (left := marked_processes(self.mark)) and time.monotonic() < end:
            time.sleep(0.05)
        for pid in left:
            # the mark is that of this worker: nothing but what it started bears it
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        return [("orphan process", f"{len(left)} left")] if left else []

    def clear_temporary(self) -> int:
        """Empty the folder for temporary files; return how many pieces lay there."""
        left = list(self.temporary.iterdir())
        for path in left:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        return len(left)

    def finally_at(self, case: Case, expected: Expected, disk: Path | None = None) -> list[Fault]:
        """Return what is wrong after the same command was run to its end."""
        disk = disk or self.home / DISK
        place = disk / Path(case.place).name
        faults = [("result differs", text) for text in expected.differences(place)[:3]]
        left = pieces_of(disk)
        if left:
            faults.append(("piece left after the next start", f"{len(left)}: {left[0]}"))
        return faults + self.faults_at(case, expected, disk)


def said_wrongly(end: End) -> list[Fault]:
    """Return what should not stand on stderr."""
    return [(kind, end.said[-300:]) for pattern, kind in RAW if pattern.search(end.said)]


def ended_wrongly(end: End, sent: signal.Signals) -> list[Fault]:
    """Return what is wrong with the exit code and the message after a signal."""
    faults = said_wrongly(end)
    if end.code not in {0, *ENDS[sent]}:
        faults.append(("exit code", f"{end.code} after {sent.name}: {end.said[-200:]}"))
    if end.code == 130 and "interrupted" not in end.said:
        faults.append(("no word about the interrupt", end.said[-200:]))
    return faults
