"""Ctrl-C ends a command at once, as a kill would: what was written before is whole."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from .exit_codes import INTERRUPTED

SENTENCE = "heatrun: interrupted; the same command resumes from what was finished.\n"


@contextmanager
def ends_at_once(*, is_last: bool = False) -> Iterator[None]:
    """Let SIGINT end the process with exit code 130 and one sentence.

    The exception that Python raises instead would travel through compiled code, samplers and
    callbacks, of which some print it, some wrap it and some swallow it. Nothing has to be tidied
    up: files are written whole or not at all, and pieces are cleared away at the next start.
    A handler that someone else has set, and threads other than the main one, are left alone.

    Args:
        is_last: Nothing is done in the process after it; from then on SIGINT is ignored, so that
            the exit code is that of the work and no library's tidying up is torn.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN if is_last else signal.default_int_handler)


def _end(number: int, frame: FrameType | None) -> None:
    # not print: the signal may have come in the middle of one
    os.write(2, f"\n{SENTENCE}".encode())
    os._exit(INTERRUPTED)
