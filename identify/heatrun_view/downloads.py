"""Files that the page hands out: read when they are asked for, from inside their folder alone."""

from __future__ import annotations

import io
from pathlib import Path

import panel as pn

from heatrun.errors import InputError

from .runs import MAX_BYTES
from .server.confined import read_inside


def download(path: Path, root: Path, *, width: int) -> pn.widgets.FileDownload:
    """Return a button that hands out a file.

    Args:
        path: The file.
        root: The folder outside of which nothing is read, with links resolved.
        width: Of the button [px].
    """

    def content() -> io.BytesIO:
        try:
            return io.BytesIO(read_inside(root, path, MAX_BYTES))
        except InputError as error:
            button.label = f"{path.name} cannot be read"
            return io.BytesIO(f"{error}\n".encode(errors="backslashreplace"))

    button = pn.widgets.FileDownload(
        callback=content, filename=path.name, label=path.name, button_type="default", width=width
    )
    return button
