"""The jobs of `heatrun view` and the server itself, struck while a job runs."""

import json
import os
import random
import select
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from bench import GRACE_S, RAW, Bench, Fault, Known
from commands import DISK, DUTY, Case
from kills import SIGNALS, Row
from started import die_with_parent
from wholeness import Expected, files_of, is_moving

VIEW = Path(__file__).with_name("view_with_jobs.py")
START_S, END_S, JOB_S = 240.0, 60.0, 900.0
SHARE_SERVER, SHARE_CANCEL = 0.4, 0.15
"""Of the strikes; the others hit the process of the job."""

POLITE = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""After these, nothing of the uploads may be left."""

SERVER_ENDS = {
    signal.SIGKILL: {-9},
    signal.SIGINT: {0, 130},
    signal.SIGTERM: {0, -15, 143},
    signal.SIGHUP: {0, -1, 129},
}


class Session:
    """A running `heatrun view` with an upload in its folder."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.log = bench.folder / "view.log"
        words = ["view", "bench", "--no-browser", "--port", "0", "--out", DISK]
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, str(VIEW), *words], cwd=bench.home, env=bench.environment(),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log,
                preexec_fn=die_with_parent,
            )  # fmt: skip
        self.state: dict[str, Any] = {}
        self._rest = b""
        end = time.monotonic() + START_S
        while not self._is_up():
            if time.monotonic() > end or self.process.poll() is not None:
                self.close()
                raise SystemExit(f"heatrun view did not start:\n{self.log.read_text()}")
        self._upload()

    def _is_up(self) -> bool:
        self.listen(0.1)
        return self.state.get("state") == "ready" and "http://" in self.log.read_text()

    def _upload(self) -> None:
        folders = list(self.bench.temporary.glob("heatrun-uploads-*"))
        if not folders:
            raise SystemExit("heatrun view has made no folder for uploads")
        shutil.copy(self.bench.home / DUTY, folders[0] / DUTY)

    def listen(self, wait_s: float) -> None:
        """Take over what was told, waiting for it at most so long."""
        out = self.process.stdout
        assert out is not None
        while select.select([out], [], [], wait_s)[0]:
            data = os.read(out.fileno(), 65536)
            *lines, self._rest = (self._rest + data).split(b"\n")
            for line in lines:
                self.state = json.loads(line)
            if not data:
                time.sleep(wait_s)
                return
            wait_s = 0.0

    def submit(self, words: object) -> None:
        """Queue a job; None cancels it."""
        assert self.process.stdin is not None
        if words is not None:
            self.state = {}
        self.process.stdin.write(json.dumps(words).encode() + b"\n")
        self.process.stdin.flush()

    @property
    def is_over(self) -> bool:
        """Whether the job is."""
        return self.state.get("state") in ("done", "failed", "cancelled")

    def wait(self) -> str:
        """Wait for the end of the job and return its state."""
        end = time.monotonic() + JOB_S
        while not self.is_over and time.monotonic() < end and self.process.poll() is None:
            self.listen(0.05)
        return str(self.state.get("state"))

    def close(self) -> None:
        """End the server at once."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()

    def end(self, sent: signal.Signals) -> list[Fault]:
        """Send the server a signal; return what is wrong with how it ended and what it left."""
        self.process.send_signal(sent)
        faults: list[Fault] = []
        try:
            code = self.process.wait(END_S)
            if code not in SERVER_ENDS[sent]:
                faults.append(("exit code", f"{code} of view after {sent.name}"))
        except subprocess.TimeoutExpired:
            faults.append(("did not end", f"view, {END_S:.0f} s after {sent.name}"))
        self.close()
        faults += self.bench.orphans(grace_s=GRACE_S)
        said = self.log.read_text(errors="replace")
        faults += [(kind, said[-300:]) for pattern, kind in RAW if pattern.search(said)]
        left = [path.name for path in self.bench.temporary.glob("heatrun-uploads-*")]
        if left and sent in POLITE:
            faults.append(("uploads left", f"{left[0]} after {sent.name}"))
        return faults


def disturb_page(bench: Bench, case: Case, draw: random.Random) -> list[Row]:
    """Strike the job of a page and its server, go on each time, and compare in the end."""
    known = bench.known(case, _learn)
    bench.fresh()
    bench.clear_temporary()
    rows: list[Row] = []
    session = Session(bench)
    try:
        for _ in range(draw.randint(2, 4)):
            row, is_down = _strike(session, case, known, draw)
            rows.append(row)
            if is_down:
                row["temporary"] = bench.clear_temporary()
                session = Session(bench)
        session.submit(list(case.words))
        state = session.wait()
        faults: list[Fault] = []
        if state != "done":
            faults.append(("did not go on", f"{state}: {session.state.get('said')}"[-300:]))
        else:
            faults += bench.finally_at(case, known.expected)
        rows.append({"kind": "end", "code": 0 if state == "done" else 1, "faults": faults})
        sent = draw.choice(POLITE)
        rows.append({"kind": "kill", "signal": sent.name, "phase": "idle", "start": "page",
                     "command": "view", "code": 0, "faults": session.end(sent)})  # fmt: skip
    finally:
        session.close()
        bench.orphans()
        bench.clear_temporary()
    return rows


def _strike(session: Session, case: Case, known: Known, draw: random.Random) -> tuple[Row, bool]:
    phase = draw.choice(list(known.spans))
    delay_s = draw.uniform(0.0, known.spans[phase])
    sent = draw.choice(SIGNALS)
    what = draw.random()
    session.submit(list(case.words))
    began = _follow(session, case, phase, delay_s)
    row: Row = {"signal": sent.name, "phase": list(began)[-1], "start": "page", "code": None}
    if session.is_over:
        return {
            **row,
            "kind": "late",
            "faults": session.bench.faults_at(case, known.expected),
        }, False
    row["kind"] = "kill"
    if what < SHARE_SERVER:
        faults = session.end(sent)
        faults += session.bench.faults_at(case, known.expected)
        return {**row, "command": "view", "faults": faults}, True
    if what < SHARE_SERVER + SHARE_CANCEL:
        row["signal"] = "cancelled"
        session.submit(None)
    else:
        _signal_job(session, sent)
    state = session.wait()
    faults = session.bench.faults_at(case, known.expected)
    row["moving"] = is_moving(session.bench.home / case.place)
    if state not in ("failed", "cancelled", "done"):
        faults.append(("did not end", f"the job is {state} after {row['signal']}"))
    if session.process.poll() is not None:
        faults.append(("exit code", f"view ended with its job: {session.process.returncode}"))
    row["kind"] = "late" if state == "done" else "kill"
    return {**row, "faults": faults}, session.process.poll() is not None


def _signal_job(session: Session, sent: signal.Signals) -> None:
    """Send a signal to the job's process, if that is still one of this worker's."""
    session.listen(0.0)
    pid = int(session.state.get("pid", 0))
    try:
        with open(f"/proc/{pid}/environ", "rb") as file:
            is_ours = session.bench.mark.encode() in file.read()
        if pid and is_ours and not session.is_over:
            os.kill(pid, sent)
    except (OSError, ProcessLookupError):
        return


def _follow(session: Session, case: Case, phase: str, delay_s: float) -> dict[str, float]:
    """Wait until a job is so far; return when its phases began."""
    began: dict[str, float] = {}
    end = time.monotonic() + JOB_S
    while not session.is_over and time.monotonic() < end:
        session.listen(0.01)
        if session.state.get("pid"):
            began.setdefault("reading", time.monotonic())
        said = "\n".join(session.state.get("said", ()))
        for name, words in case.phases.items():
            if words in said:
                began.setdefault(name, time.monotonic())
        if phase in began and time.monotonic() >= began[phase] + delay_s:
            break
    return began or {"reading": time.monotonic()}


def _learn(bench: Bench, case: Case) -> Known:
    """Run the job twice on one server; the second finds everything compiled."""
    bench.fresh()
    bench.clear_temporary()
    session = Session(bench)
    kept, spans = [], {}
    try:
        for number in (1, 2):
            session.submit(list(case.words))
            began = _follow(session, case, "never", 0.0)
            if session.wait() != "done":
                raise SystemExit(f"undisturbed, {case.name} failed: {session.state}")
            stops = [*began.values(), time.monotonic()]
            spans = {p: b - a for p, a, b in zip(began, stops, stops[1:], strict=False)}
            kept.append(bench.keep(case.place, number))
            if number == 1:
                shutil.rmtree(bench.home / case.place)
    finally:
        session.close()
        bench.orphans()
        bench.clear_temporary()
    before = frozenset(files_of(bench.base / case.place))
    return Known(Expected.learn(kept[0], kept[1], before), spans, 0, 0)
