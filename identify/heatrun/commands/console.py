"""What the commands say on the terminal."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from ..errors import InputError
from ..io.printable import printable as printable

PROGRESS = "HEATRUN_PROGRESS"
"""Environment variable; `json` makes the progress on stderr lines of JSON, for programs."""


def say(sentence: str) -> None:
    """Print a sentence about the progress on stderr."""
    _line(f"· {printable(sentence)}")


EVERY_S = 30.0
"""Time [s] between two lines about the time left where no bar can be drawn."""


@contextmanager
def bar(
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Callable[[str, float], None]]:
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
