"""Compiled programs that are loaded in a thread while a command still reads its files.

Each is loaded when it is first asked for, and the command waits. Those that the last run of the
same command asked for are most likely asked for again: their names stand in a list beside them.

The thread imports nothing: two threads that import NumPy at once each get a part of it.
"""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from .caches import PROGRAM, PROGRAMS_FOLDER
from .whole_files import write_whole

T = TypeVar("T")

LIST = ".used"
"""Ending of the list of the programs that a command has used."""

MOST = 200
"""Programs of a list that are loaded."""

_NAME = re.compile(rf"[\w.-]+{re.escape(PROGRAM)}")

_asked: dict[str, None] = {}
_loading: dict[Path, Future[Any]] = {}


def load_ahead(command: str, executable: Callable[[Path], Any]) -> None:
    """Begin to load the programs that the last run of a command has used; without any, nothing.

    Not where a program was asked for by now: what one command has loaded is there for the next.
    To be called when all is imported.

    Args:
        command: Its name.
        executable: Reads a program, as `heatrun.io.programs.executable`.
    """
    place = _list_of(command)
    if place is None or _asked or _loading:
        return
    names: list[str] = []
    with suppress(OSError, ValueError):
        names = place.read_text("utf-8").split()[:MOST]
    _loading.update((place.parent / name, Future()) for name in names if _NAME.fullmatch(name))
    if _loading:
        threading.Thread(target=_load, args=(dict(_loading), executable), name="programs").start()


def _load(wanted: dict[Path, Future[Any]], executable: Callable[[Path], Any]) -> None:
    for path, future in wanted.items():
        if not threading.main_thread().is_alive():  # the command has ended
            return
        if future.set_running_or_notify_cancel():
            future.set_result(executable(path))


def taken(path: Path, executable: Callable[[Path], T]) -> T:
    """Return what is asked for: from the thread where that has begun with it, else read here."""
    _asked[path.name] = None
    future = _loading.pop(path, None)
    return executable(path) if future is None or future.cancel() else future.result()


def remember(command: str) -> None:
    """Write down which programs a command has asked for."""
    place = _list_of(command)
    if place is None or not _asked or not place.parent.is_dir():
        return
    text = "\n".join(_asked)
    with suppress(OSError):
        if not place.exists() or place.read_text("utf-8", errors="replace") != text:
            write_whole(place, text.encode())


def _list_of(command: str) -> Path | None:
    folder = os.environ.get(PROGRAMS_FOLDER)
    return Path(folder) / f"{command}{LIST}" if folder and command.isidentifier() else None
