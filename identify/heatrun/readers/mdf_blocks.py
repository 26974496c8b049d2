"""What an MDF 4 file could do to a library that trusts it, told before the library follows it.

asammdf answers most damage by an exception. Three kinds it does not: a list that runs in a circle
is followed for ever, a compressed block is unpacked whatever its size, and conversions that refer
to conversions are multiplied out. (That a channel lies in its record `heatrun.readers.mdf` sees
from what the library has parsed.)

Layout of the blocks: ASAM MCD-4 MDF, version 4.2.
"""

from __future__ import annotations

import io
import struct
import zlib
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
