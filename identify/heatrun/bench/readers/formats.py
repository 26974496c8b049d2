"""Which files are measurement files, read channel by channel from the disk and never as a whole."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import BinaryIO

from ..channels.claims import Columns
from .measurement import Measurement

MDF = (b"MDF     ", b"UnFinMF ")
TDMS = (b"TDSm",)


@contextlib.contextmanager
def opened(
    stream: BinaryIO, where: str, columns: Columns | None = None
) -> Iterator[Measurement | None]:
    """Open a measurement file for the time of the context.

    Args:
        stream: Any file, seekable.
        where: The file, for messages.
        columns: `[columns]` of the motor file.

    Returns:
        The measurement; None for a file of another format.

    Raises:
        InputError: If the file is a measurement and damaged, or the library for it is missing.
    """
    stream.seek(0)
    start = stream.read(8)
    stream.seek(0)
    if start.startswith(MDF):  # each reader loads a large library, so late
        from .mdf.reader import open_mdf

        with open_mdf(stream, where) as measurement:
            yield measurement
    elif start.startswith(TDMS):
        from .tdms.reader import open_tdms

        with open_tdms(stream, where, columns) as measurement:
            yield measurement
    else:
        yield None
