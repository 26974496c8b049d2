"""Logs of raw bus frames (CAN, LIN, FlexRay): bytes, of which a DBC makes signals."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

from ...errors import InputError

BLF = b"LOGG"
"""First bytes of a log of Vector's binary format."""

FRAME_CHANNEL = re.compile(
    r"(?:CAN|LIN|FLX|ETH|MOST|K_LINE|USB)_\w*(?:Frame|Error|Message|Pdu|WakeUp|Spike)\w*(?:\..*)?"
)
"""Names that ASAM MDF, bus logging, gives to channels of frames."""

NUM_LINES = 200
BETWEEN = re.compile(r"[\s,;|]+")
LENGTH = re.compile(r"[\[(]?([0-9]{1,2})[\])]?")
BYTE = re.compile(r"(?:0x)?[0-9A-Fa-f]{2}")
BYTE_ALONE = re.compile(r"0[0-9A-Fa-f]|[0-9A-Fa-f]?[A-Fa-f][0-9A-Fa-f]?|0x..")
"""A byte that no number of a table is written as."""

FIRST_LINES = re.compile(r"base (?:hex|dec)\s+timestamps|;\$FILEVERSION=|\*+BUSMASTER")
"""Of ASC, TRC and BUSMASTER."""

CANDUMP = re.compile(r"^\(?[0-9.]+\)?\s+\w+\s+[0-9A-Fa-f]{3,8}##?[0-9A-Fa-fR]")
NAMES_OF_FRAMES = (
    frozenset(("id", "canid", "arbitrationid", "identifier", "messageid", "msgid", "frameid")),
    frozenset(("dlc", "len", "datalength", "databytes", "data", "data0", "d1", "byte0")),
)
"""A header of frames names one of each, in lower case and letters alone."""

REMEDY = (
    "Decode it with the DBC of the bus first. With asammdf, for an MDF: "
    "MDF('log.mf4').extract_bus_logging({'CAN': [('bus.dbc', 0)]}).save('signals.mf4'); any "
    "other log becomes one by python-can: can_logconvert LOG log.mf4. Then read signals.mf4."
)


def no_signals(kind: str, where: str) -> InputError:
    """Return the error for a log of frames.

    Args:
        kind: What the file is.
        where: The file.
    """
    return InputError(
        f"The file holds raw bus frames ({kind}), no signals.", where=where, remedy=REMEDY
    )


def kind_of_frames(text: str) -> str:
    """Return of what kind a log of frames is, empty for any other text.

    Args:
        text: With line ends as in Python.
    """
    filled = (line.strip() for line in text.splitlines()[: 5 * NUM_LINES])
    lines = list(itertools.islice((line for line in filled if line), NUM_LINES))
    if any(_names_frames(line) for line in lines[:10]):
        return "a table of frames"
    if any(FIRST_LINES.match(line) for line in lines[:10]):
        return "a log of a bus analyser"
    frames = sum(CANDUMP.match(line) is not None for line in lines)
    if 2 * frames > len(lines):
        return "candump"
    held = [data for line in lines if (data := _bytes_of(BETWEEN.split(line)))]
    is_hexadecimal = any(BYTE_ALONE.fullmatch(byte) for data in held for byte in data)
    return "bytes by line" if 2 * len(held) > len(lines) and is_hexadecimal else ""


def _bytes_of(cells: Sequence[str]) -> Sequence[str]:
    """Return the bytes of a line behind their number, as in "123 Rx d 3 00 1A FF"; or nothing."""
    for place, cell in enumerate(cells[1:], 1):
        length = LENGTH.fullmatch(cell)
        data = list(itertools.takewhile(BYTE.fullmatch, cells[place + 1 :]))
        if length and len(data) >= int(length[1]) > 1:
            return data[: int(length[1])]
    return ()


def _names_frames(line: str) -> bool:
    names = {re.sub(r"[^a-z0-9]", "", name.casefold()) for name in re.split(r"[,;\t|]", line)}
    return len(names) > 2 and all(names & wanted for wanted in NAMES_OF_FRAMES)
