"""What the commands say on the terminal, their exit codes, and their end by Ctrl-C."""

import json
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

from ..errors import InputError
from ..io.quantities import printable as printable

PROGRESS = "HEATRUN_PROGRESS"
"""Environment variable; `json` makes the progress on stderr lines of JSON, for programs."""


def say(sentence: str) -> None:
    """Print a sentence about the progress on stderr."""
    _line(f"· {printable(sentence)}")


EVERY_S = 30.0
"""Time [s] between two lines about the time left where no bar can be drawn."""


@contextmanager
def bar(clock: Callable[[], float] = time.monotonic) -> Iterator[Callable[[str, float], None]]:
    """Show a bar on stderr that is told a sentence and the share done, 1 when the job is done.

    Where stderr is no terminal, such as in a log, a line every `EVERY_S` takes its place.

    Args:
        clock: Gives the time [s].
    """
    if os.environ.get(PROGRESS) == "json":
        yield _tell
        return
    if not sys.stderr.isatty():
        yield _now_and_then(clock)
        return
    from tqdm import tqdm

    layout = "{desc} {percentage:3.0f}%|{bar}| {elapsed}"
    with tqdm(total=100, disable=None, file=sys.stderr, leave=False, bar_format=layout) as shown:

        def progress(sentence: str, share: float) -> None:
            shown.set_description(sentence)
            shown.n = int(100 * share)
            shown.refresh()

        yield progress


def _now_and_then(clock: Callable[[], float]) -> Callable[[str, float], None]:
    """Return what prints the first sentence, and then one every `EVERY_S`."""
    last = -math.inf

    def progress(sentence: str, share: float) -> None:
        nonlocal last
        if share < 1.0 and clock() - last >= EVERY_S:
            last = clock()
            say(f"{100.0 * share:.0f} %, {sentence}")

    return progress


def _tell(sentence: str, share: float) -> None:
    _line(json.dumps({"share": round(share, 4), "doing": sentence}))


def _line(text: str) -> None:
    """Write a line on stderr in one piece: two threads may have something to say."""
    sys.stderr.write(f"{text}\n")
    sys.stderr.flush()


def print_error(error: InputError, *, as_json: bool) -> None:
    """Print an error as a message, or as JSON with the same words.

    Nothing is imported for it: the error may be that there is no memory left.
    """
    if as_json:
        described = {"problem": error.problem, "where": error.where, "remedy": error.remedy}
        # standard output may be what cannot be written
        with suppress(OSError):
            print(json.dumps({"error": described}, indent=1, ensure_ascii=False), flush=True)
    print(f"heatrun: {printable(str(error))}", file=sys.stderr)


DONE, NOT_ALLOWED, WRONG_USE, INTERRUPTED = 0, 1, 2, 130


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
