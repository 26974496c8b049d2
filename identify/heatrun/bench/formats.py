"""Which files are measurement files, read channel by channel from the disk and never as a whole."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from ..opening import open_binary
from .measurement import Measurement

MDF = (b"MDF     ", b"UnFinMF ")
TDMS = (b"TDSm",)


@contextlib.contextmanager
def opened(
    path: str | Path, columns: Mapping[str, str] | None = None
) -> Iterator[Measurement | None]:
    """Open a measurement file for the time of the context.

    Args:
        path: Any file.
        columns: `[columns]` of the motor file.

    Returns:
        The measurement; None for a file of another format, or one that cannot be opened, which is
        for the readers of these to say.

    Raises:
        InputError: If the file is a measurement and damaged, or the library for it is missing.
    """
    where = str(path)
    try:
        with open_binary(path) as stream:
            start = stream.read(8)
    except (OSError, ValueError):
        start = b""
    if not start.startswith((*MDF, *TDMS)):
        yield None
        return
    with open_binary(path) as stream:
        if start.startswith(MDF):  # each reader loads a large library, so late
            from .mdf import open_mdf

            with open_mdf(stream, where) as measurement:
                yield measurement
        else:
            from .tdms import open_tdms

            with open_tdms(stream, where, columns) as measurement:
                yield measurement
