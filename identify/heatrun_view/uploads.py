"""Files that the browser sends: of limited size, under harmless names, in a folder of their own."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import panel as pn

from heatrun.errors import InputError
from heatrun.io.whole_files import write_whole

from .store import SUFFIXES

MAX_NAME = 100
"""Longest file name that is kept [character]."""

MAX_FILES = 1000
"""Most files that are kept, be they empty."""

PIECE_BYTES = 1000
"""What a piece of a file takes in memory beside its bytes [byte]."""

RESERVED = re.compile(r"^(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that are devices on Windows."""


class UploadRoom:
    """What the uploads of all pages may take together, in memory and on the disk.

    Attributes:
        folder: Where they are kept.
        max_bytes: Limit of their sum [byte].
    """

    def __init__(self, folder: Path, max_bytes: int) -> None:
        self.folder, self.max_bytes = folder, max_bytes
        self._num_pending = 0

    def take(self, num_bytes: int) -> bool:
        """Take room for what is on its way; return False, and take nothing, if there is none."""
        kept = [path.stat().st_size for path in self.folder.iterdir()]
        wanted = sum(kept) + self._num_pending + num_bytes
        if wanted > self.max_bytes or len(kept) >= MAX_FILES:
            return False
        self._num_pending += num_bytes
        return True

    def give_back(self, num_bytes: int) -> None:
        """Give back the room of what has been kept as a file, or will not arrive."""
        self._num_pending -= num_bytes


class BoundedDropper(pn.widgets.FileDropper):
    """A drop zone that holds to the server's limit, whatever the browser sends."""

    def __init__(
        self, room: UploadRoom, when_refused: Callable[[InputError], None], **keywords: Any
    ) -> None:
        super().__init__(
            max_file_size=f"{room.max_bytes // 1_000_000}MB",
            multiple=True,
            chunk_size=2_000_000,
            **keywords,
        )
        self._room = room
        self._when_refused = when_refused
        self._num_pending: dict[str, int] = {}

    def _process_event(self, event: Any) -> None:
        if event.event_name != "upload_event":
            return  # a file that was sent stays: other pages may show it
        name, piece = str(event.data["name"]), event.data.get("data") or b""
        if event.data["chunk"] == 1:
            self._forget(name)
        elif name not in self._file_buffer:
            return  # the rest of a file that was refused
        if not self._room.take(len(piece) + PIECE_BYTES):
            self._forget(name)
            self._when_refused(
                InputError(
                    f"Uploads of all pages exceed {self._room.max_bytes / 1e6:.0f} MB.",
                    remedy="Put the file into the folder that is shown.",
                )
            )
            return
        self._num_pending[name] = self._num_pending.get(name, 0) + len(piece) + PIECE_BYTES
        super()._process_event(event)

    def arrived(self) -> dict[str, bytes | str]:
        """Return the files that have arrived; they are not kept here any longer."""
        files = dict(self.value)
        self.value.clear()
        for name in files:
            self._forget(name)
        return files

    def close(self) -> None:
        """Give back the room of files that will not arrive any more."""
        for name in list(self._num_pending):
            self._forget(name)

    def _forget(self, name: str) -> None:
        self._file_buffer.pop(name, None)
        self._room.give_back(self._num_pending.pop(name, 0))


def safe_name(name: str) -> str:
    """Return a file name that is nothing but a name.

    Folders, control characters, leading dots and everything that is not a letter, a digit or one
    of `._-+@` are dropped or become `_`.

    Args:
        name: As the browser sent it.

    Raises:
        InputError: If nothing is left, or the ending is that of no bench file.
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", name))[-1]
    kept = "".join(c if c.isalnum() or c in "._-+@" else "_" for c in last).lstrip(".-")
    ending = Path(kept.lower().removesuffix(".gz")).suffix
    if not kept or ending not in SUFFIXES | {".toml"}:
        raise InputError(
            f"Expected a bench file or a motor file; {last[:60]!r} is neither by its ending.",
            remedy=f"Known are {', '.join(sorted(SUFFIXES))}, also with .gz, and .toml.",
        )
    if len(kept) > MAX_NAME:
        tail = kept[len(kept) - 20 :]
        kept = kept[: MAX_NAME - 20] + tail
    return f"_{kept}" if RESERVED.match(kept) else kept


def keep_upload(folder: Path, name: str, content: bytes | str) -> Path:
    """Write an uploaded file, whole or not at all, and never over another one.

    Args:
        folder: Where it goes.
        name: As the browser sent it.
        content: Its bytes; text if the browser called it so.

    Returns:
        The file, with a number in its name where that was taken by another content.
    """
    data = content.encode() if isinstance(content, str) else content
    wanted = folder / safe_name(name)
    target, number = wanted, 1
    while target.exists() and target.read_bytes() != data:
        number += 1
        target = wanted.with_name(f"{number}_{wanted.name}")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(target, data)
    return target
