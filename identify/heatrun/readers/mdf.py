"""Reader of MDF 4 measurement files; needs the extra `heatrun[mdf]`.

Only the channels that are asked for are read, in pieces. Formulas are not evaluated: the library
hands the text of an algebraic conversion to an evaluator of Python expressions, and where that
fails returns the raw values without a word. When it opens a file, it reads attachments whole into
memory and parses the XML of comments. So the links to history, events, attachments and comments are
blanked out on the way to it (`HIDDEN`), and it finds none. Bus traffic stays unopened.

What a file could do to a library that trusts it is told before the library follows it. asammdf
answers most damage by an exception. Three kinds it does not: a list that runs in a circle is
followed for ever, a compressed block is unpacked whatever its size, and conversions that refer to
conversions are multiplied out. That a channel lies in its record is seen from what the library has
parsed. Layout of the blocks: ASAM MCD-4 MDF, version 4.2.
"""

import contextlib
import io
import struct
import traceback
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from ..errors import InputError
from ..record.table import FRAME_CHANNEL, no_signals
from .foreign import BrokenFileError, damaged, library, reading
from .measurement import Measurement, Series, StoredChannel

HIDDEN = (96, 136)
"""First and last+1 byte of the header's links to history, hierarchy, attachments, events and
comment (ASAM MCD-4 MDF 4.2, HDBLOCK: six links from byte 88, the first leads to the data)."""


class _View(io.RawIOBase):
    """The bytes of a file, with those of `HIDDEN` read as zeros."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._at = 0  # its own, since our checks read the same stream in between

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        base = self._at if whence == io.SEEK_CUR else 0
        if whence == io.SEEK_END:
            base = self._stream.seek(0, io.SEEK_END)
        self._at = max(base + offset, 0)
        return self._at

    def readinto(self, buffer, /) -> int:
        target = memoryview(buffer).cast("B")
        self._stream.seek(self._at)
        data = self._stream.read(len(target))
        target[: len(data)] = data
        first, last = max(HIDDEN[0] - self._at, 0), min(HIDDEN[1] - self._at, len(data))
        if first < last:
            target[first:last] = bytes(last - first)
        self._at += len(data)
        return len(data)


WHAT = "an MDF 4 file"
FRAGMENT_BYTES = 8 * 2**20
"""Data held at once while one channel is picked out of them [bytes]."""

NUMBERS = range(6)  # integers and floats of either byte order
TEXTS = {6: "text", 7: "text", 8: "text", 9: "text", 17: "text", 10: "bytes", 11: "bytes",
         12: "bytes", 13: "dates", 14: "times of day", 15: "complex numbers",
         16: "complex numbers"}  # fmt: skip
"""Data types that are no numbers (ASAM MCD-4 MDF 4.2, CNBLOCK, cn_data_type)."""

FRAME = "raw bus frames"

VALUE, MASTER, VIRTUAL_MASTER, VIRTUAL = 0, 2, 3, 6  # cn_type
PLAIN_CONVERSIONS = (0, 1, 2, 4, 5, 6)  # none, linear, rational, tables of numbers
FORMULA = 3
TIME = 1  # cn_sync_type
ALL_INVALID, INVALID_BIT = 1, 2  # cn_flags
REMOTE_MASTER = 8  # cg_flags: the times stand in another group


@contextlib.contextmanager
def open_mdf(stream: BinaryIO, where: str) -> Iterator[Measurement]:
    """Open an MDF 4 file; its channels can be read until the context ends.

    Raises:
        InputError: If asammdf is not installed, or the file is damaged, cut, of an older version
            or was not closed by its recorder.
    """
    asammdf = library("asammdf", "MDF", where)
    _check_version(stream, where)
    with reading(WHAT, where):
        check_blocks(stream)
        source: Any = io.BufferedReader(_View(stream))
        options: Any = {
            "process_bus_logging": False,
            "add_array_components": False,
            "use_display_names": False,
        }
        try:
            file: Any = asammdf.MDF(source, **options)
        except Exception as error:
            _close_half_open(error)
            raise
        file.configure(read_fragment_size=FRAGMENT_BYTES)
    try:
        with reading(WHAT, where):
            channels, masters = _channels(file)
            start = file.header.start_time.isoformat()
        if channels and all(one.text == FRAME for one in channels):
            raise no_signals("MDF", where)
        yield Measurement(
            channels=channels,
            read=lambda wanted: _read(file, stream, wanted, where),
            reader=f"MDF {file.version}",
            start=start,
            time_names=masters,
        )
    finally:
        with reading(WHAT, where):
            file.close()


def _close_half_open(error: Exception) -> None:
    """Close what the library leaves half open; at its deletion it would complain on stderr."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        held: Any = frame.f_locals.get("self")
        if type(held).__module__.startswith("asammdf") and hasattr(held, "close"):
            with contextlib.suppress(Exception):
                held.close()


def _check_version(stream: BinaryIO, where: str) -> None:
    stream.seek(0)
    start = stream.read(64)
    version = start[8:12].decode("ascii", "replace").strip(" \0")
    if start.startswith(b"UnFinMF") or start[60:64] != bytes(4):
        raise InputError(
            "The recorder did not close the file: its counters are not final.",
            where=where,
            remedy="Finalise it with the recorder's tool, or with asammdf: "
            "MDF('test.mf4').save('closed.mf4').",
        )
    if not version.startswith("4."):
        raise InputError(
            f"Expected MDF 4, got version {version or 'unknown'}.",
            where=where,
            remedy="Convert it with the recorder's tool, or with asammdf: "
            "MDF('old.dat').convert('4.10').save('new.mf4').",
        )


def _channels(file: Any) -> tuple[tuple[StoredChannel, ...], tuple[str, ...]]:
    """Return the channels without the masters, and the names of the masters."""
    named = [group.channel_group.acq_name or "" for group in file.groups]
    counts = Counter(named)
    channels, masters = [], {}
    for number, group in enumerate(file.groups):
        _check_records(group)
        label = named[number]
        if not label or counts[label] > 1:
            label = f"{label} (group {number + 1})" if label else f"group {number + 1}"
        for index, channel in enumerate(group.channels):
            if channel.channel_type in (MASTER, VIRTUAL_MASTER):
                masters[channel.name] = None
                continue
            is_frame = FRAME_CHANNEL.fullmatch(channel.name)
            text = FRAME if is_frame else _text(channel, group.channel_dependencies[index])
            units = (channel.unit, getattr(channel.conversion, "unit", ""))
            unit = next(filter(None, ((one or "").strip() for one in units)), None)
            channels.append(
                StoredChannel(channel.name, label, unit, (number, index), text, _refusal(channel))
            )
    return tuple(channels), tuple(masters)


def _check_records(group: Any) -> None:
    """Refuse channels beyond their record, which the library would copy from memory of others."""
    about = group.channel_group
    size, num_bits = about.samples_byte_nr, 8 * about.invalidation_bytes_nr
    for channel in group.channels:
        begin = channel.byte_offset
        end = begin + (channel.bit_offset + channel.bit_count + 7) // 8
        if end > size and channel.channel_type not in (VIRTUAL_MASTER, VIRTUAL):
            raise BrokenFileError(f"a channel at bytes {begin} to {end} of a record of {size}")
        if channel.flags & INVALID_BIT and channel.pos_invalidation_bit >= num_bits:
            raise BrokenFileError(f"an invalidation bit beyond the {num_bits} of the record")


def _text(channel: Any, parts: object) -> str:
    """Return what a channel holds in place of numbers, empty for numbers."""
    if parts:
        return "a structure or an array"
    if channel.data_type not in NUMBERS:
        return TEXTS.get(channel.data_type, "values of unknown type")
    if channel.channel_type not in (VALUE, VIRTUAL):
        return "values of varying length"
    conversion = channel.conversion
    if conversion is not None and conversion.conversion_type not in (*PLAIN_CONVERSIONS, FORMULA):
        return "states in words"
    return ""


def _refusal(channel: Any) -> tuple[str, str] | None:
    conversion = channel.conversion
    if conversion is None and channel.conversion_addr:  # the library would return raw values
        return ("The conversion of the channel is damaged.", "Copy the file again from the bench.")
    if conversion is None or conversion.conversion_type != FORMULA:
        return None
    return (
        f"The conversion is the formula '{str(conversion.formula)[:80]}'; formulas of a file are "
        "not evaluated.",
        "Export the channel with its physical values, or with a linear conversion.",
    )


def _read(file: Any, stream: BinaryIO, wanted: Sequence[StoredChannel], where: str) -> list[Series]:
    times: dict[int, np.ndarray | None] = {}
    series = []
    for stored in wanted:
        assert isinstance(stored.key, tuple)  # keys are made by _channels
        number, index = stored.key
        at = f"{where}, channel '{stored.name}'"
        with reading(WHAT, at):
            if number not in times:
                _check_samples(file, stream, number, at)
                times[number] = _times(file, stream, number, at)
            values = _values(file, number, index)
        time_s = times[number]
        if time_s is not None and time_s.size != values.size:
            raise damaged(WHAT, at, f"{values.size} samples with {time_s.size} times")
        series.append(Series(values, time_s))
    return series


def _values(file: Any, number: int, index: int) -> np.ndarray:
    group = file.groups[number]
    channel = group.channels[index]
    if group.channel_group.cycles_nr == 0:  # the library would not come back
        return np.empty(0)
    samples, invalid = file.get(
        group=number, index=index, raw=True, samples_only=True, ignore_invalidation_bits=True
    )
    values, conversion = np.asarray(samples).astype(np.float64), channel.conversion
    if conversion is not None and conversion.conversion_type in PLAIN_CONVERSIONS:
        values = np.array(conversion.convert(values), dtype=np.float64)
    if values.ndim != 1:
        raise ValueError(f"samples of shape {values.shape}")
    if channel.flags & ALL_INVALID:
        return np.full(values.size, np.nan)
    if channel.flags & INVALID_BIT and invalid is not None:
        values[np.asarray(invalid, dtype=bool)] = np.nan
    values[np.isinf(values)] = np.nan
    return values


def _times(file: Any, stream: BinaryIO, number: int, where: str) -> np.ndarray | None:
    """Return the times of a group [s], None if it has none."""
    group = file.groups[number]
    held = number
    if group.channel_group.flags & REMOTE_MASTER:
        held = group.channel_group.cg_master_index
        _check_samples(file, stream, held, where)
    if held not in file.masters_db:
        return None
    master = file.groups[held].channels[file.masters_db[held]]
    if master.sync_type != TIME:
        raise InputError(
            "Expected samples over time; they stand over an angle, a distance or a count.",
            where=where,
            remedy="Record the channel over time.",
        )
    conversion = master.conversion
    is_plain = conversion is None or conversion.conversion_type in PLAIN_CONVERSIONS
    if master.data_type not in NUMBERS or not is_plain or _refusal(master):
        raise InputError(
            f"The times in '{master.name}' are no plain numbers.",
            where=where,
            remedy="Export the recording with its times in seconds.",
        )
    if file.groups[held].channel_group.cycles_nr == 0:  # as in _values
        return np.empty(0)
    return np.asarray(file.get_master(held), dtype=np.float64)


def _check_samples(file: Any, stream: BinaryIO, number: int, where: str) -> None:
    """Refuse a group that holds fewer bytes than its samples need."""
    group = file.groups[number]
    about = group.channel_group
    record = about.samples_byte_nr + (0 if group.uses_ld else about.invalidation_bytes_nr)
    blocks = list(group.get_data_blocks())
    held = sum(block.original_size for block in blocks)
    if about.cycles_nr and (record == 0 or held < about.cycles_nr * record):
        problem = f"{about.cycles_nr} samples of {record} bytes stated, {held} bytes found"
        raise damaged(WHAT, where, problem)
    if group.data_location:  # sorted by the library into a file of its own
        return
    for block in blocks:
        if block.block_type:
            check_unpacked_size(stream, block.address, block.compressed_size, block.original_size)


HEADER_ADDRESS = 64
BLOCK = struct.Struct("<4s4xQQ")  # id, length, number of links
LARGEST_BLOCK = 256 * 2**20
"""Unpacked size of one compressed block [bytes]; the standard recommends at most 4 MiB."""

DEFLATE_RATIO = 1032
"""Deflate packs at most this many bytes into one (258 bytes per 2 bits)."""

MOST_CONVERSION_TEXTS = 1_000_000
"""Links from conversions to further conversions, multiplied out as the library reads them."""

DATA = (b"##DT", b"##DZ", b"##DV", b"##DI", b"##SD", b"##RD", b"##RV", b"##RI", b"##DL", b"##HL",
        b"##LD")  # fmt: skip
OWNED = {b"##HD": slice(1), b"##DG": slice(3), b"##CG": slice(2), b"##CN": slice(2),
         b"##CA": slice(1), b"##HL": slice(1), b"##DL": slice(None),
         b"##LD": slice(None)}  # fmt: skip
"""Links by which a block owns others. Each block is owned once: a tree. Of the header's links only
the data are followed, see `heatrun.readers.mdf`."""

CONVERSION, VALUES = 4, 5
"""Links of a channel, to its conversion and to values of varying length or something else."""

COMPRESSED = struct.Struct("<2sBxIQQ")  # original type, kind, parameter, original and packed size
DEFLATE, TRANSPOSED_DEFLATE = 0, 1


@dataclass(frozen=True)
class Block:
    """One block: its id such as `b"##CN"`, where it begins, its length [bytes], and its links."""

    id: bytes
    address: int
    size: int
    links: tuple[int, ...]

    @property
    def data_address(self) -> int:
        """Where its own data begin [bytes]."""
        return self.address + BLOCK.size + 8 * len(self.links)


def check_blocks(stream: BinaryIO) -> None:
    """Check the blocks that a reader of the file would visit one by one.

    Raises:
        BrokenFileError: At the first block that is not as the module says.
    """
    num_texts = 0
    owned: set[int] = set()
    conversions: set[int] = set()
    todo = [(HEADER_ADDRESS, False)]
    while todo:
        address, has_ids = todo.pop()
        block = _block(stream, address)
        if address in owned:
            raise BrokenFileError(f"two links lead to the block at byte {address}")
        owned.add(address)
        if block.id == b"##DG":  # records of several groups, sorted by the library as it opens
            has_ids = _data(stream, block, "<B")[0] > 0
        elif block.id == b"##DZ":
            _check_compressed(stream, block, must_unpack=has_ids)
        elif block.id == b"##CN" and len(block.links) > VALUES:
            link, values = block.links[CONVERSION], block.links[VALUES]
            if link and link not in conversions:
                conversions.add(link)
                num_texts += _num_texts(stream, link)
            if values and _block(stream, values).id in DATA:
                todo.append((values, has_ids))
        if num_texts > MOST_CONVERSION_TEXTS:
            raise BrokenFileError("conversions that refer to each other without end")
        held = block.links[OWNED.get(block.id, slice(0))]
        todo += [(link, has_ids) for link in held if link]


def _block(stream: BinaryIO, address: int) -> Block:
    """Return the header of a block, which must lie in the file with all its links."""
    file_size = stream.seek(0, io.SEEK_END)
    if not 0 < address <= file_size - BLOCK.size:
        raise BrokenFileError(f"a block at byte {address} of {file_size}")
    stream.seek(address)
    kind, size, num_links = BLOCK.unpack(stream.read(BLOCK.size))
    if not kind.startswith(b"##"):
        raise BrokenFileError(f"no block at byte {address}")
    if address + size > file_size or BLOCK.size + 8 * num_links > size:
        name = kind[2:].decode("ascii", "replace")
        raise BrokenFileError(
            f"a {name} block of {size} bytes with {num_links} links at byte {address} ends beyond "
            f"itself or the {file_size} bytes of the file"
        )
    links = struct.unpack(f"<{num_links}Q", stream.read(8 * num_links))
    return Block(kind, address, size, links)


def _data(stream: BinaryIO, block: Block, layout: str) -> tuple:
    size = struct.calcsize(layout)
    if block.data_address + size > block.address + block.size:
        raise BrokenFileError(f"a block of {block.size} bytes at byte {block.address}")
    stream.seek(block.data_address)
    return struct.unpack(layout, stream.read(size))


def _num_texts(stream: BinaryIO, address: int) -> int:
    """Return how many links conversions below one have, itself not counted."""
    num_links = 0
    for link in filter(None, _block(stream, address).links[3:]):
        child = _block(stream, link)
        if child.id != b"##CC":
            continue
        num_links += len(child.links)
        if any(_block(stream, below).id == b"##CC" for below in filter(None, child.links[3:])):
            raise BrokenFileError("conversions within conversions within conversions")
    return num_links


def _check_compressed(stream: BinaryIO, block: Block, *, must_unpack: bool) -> None:
    _, kind, parameter, size, packed = _data(stream, block, COMPRESSED.format)
    if kind not in (DEFLATE, TRANSPOSED_DEFLATE):
        raise BrokenFileError(f"compression of kind {kind}; 0 and 1 (deflate) can be checked")
    if kind == TRANSPOSED_DEFLATE and parameter == 0:
        raise BrokenFileError("a transposed block with rows of 0 bytes")
    if block.data_address + COMPRESSED.size + packed > block.address + block.size:
        raise BrokenFileError(f"a compressed block of {packed} bytes in one of {block.size}")
    if size > min(LARGEST_BLOCK, DEFLATE_RATIO * (packed + 1)):
        raise BrokenFileError(f"{packed} compressed bytes that promise {size}")
    if must_unpack:
        check_unpacked_size(stream, block.data_address + COMPRESSED.size, packed, size)


def check_unpacked_size(stream: BinaryIO, address: int, packed: int, size: int) -> None:
    """Check that `packed` bytes from an address on unpack to `size` bytes, and to no more.

    Raises:
        BrokenFileError: If they do not.
    """
    stream.seek(address)
    unpack = zlib.decompressobj()
    try:
        num_bytes = len(unpack.decompress(stream.read(packed), size + 1))
    except zlib.error as error:
        raise BrokenFileError(f"a compressed block at byte {address}: {error}") from error
    if num_bytes != size:
        more = "more" if num_bytes > size else str(num_bytes)
        raise BrokenFileError(f"a compressed block that states {size} bytes and holds {more}")
