"""Commands in processes of their own, struck by a signal at a drawn moment.

Most are forked from this process, which has imported the packages but has not started a backend
of JAX (`warm_up` refuses to go on where it has): that saves the two to three seconds of importing,
and lets an audit hook count file operations and strike before the n-th. The rest is started as a
user does, by the interpreter. Nothing but children that are not yet waited for is ever signalled.
"""

from __future__ import annotations

import atexit
import ctypes
import errno
import os
import resource
import select
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

WRITES = ("open", "os.rename", "os.remove", "os.rmdir", "os.mkdir", "os.link", "os.symlink",
          "shutil.rmtree")  # fmt: skip
MODULES = ("heatrun.cli", "heatrun.calibration", "heatrun.jobs",
           "heatrun_reports.job", "heatrun.export", "heatrun.simulation",
           "heatrun.reports.of_run", "heatrun.runs.netcdf",
           "heatrun.reports.terminal", "arviz", "xarray", "h5netcdf",
           "matplotlib.backends.backend_agg")  # fmt: skip
EARLY = 99
"""Exit code of a forked command that was interrupted before the command line began."""

LONGEST_S = 900.0
PARENT_DEATH = 1  # PR_SET_PDEATHSIG
STOP_S = 0.01


@dataclass(frozen=True)
class Strike:
    """A signal and its moment."""

    signal: signal.Signals  # What is sent.
    phase: str  # In which phase; `"operation"` for before a file operation.
    delay_s: float = 0.0  # After the phase began [s].
    operation: int = 0  # Number of the file operation, from 1.


@dataclass
class End:
    """How a command ended."""

    code: int  # Exit code; minus the signal's number where that ended it.
    said: str  # All of stderr.
    phase: str  # The phase that it was in when it was struck, or ended.
    spans: dict[str, float] = field(default_factory=dict)  # How long each phase took [s].
    num_operations: int = 0  # File operations below the home.
    was_struck: bool = False  # Whether the signal was sent before the end.


def warm_up() -> None:
    """Import what the commands import; never fork after JAX has started.

    Raises:
        RuntimeError: If importing started a backend of JAX.
    """
    for name in MODULES:
        import_module(name)
    from jax._src import xla_bridge

    if xla_bridge.backends_are_initialized():
        raise RuntimeError("importing heatrun started a backend of JAX: do not fork here")


class Hook:
    """Counts file operations below a folder; strikes, or fills the disk, at the n-th."""

    def __init__(self, home: Path, tell: int, strike: Strike | None, full_from: int) -> None:
        self.home, self.tell, self.strike, self.full_from = str(home), tell, strike, full_from
        self.count = 0

    def __call__(self, event: str, arguments: tuple) -> None:
        if event not in WRITES or not self._is_ours(arguments[0]):
            return
        if event == "open" and not self._writes(*arguments[1:3]):
            return
        self.count += 1
        os.write(self.tell, b".")
        if self.strike is not None and self.count == self.strike.operation:
            os.kill(os.getpid(), self.strike.signal)
        makes = event not in ("os.remove", "os.rmdir", "shutil.rmtree", "os.rename")
        if makes and 0 < self.full_from <= self.count:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(arguments[0]))

    def _is_ours(self, path: object) -> bool:
        text = os.fsdecode(path) if isinstance(path, (str, bytes, os.PathLike)) else ""
        return os.path.abspath(text).startswith(self.home) if text else False

    @staticmethod
    def _writes(mode: object, flags: object) -> bool:
        if isinstance(mode, str):
            return any(letter in mode for letter in "wax+")
        return isinstance(flags, int) and bool(flags & (os.O_CREAT | os.O_WRONLY | os.O_RDWR))


def die_with_parent() -> None:
    """Let this process end with the one that started it, so that nothing is left over."""
    ctypes.CDLL(None).prctl(PARENT_DEATH, int(signal.SIGKILL))
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        is_int = number is signal.SIGINT
        signal.signal(number, signal.default_int_handler if is_int else signal.SIG_DFL)


def run_plain(
    command: Sequence[str], home: Path, env: Mapping[str, str], phases: Mapping[str, str],
    strike: Strike | None = None,
) -> End:  # fmt: skip
    with (home.parent / "stdout").open("wb") as out:
        process = subprocess.Popen(
            list(command), cwd=home, env=dict(env), stdin=subprocess.DEVNULL, stdout=out,
            stderr=subprocess.PIPE, preexec_fn=die_with_parent,
        )  # fmt: skip
    assert process.stderr is not None
    with process.stderr:
        code, follow = _Follow(process.pid, process.stderr.fileno(), -1, phases, strike).run()
    process.returncode = code
    return follow.end(code)


def run_forked(
    words: Sequence[str], home: Path, env: Mapping[str, str], phases: Mapping[str, str],
    strike: Strike | None = None, *, full_from: int = 0, file_limit: int = 0,
) -> End:  # fmt: skip
    """Run `heatrun` with these words in a fork of this process; as `run_plain`.

    Args:
        words: After `heatrun`.
        home: Working folder.
        env: Changes of the environment.
        phases: As `Case.phases`.
        strike: The signal and its moment; None leaves it alone.
        full_from: From this file operation on the disk is full; 0 for never.
        file_limit: Size that no file may pass [byte]; 0 for none.
    """
    (err, err_end), (ops, ops_end) = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        os.close(err)
        os.close(ops)
        try:
            die_with_parent()
            os.dup2(err_end, 2)
            out = os.open(home.parent / "stdout", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(out, 1)
            os.chdir(home)
            os.environ.update(env)
            hook = Hook(home, ops_end, strike, full_from)
            if file_limit:
                resource.setrlimit(resource.RLIMIT_FSIZE, (file_limit, file_limit))
            _command(words, hook)
        except KeyboardInterrupt:
            os._exit(EARLY)
        finally:
            os._exit(EARLY + 1)  # not reached but by a fault of this file
    os.close(err_end)
    os.close(ops_end)
    try:
        code, follow = _Follow(child, err, ops, phases, strike).run()
    finally:
        os.close(err)
        os.close(ops)
    return follow.end(code)


def _command(words: Sequence[str], hook: Hook) -> None:
    """Do what the interpreter does with a program, in a process that was forked."""
    import threading
    import traceback

    from heatrun import cli

    sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115  it lives as long as the process
    sys.stderr = open(2, "w", buffering=1, closefd=False, errors="backslashreplace")  # noqa: SIM115
    sys.argv = ["heatrun", *words]
    sys.addaudithook(hook)
    os.write(hook.tell, b"R")
    try:
        code = cli.main()
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except KeyboardInterrupt:
        raise
    except BaseException:
        traceback.print_exc()
        code = 1
    threading._shutdown()  # pyright: ignore[reportAttributeAccessIssue]
    atexit._run_exitfuncs()
    sys.stdout.flush()
    os._exit(code)


class _Follow:
    """Reads what a child says, strikes it at its moment, and waits for its end."""

    def __init__(
        self, pid: int, err: int, ops: int, phases: Mapping[str, str], strike: Strike | None
    ) -> None:
        self.pid, self.err, self.ops, self.phases, self.strike = pid, err, ops, phases, strike
        now = time.monotonic()
        self.began = {} if ops >= 0 else {"reading": now}
        self.started, self.said, self.num, self.was_struck = now, b"", 0, False
        self.phase = ""

    def run(self) -> tuple[int, _Follow]:
        """Return the exit code and what was seen."""
        code = None
        try:
            while code is None:
                self._listen(0.005)
                pid, status = os.waitpid(self.pid, os.WNOHANG)
                if pid:
                    code = os.waitstatus_to_exitcode(status)
                elif self._is_due() or time.monotonic() > self.started + LONGEST_S:
                    self._strike()
        except BaseException:  # of the campaign itself: leave no child behind
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
            raise
        self._listen(0.0)
        operation = self.strike.operation if self.strike is not None else 0
        if operation and self.num >= operation:
            self.was_struck, self.phase = True, "operation"
        if not self.phase:
            self.phase = list(self.began)[-1] if self.began else "reading"
        return code, self

    def _listen(self, wait_s: float) -> None:
        waited = [fd for fd in (self.err, self.ops) if fd >= 0]
        while ready := select.select(waited, [], [], wait_s)[0]:
            for descriptor in ready:
                data = os.read(descriptor, 65536)
                if not data:
                    waited.remove(descriptor)
                elif descriptor == self.err:
                    self._hear(data)
                else:
                    self._count(data)
            if not waited:
                time.sleep(wait_s)
                return
            wait_s = 0.0

    def _hear(self, data: bytes) -> None:
        self.said += data
        for phase, words in self.phases.items():
            if words.encode() in self.said:
                self._begin(phase)

    def _count(self, data: bytes) -> None:
        if b"R" in data:
            self._begin("reading")
        self.num += data.count(b".")
        if self.num and not self.phases:
            self._begin("writing")

    def _begin(self, phase: str) -> None:
        self.began.setdefault(phase, time.monotonic())

    def _is_due(self) -> bool:
        strike = self.strike
        if strike is None or self.was_struck or strike.operation:
            return False
        begun = self.began.get(strike.phase)
        return begun is not None and time.monotonic() >= begun + strike.delay_s

    def _strike(self) -> None:
        is_late = time.monotonic() > self.started + LONGEST_S
        if is_late:
            self.said += b"\nheld up: ended by the campaign"
        number = signal.SIGKILL if is_late or self.strike is None else self.strike.signal
        os.kill(self.pid, number)
        self.was_struck = True
        self.phase = list(self.began)[-1]
        time.sleep(STOP_S)

    def end(self, code: int) -> End:
        stops = [*self.began.values(), time.monotonic()]
        spans = {p: b - a for p, a, b in zip(self.began, stops, stops[1:], strict=False)}
        said = self.said.decode(errors="replace")
        return End(code, said, self.phase, spans, self.num, self.was_struck)
