"""Commands that take too long are interrupted, as Ctrl-C does, and say where they were."""

from __future__ import annotations

import contextlib
import signal
import traceback
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def interrupted_after(processor_s: float) -> Iterator[list[str]]:
    """Interrupt what takes more processor time, as Ctrl-C does.

    Args:
        processor_s: Time that it may take [s].

    Yields:
        Where it was then: functions of heatrun, the innermost last.
    """
    places: list[str] = []

    def interrupt(_signal, frame):
        inside = [f for f in traceback.extract_stack(frame) if "/heatrun/" in f.filename]
        places.extend(f"{Path(f.filename).stem}.{f.name}:{f.lineno}" for f in inside[-6:])
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGPROF, interrupt)
    signal.setitimer(signal.ITIMER_PROF, processor_s)
    try:
        yield places
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
