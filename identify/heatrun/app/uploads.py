"""Files that the browser sends: of limited size, under harmless names, in a folder of their own."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import panel as pn

from ..errors import InputError
from ..whole_files import write_whole
from .folder import SUFFIXES

MAX_NAME = 100
"""Longest file name that is kept [character]."""

RESERVED = re.compile(r"^(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)
"""Names that are devices on Windows."""


class BoundedDropper(pn.widgets.FileDropper):
    """A drop zone that holds to its limit on the server, whatever the browser sends."""

    def __init__(
        self, max_bytes: int, when_refused: Callable[[InputError], None], **keywords: Any
    ) -> None:
        super().__init__(
            max_file_size=f"{max_bytes // 1_000_000}MB",
            multiple=True,
            chunk_size=2_000_000,
            **keywords,
        )
        self._max_bytes = max_bytes
        self._when_refused = when_refused
        self._num_received = 0

    def _process_event(self, event: Any) -> None:
        data = event.data
        self._num_received += len(data.get("data") or b"")
        if self._num_received > self._max_bytes:
            self._file_buffer.clear()
            self._when_refused(
                InputError(
                    f"Uploads of this page exceed {self._max_bytes / 1e6:.0f} MB.",
                    remedy="Put the file into the folder that is shown.",
                )
            )
            return
        super()._process_event(event)


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
