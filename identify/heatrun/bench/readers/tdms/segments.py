"""The segments of a TDMS file, checked before a library reads what is in them.

Layout of the lead-in: National Instruments, "TDMS File Format Internal Structure".
"""

from __future__ import annotations

import io
import struct
from typing import BinaryIO

from ...record import Finding
from ..foreign import BrokenFileError

TAG = b"TDSm"
LEAD_IN = 28
"""Length of a lead-in [bytes]: tag, contents, version, length, length of the metadata."""

BIG_ENDIAN = 1 << 6
"""Bit of the contents: the numbers of the segment have the highest byte first."""

NOT_CLOSED = 2**64 - 1
"""Length of a segment that its writer did not finish."""


def check_segments(stream: BinaryIO, where: str) -> tuple[Finding, ...]:
    """Check that the segments of a file follow each other to its end.

    Args:
        stream: The file, seekable.
        where: The file, for messages.

    Returns:
        A finding if the recorder did not close its last segment.

    Raises:
        BrokenFileError: If a segment begins with anything else, or ends beyond the file.
    """
    size = stream.seek(0, io.SEEK_END)
    position = 0
    while position < size:
        stream.seek(position)
        lead_in = stream.read(LEAD_IN)
        if len(lead_in) < LEAD_IN or not lead_in.startswith(TAG):
            raise BrokenFileError(f"no segment begins at byte {position} of {size}")
        contents = int.from_bytes(lead_in[4:8], "little")
        order = ">" if contents & BIG_ENDIAN else "<"
        length, metadata_length = struct.unpack(f"{order}QQ", lead_in[12:])
        if length == NOT_CLOSED:
            return (_not_closed(position, where),)
        if metadata_length > length or position + LEAD_IN + length > size:
            raise BrokenFileError(
                f"a segment of {length} bytes at byte {position} ends beyond the {size} bytes of "
                "the file"
            )
        position += LEAD_IN + length
    return ()


def _not_closed(position: int, where: str) -> Finding:
    return Finding(
        id="recording_not_closed",
        severity="warning",
        message=f"The recorder did not close the file: the segment at byte {position} has no "
        "length, and is read as far as it goes.",
        where=where,
        remedy="Check that the end of the test is there.",
        values={"from_byte": position},
    )
