"""A limit of the address space (`ulimit -v`): used sparingly, or refused with a sentence.

Where an allocation fails inside compiled code, XLA's above all, the process is aborted, and no
sentence can be said any more. It has to be said before.
"""

from __future__ import annotations

import ctypes
import os
import sys

from .errors import InputError

try:
    import resource
except ImportError:  # not a POSIX system: there is no such limit
    resource = None  # type: ignore[assignment]

BYTES = {
    **dict.fromkeys(("calibrate", "compare", "discover", "demo"), 2_000_000_000),
    **dict.fromkeys(("simulate", "export", "report"), 1_700_000_000),
}
"""Address space of the commands that compile, on two cores [byte]. Measured: 1.90e9 for a quick
calibration of both orders on a record of 1800 samples; packages and code alone take 1.5e9."""

BYTES_OF_A_CORE = 50_000_000
"""For each further one: XLA starts some threads on it, with stacks of 8 MB [byte]."""

M_ARENA_MAX = -8  # malloc.h of the GNU C library
NUM_ARENAS = 2
"""Without a bound each of the 24 threads reserves 64 MB, twice what is needed in all."""


def prepare_for_limit(command: str) -> None:
    """Spare address space where it is limited; for commands, before their packages are loaded.

    Args:
        command: Its name.

    Raises:
        InputError: If the limit is below what the command needs to do anything.
    """
    if resource is None:
        return
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return
    needed = _needed(command)
    if limit < needed:
        raise InputError(
            f"the job needs more memory than there is: the address space of a process is limited "
            f"to {limit / 1e9:.1f} GB here, and {command} takes {needed / 1e9:.1f} GB on this "
            "machine.",
            remedy=f"Raise the limit: ulimit -v {needed // 1000 + 1_000_000}, or unlimited.",
        )
    if sys.platform == "linux":
        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # the GNU C library's
        if mallopt is not None:
            mallopt(M_ARENA_MAX, NUM_ARENAS)


def _needed(command: str) -> int:
    """Return the least address space in which a command was seen to work on a short record."""
    if command not in BYTES:
        return 0
    return BYTES[command] + BYTES_OF_A_CORE * max(0, (os.cpu_count() or 1) - 2)
