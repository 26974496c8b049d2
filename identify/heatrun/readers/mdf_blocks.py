"""The blocks of an MDF 4 file, checked before a library follows the links between them.

The library trusts the file: a list that runs in a circle is followed for ever, a channel beyond
the end of its record is copied from and to memory that is not its own, a compressed block is
unpacked whatever its size. Here each block must lie in the file, each structural block be reached
once, each channel lie in its record and each compressed block keep to the size that it states.

Layout of the blocks: ASAM MCD-4 MDF, version 4.2.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from .foreign import BrokenFileError

HEADER_ADDRESS = 64
BLOCK = struct.Struct("<4s4xQQ")  # id, length, number of links
LARGEST_BLOCK = 256 * 2**20
"""Unpacked size of one compressed block [bytes]; the standard recommends at most 4 MiB."""

DEFLATE_RATIO = 1032
"""Deflate packs at most this many bytes into one (258 bytes per 2 bits)."""

MOST_CONVERSION_TEXTS = 1_000_000
"""Links from conversions to further conversions, multiplied out as the library reads them."""

DEEPEST = 200
"""Structures within structures; the library calls itself once for each level."""

DATA = (b"##DT", b"##DZ", b"##DV", b"##DI", b"##SD", b"##RD", b"##RV", b"##RI")
OWNED: dict[bytes, dict[int, tuple[bytes, ...]]] = {
    b"##HD": {0: (b"##DG",)},
    b"##DG": {0: (b"##DG",), 1: (b"##CG",), 2: (*DATA, b"##DL", b"##HL", b"##LD")},
    b"##CG": {0: (b"##CG",), 1: (b"##CN",)},
    b"##CN": {0: (b"##CN",), 1: (b"##CN", b"##CA")},
    b"##CA": {0: (b"##CN", b"##CA")},
    b"##HL": {0: (b"##DL", b"##LD")},
    b"##DL": {0: (b"##DL",)},
    b"##LD": {0: (b"##LD",)},
}
"""Links by which a block owns another, with what they may lead to. Each block is owned once: a
tree. Of the header's links only the data are followed, see `heatrun.readers.mdf`."""

LISTS = (b"##DL", b"##LD")
"""Blocks whose further links all lead to data of their own."""

CHILD = {b"##CN": 1, b"##CA": 0}
"""Link that leads one level deeper."""

SHARED = {b"##CG": (2, 3, 5), b"##CN": (2, 3, 4, 6, 7), b"##SI": (0, 1, 2), b"##DG": (3,)}
"""Links to names, units, comments, sources and conversions, which many blocks may share."""

VALUES = 5
"""Link of a channel to values of varying length, to a group or to an attachment."""

COMPRESSED = struct.Struct("<2sBxIQQ")  # original type, kind, parameter, original and packed size
DEFLATE, TRANSPOSED_DEFLATE = 0, 1


class BrokenBlockError(BrokenFileError):
    """A block does not say what a block of its kind says."""


@dataclass(frozen=True)
class Block:
    """One block.

    Attributes:
        id: Such as `b"##CN"`.
        address: Where it begins in the file [bytes].
        size: Its length with header and links [bytes].
        links: Addresses of other blocks, 0 for none [bytes].
    """

    id: bytes
    address: int
    size: int
    links: tuple[int, ...]

    @property
    def name(self) -> str:
        """Its id in letters."""
        return self.id[2:].decode("ascii", "replace")

    @property
    def data_address(self) -> int:
        """Where its own data begin [bytes]."""
        return self.address + BLOCK.size + 8 * len(self.links)


def read_block(stream: BinaryIO, address: int, file_size: int) -> Block:
    """Return the header of a block.

    Args:
        stream: The file.
        address: Where the block begins [bytes].
        file_size: Size of the file [bytes].

    Raises:
        BrokenBlockError: If the block does not lie in the file with all its links.
    """
    if not 0 < address <= file_size - BLOCK.size:
        raise BrokenBlockError(f"a block at byte {address} of {file_size}")
    stream.seek(address)
    kind, size, num_links = BLOCK.unpack(stream.read(BLOCK.size))
    if not kind.startswith(b"##"):
        raise BrokenBlockError(f"no block at byte {address}")
    name = kind[2:].decode("ascii", "replace")
    if address + size > file_size:
        raise BrokenBlockError(
            f"a {name} block of {size} bytes at byte {address} ends beyond the {file_size} bytes "
            "of the file"
        )
    if BLOCK.size + 8 * num_links > size:
        raise BrokenBlockError(f"a {name} block of {size} bytes with {num_links} links")
    links = struct.unpack(f"<{num_links}Q", stream.read(8 * num_links))
    return Block(kind, address, size, links)


def check_blocks(stream: BinaryIO) -> None:
    """Check every block that a reader of the file would visit.

    Args:
        stream: The file, seekable.

    Raises:
        BrokenBlockError: At the first block that is not as the module says.
    """
    file_size = stream.seek(0, io.SEEK_END)
    num_texts = 0
    owned: set[int] = set()
    shared: set[int] = set()
    todo = [_Step(HEADER_ADDRESS, (b"##HD",))]
    while todo:
        step = todo.pop()
        if not step.kinds and step.address in shared:
            continue
        block = read_block(stream, step.address, file_size)
        if step.kinds and block.id not in step.kinds:
            raise BrokenBlockError(f"a {block.name} block where none may be, at {step.address}")
        if step.kinds and step.address in owned:
            raise BrokenBlockError(f"two links lead to the block at byte {step.address}")
        (owned if step.kinds else shared).add(step.address)
        if step.depth > DEEPEST:
            raise BrokenBlockError(f"more than {DEEPEST} structures within each other")
        record = step.record
        if block.id == b"##DG":
            record = _Record(has_ids=_has_record_ids(stream, block))
        elif block.id == b"##CG":
            record = _record_of(stream, block, record.has_ids)
        elif block.id == b"##CN":
            _check_channel(stream, block, record)
        elif block.id == b"##DZ":
            _check_compressed(stream, block, must_unpack=record.has_ids)
        elif block.id == b"##CC":
            num_texts += _check_conversion(stream, block, file_size)
            if num_texts > MOST_CONVERSION_TEXTS:
                raise BrokenBlockError("conversions that refer to each other without end")
        todo += _steps(block, step.depth, record)
        if block.id == b"##CN" and len(block.links) > VALUES and block.links[VALUES]:
            target = read_block(stream, block.links[VALUES], file_size)
            if target.id in OWNED[b"##DG"][2]:
                todo.append(_Step(target.address, (target.id,), step.depth, record))


@dataclass(frozen=True)
class _Record:
    """What the groups above a block say of its records."""

    has_ids: bool = False
    sample_bytes: int = 0
    invalid_bytes: int = 0


@dataclass(frozen=True)
class _Step:
    """A link to follow; without kinds it leads to a block that others may share."""

    address: int
    kinds: tuple[bytes, ...] = ()
    depth: int = 0
    record: _Record = _Record()


def _steps(block: Block, depth: int, record: _Record) -> Iterator[_Step]:
    kinds = OWNED.get(block.id, {})
    for index, address in enumerate(block.links):
        if not address:
            continue
        if index in kinds:
            deeper = int(CHILD.get(block.id) == index)
            yield _Step(address, kinds[index], depth + deeper, record)
        elif block.id in LISTS:
            yield _Step(address, DATA, depth, record)
        elif index in SHARED.get(block.id, ()):
            yield _Step(address, (), depth, record)


def _data(stream: BinaryIO, block: Block, layout: str, skip: int = 0) -> tuple:
    size = struct.calcsize(layout)
    if block.data_address + skip + size > block.address + block.size:
        raise BrokenBlockError(f"a {block.name} block of {block.size} bytes")
    stream.seek(block.data_address + skip)
    return struct.unpack(layout, stream.read(size))


def _has_record_ids(stream: BinaryIO, block: Block) -> bool:
    (id_size,) = _data(stream, block, "<B")
    if id_size not in (0, 1, 2, 4, 8):
        raise BrokenBlockError(f"record ids of {id_size} bytes")
    return id_size > 0


def _record_of(stream: BinaryIO, block: Block, has_ids: bool) -> _Record:
    # record id, cycle count, flags, path separator and 4 reserved bytes stand in front
    sample_bytes, invalid_bytes = _data(stream, block, "<II", skip=24)
    return _Record(has_ids, sample_bytes, invalid_bytes)


def _check_channel(stream: BinaryIO, block: Block, record: _Record) -> None:
    kind, _, data_type, bit_offset, byte_offset, num_bits, flags, invalid_bit = _data(
        stream, block, "<BBBBIIII"
    )
    is_virtual = kind in (3, 6)
    end = byte_offset + (bit_offset + num_bits + 7) // 8
    if not is_virtual and (byte_offset > record.sample_bytes or end > record.sample_bytes):
        raise BrokenBlockError(
            f"a channel at bytes {byte_offset} to {end} of a record of {record.sample_bytes}"
        )
    if data_type <= 5 and num_bits > 64:
        raise BrokenBlockError(f"a number of {num_bits} bits")
    if flags & 2 and invalid_bit >= 8 * record.invalid_bytes:
        raise BrokenBlockError(
            f"invalidation bit {invalid_bit} of {8 * record.invalid_bytes} in the record"
        )


def _check_conversion(stream: BinaryIO, block: Block, file_size: int) -> int:
    """Return how many links conversions below this one have, itself not counted."""
    num_links = 0
    for link in block.links[3:]:
        if not link:
            continue
        child = read_block(stream, link, file_size)
        if child.id != b"##CC":
            continue
        num_links += len(child.links)
        for below in child.links[3:]:
            if below and read_block(stream, below, file_size).id == b"##CC":
                raise BrokenBlockError("conversions within conversions within conversions")
    return num_links


def _check_compressed(stream: BinaryIO, block: Block, *, must_unpack: bool) -> None:
    _, kind, parameter, size, packed = _data(stream, block, COMPRESSED.format)
    if kind not in (DEFLATE, TRANSPOSED_DEFLATE):
        raise BrokenBlockError(f"compression of kind {kind}; 0 and 1 (deflate) can be checked")
    if kind == TRANSPOSED_DEFLATE and parameter == 0:
        raise BrokenBlockError("a transposed block with rows of 0 bytes")
    if block.data_address + COMPRESSED.size + packed > block.address + block.size:
        raise BrokenBlockError(f"a compressed block of {packed} bytes in one of {block.size}")
    if size > min(LARGEST_BLOCK, DEFLATE_RATIO * (packed + 1)):
        raise BrokenBlockError(f"{packed} compressed bytes that promise {size}")
    if must_unpack:
        check_unpacked_size(stream, block.data_address + COMPRESSED.size, packed, size)


def check_unpacked_size(stream: BinaryIO, address: int, packed: int, size: int) -> None:
    """Check that a compressed block unpacks to the size that it states, and to no more.

    Args:
        stream: The file.
        address: Where the compressed bytes begin [bytes].
        packed: How many there are [bytes].
        size: How many they state to hold [bytes].

    Raises:
        BrokenBlockError: If they do not.
    """
    stream.seek(address)
    unpack = zlib.decompressobj()
    try:
        num_bytes = len(unpack.decompress(stream.read(packed), size + 1))
    except zlib.error as error:
        raise BrokenBlockError(f"a compressed block at byte {address}: {error}") from error
    if num_bytes != size:
        more = "more" if num_bytes > size else str(num_bytes)
        raise BrokenBlockError(f"a compressed block that states {size} bytes and holds {more}")
