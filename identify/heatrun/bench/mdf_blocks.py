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

OWNED: dict[bytes, tuple[int, ...]] = {
    b"##HD": (0, 1, 2, 3, 4),
    b"##DG": (0, 1, 2),
    b"##CG": (0, 1, 4),
    b"##CN": (0, 1),
    b"##CA": (0,),
    b"##HL": (0,),
    b"##SR": (0, 1),
    b"##FH": (0,),
    b"##AT": (0,),
    b"##EV": (0,),
    b"##CH": (0, 1),
}
"""Links by which a block owns another, so that each block is owned once: a tree. Lists of data
own all that they link to; names, units, comments, sources and conversions are shared."""

LISTS = (b"##DL", b"##LD")
SHARED = {b"##CG": (2, 3, 5), b"##CN": (2, 3, 4, 6, 7), b"##SI": (0, 1, 2), b"##DG": (3,)}
DATA_LINK = {b"##CN": 5}
CHILDREN = {b"##CN": (1,), b"##CA": (0,), b"##CH": (1,)}
"""Links that lead one level deeper."""

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
    todo = [(HEADER_ADDRESS, 0, b"", _Record(), True)]
    while todo:
        address, depth, parent, record, is_owned = todo.pop()
        if not is_owned and address in shared:
            continue
        if address in owned and is_owned:
            raise BrokenBlockError(f"two links lead to the block at byte {address}")
        block = read_block(stream, address, file_size)
        (owned if is_owned else shared).add(address)
        if depth > DEEPEST:
            raise BrokenBlockError(f"more than {DEEPEST} structures within each other")
        if block.id == b"##DG":
            record = _Record(has_ids=_has_record_ids(stream, block))
        elif block.id == b"##CG":
            record = _record_of(stream, block, record.has_ids)
        elif block.id == b"##CN":
            _check_channel(stream, block, record)
        elif block.id == b"##DZ":
            _check_compressed(stream, block, must_unpack=record.has_ids or parent == b"##CN")
        elif block.id == b"##CC":
            num_texts += _check_conversion(stream, block, file_size)
            if num_texts > MOST_CONVERSION_TEXTS:
                raise BrokenBlockError("conversions that refer to each other without end")
        for target, is_owned_there, is_deeper in _links(block):
            todo.append((target, depth + is_deeper, block.id, record, is_owned_there))
        if block.id == b"##CN" and len(block.links) > DATA_LINK[b"##CN"]:
            target = block.links[DATA_LINK[b"##CN"]]
            if target and read_block(stream, target, file_size).id not in (b"##CG", b"##AT"):
                todo.append((target, depth, b"##CN", record, True))


@dataclass(frozen=True)
class _Record:
    """What the groups above a block say of its records."""

    has_ids: bool = False
    sample_bytes: int = 0
    invalid_bytes: int = 0


def _links(block: Block) -> Iterator[tuple[int, bool, bool]]:
    """Yield the links to follow: address, whether owned, whether one level deeper."""
    owned = range(len(block.links)) if block.id in LISTS else OWNED.get(block.id, ())
    for index in owned:
        if index < len(block.links) and block.links[index]:
            yield block.links[index], True, index in CHILDREN.get(block.id, ())
    for index in SHARED.get(block.id, ()):
        if index < len(block.links) and block.links[index]:
            yield block.links[index], False, False


def _data(stream: BinaryIO, block: Block, layout: str, skip: int = 0) -> tuple:
    size = struct.calcsize(layout)
    if block.data_address + skip + size > block.address + block.size:
        raise BrokenBlockError(f"a {block.id[2:].decode()} block of {block.size} bytes")
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
