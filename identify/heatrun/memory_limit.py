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
    **dict.fromkeys(
        (
            "calibrate",
            "compare",
            "discover",
            "demo",
            "simulate",
            "export",
            "report",
            "fleet",
            "population",
        ),
        2_400_000_000,
    ),
    "sheet": 1_200_000_000,
}
"""Address space of the commands on two cores [byte]. A quick calibration of both orders on a record
of 1800 samples takes 1.90e9, 1.5e9 of it packages and code; at 2.05e9 it now and then aborts all
the same, and the campaign of faults saw reports abort at 2.15e9 and a sheet at 1.07e9."""

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


def is_for_lack_of_memory(error: ImportError) -> bool:
    """Return whether a package could not be loaded because the address space is used up."""
    said = str(error).lower()
    return "failed to map segment" in said or "cannot allocate memory" in said


def _needed(command: str) -> int:
    """Return the least address space in which a command was seen to work on a short record."""
    if command not in BYTES:
        return 0
    return BYTES[command] + BYTES_OF_A_CORE * max(0, (os.cpu_count() or 1) - 2)
