"""How much a message of the browser may hold, counted before anything is unpacked."""

from __future__ import annotations

import base64
import binascii
import zlib
from typing import Any

from bokeh.protocol.exceptions import ProtocolError

MAX_MESSAGE_BYTES = 8_000_000
"""Largest message as it travels; the page sends files in pieces of 2 MB."""

MAX_UNPACKED_BYTES = 16_000_000
"""Most that the packed parts of a message may hold; BokehJS packs each file's piece by gzip."""

GZIP_FLAG = 16 + zlib.MAX_WBITS
STEP_BYTES = 1 << 20


def unpacked_bytes(content: Any) -> int:
    """Return how many bytes the packed parts of a message hold.

    Bokeh unpacks them without a limit: 1.3 MB of text may become 1 GB, and a list may name
    thousands of them.

    Args:
        content: The message's content as JSON.

    Raises:
        ProtocolError: If there are more than `MAX_UNPACKED_BYTES`, or a part is damaged.
    """
    total = 0
    waiting = [content]
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            packed = each.get("data")
            if each.get("type") == "bytes" and isinstance(packed, str):
                total += _unpacked(packed, MAX_UNPACKED_BYTES - total)
            waiting.extend(each.values())
        elif isinstance(each, list):
            waiting.extend(each)
    return total


def _unpacked(packed: str, room: int) -> int:
    """Return how many bytes a part holds, at most `room`; no more than a piece is kept."""
    try:
        rest = base64.b64decode(packed)
    except (binascii.Error, ValueError) as error:
        raise ProtocolError("a part of the message is damaged") from error
    total = 0
    while rest:
        machine = zlib.decompressobj(GZIP_FLAG)
        while rest and not machine.eof:
            try:
                total += len(machine.decompress(rest, STEP_BYTES))
            except zlib.error as error:
                raise ProtocolError("a part of the message is damaged") from error
            rest = machine.unconsumed_tail
            if total > room:
                raise ProtocolError("the message unpacks to too much")
        rest = machine.unused_data.lstrip(b"\0")
    return total
