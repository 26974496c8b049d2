"""Commands that the page starts: one at a time, in a process of their own, to be cancelled.

`python -m heatrun_view.running_jobs WORDS…` is such a process, and the words are those after
`heatrun`. It ends when the server does, however the server ended.
"""

import atexit
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Literal

from heatrun.commands.console import DONE, PROGRESS
from heatrun.errors import InputError

SERVER = "HEATRUN_SERVER"
"""Variable of the environment that names the server's process to its commands."""

State = Literal["waiting", "running", "done", "failed", "cancelled"]

NUM_LINES = 200
"""Lines of a command's messages that are kept."""

MAX_JOBS = 20
"""Commands that run or wait at a time."""

END_S = 5.0
"""Wait for a command that was told to end, before it is killed [s]."""

LOOK_S = 0.5
"""How often a command looks whether its server is there [s]."""

KILL = getattr(signal, "SIGKILL", signal.SIGTERM)


@dataclass
class Job:
    """A command on its way: the words after `heatrun`, the share done [1], what it is at, its last
    messages, and once it is done what it printed as JSON.
    """

    words: tuple[str, ...]
    state: State = "waiting"
    share: float = 0.0
    doing: str = ""
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=NUM_LINES))
    output: dict[str, Any] = field(default_factory=dict)
    process: subprocess.Popen[str] | None = None

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come of it."""
        return self.state in ("done", "failed", "cancelled")

    @property
    def command(self) -> str:
        """The command as a user would type it."""
        return subprocess.list2cmdline(["heatrun", *self.words])


class JobQueue:
    """Runs commands of all tabs in turn, each in a process of its own."""

    def __init__(self) -> None:
        self._jobs: list[Job] = []
        self._changed = threading.Condition()
        self._is_closed = False
        threading.Thread(target=self._work, daemon=True, name="heatrun jobs").start()
        atexit.register(self.close)

    def submit(self, words: Sequence[str]) -> Job:
        """Queue a command, the words after `heatrun`; one that is not over yet is shared.

        Raises:
            InputError: If `MAX_JOBS` commands wait.
        """
        with self._changed:
            for job in self._jobs:
                if job.words == tuple(words) and not job.is_over:
                    return job
            if sum(not job.is_over for job in self._jobs) >= MAX_JOBS:
                raise InputError(
                    f"{MAX_JOBS} commands wait already.", remedy="Cancel some, or wait."
                )
            job = Job(tuple(words))
            self._jobs.append(job)
            self._changed.notify_all()
            return job

    def num_ahead(self, job: Job) -> int:
        """Return how many commands run or wait before this one."""
        with self._changed:
            before = self._jobs[: self._jobs.index(job)] if job in self._jobs else []
            return sum(not each.is_over for each in before)

    def cancel(self, job: Job) -> None:
        """End a command at once; what it has sampled so far is kept for the next time.

        SIGTERM and not SIGINT, which a server that was started in the background hands down as
        ignored. Nothing is lost: a run folder bears the end of its process at any moment.
        """
        with self._changed:
            if not job.is_over:
                job.state = "cancelled"
                if job.process is not None:
                    _signal(job.process, signal.SIGTERM)
            self._changed.notify_all()

    def close(self) -> None:
        """Cancel everything, start nothing more and wait until it has ended."""
        with self._changed:
            self._is_closed = True
            jobs = list(self._jobs)
        for job in jobs:
            self.cancel(job)
        for job in jobs:
            if job.process is None:
                continue
            try:
                job.process.wait(END_S)
            except subprocess.TimeoutExpired:
                _signal(job.process, KILL)
                job.process.wait()

    def _next(self) -> Job | None:
        """Forget what is over and return the first command that waits."""
        self._jobs = [job for job in self._jobs if not job.is_over]
        waiting = (job for job in self._jobs if job.state == "waiting")
        return None if self._is_closed else next(waiting, None)

    def _work(self) -> None:
        while True:
            with self._changed:
                while (job := self._next()) is None:
                    self._changed.wait()
                job.process = _start(job.words)
                job.state = "running"
            _follow(job)


def _start(words: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", f"{__package__}.running_jobs", *words, "--json"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
        env=os.environ | {PROGRESS: "json", "PYTHONIOENCODING": "utf-8", SERVER: str(os.getpid())},
        start_new_session=True,
    )


def _signal(process: subprocess.Popen[str], number: int) -> None:
    """Send a signal to a command and to what it has started."""
    if process.poll() is not None:
        return
    if hasattr(os, "killpg"):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
    else:
        process.terminate()


def _follow(job: Job) -> None:
    """Read a running command's messages to its end and take over what it printed."""
    process = job.process
    assert process is not None
    assert process.stdout is not None
    assert process.stderr is not None
    printed: list[str] = []
    reader = threading.Thread(target=lambda: printed.append(process.stdout.read()), daemon=True)  # pyright: ignore[reportOptionalMemberAccess]
    reader.start()
    for line in process.stderr:
        _take(job, line.rstrip("\n"))
    code = process.wait()
    reader.join()
    process.stdout.close()
    process.stderr.close()
    try:
        job.output = json.loads(printed[0]) if printed else {}
    except ValueError:
        job.output = {}
    if job.state == "running":
        job.state = "done" if code == DONE else "failed"


def _take(job: Job, line: str) -> None:
    if line.startswith('{"share"'):
        with suppress(ValueError, KeyError, TypeError):
            told = json.loads(line)
            job.share, job.doing = float(told["share"]), str(told["doing"])
            return
    if line.strip():
        job.lines.append(line)


def _end_with(server: int) -> None:
    """End this process and what it has started, once its server is gone."""
    while os.getppid() == server:
        time.sleep(LOOK_S)
    if hasattr(os, "killpg") and os.getpgrp() == os.getpid():
        os.killpg(os.getpid(), signal.SIGKILL)
    os._exit(1)


if __name__ == "__main__":
    from heatrun.cli import main

    asked = os.environ.pop(SERVER, "")
    if asked.isdigit():
        threading.Thread(target=_end_with, args=(int(asked),), daemon=True).start()
    sys.exit(main())
