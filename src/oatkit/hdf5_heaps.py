"""The heaps in an HDF5 file, where texts of variable length lie, looked at before the HDF5 library does.

Where a part of such a heap was lost and reads as zeros, the library follows pieces of no length for ever (seen with
HDF5 2.0), and nothing but a kill ends it. The layout is that of the HDF5 File Format Specification, version 3.0,
sections III.E (global heap) and IV.A.1 (object headers).
"""

import mmap
import os
import struct
from collections.abc import Iterator

import numpy as np

from oatkit.errors import ReadError

HEAP = b"GCOL\x01\0\0\0"
"""Signature, version and reserved bytes of a heap."""
PIECE_HEADER = 16
MAX_HEAP_BYTES = 2**24
MAX_HEADER_BYTES = 2**22
MAX_BLOCKS = 256
"""Of one object header."""
CONTINUATION, ATTRIBUTE, ATTRIBUTES_ELSEWHERE = 0x10, 0x0C, 0x15
"""Types of messages in an object header."""
SHARED = 2
UNDEFINED = 2**64 - 1


def check_heap(path: str, address: int) -> None:
    """Raise `ReadError` unless an intact heap begins at this byte of the file."""
    with open(path, "rb") as file:
        _check(file.fileno(), path, address)


def check_heaps_of(path: str, base: int, header: int) -> None:
    """Raise `ReadError` unless all heaps are intact to which attributes of an object may refer.

    `header` is the address of the object's header and `base` that of the byte from which addresses are counted. Where
    the attributes lie outside the header (newer formats, more than eight of them), the whole file is searched.
    """
    with open(path, "rb") as file:
        number, size = file.fileno(), os.fstat(file.fileno()).st_size
        try:
            found = {a for block in _blocks(number, path, base, header) for a in _addresses(block, size - base)}
            heaps = [base + a for a in sorted(found) if os.pread(number, 4, base + a) == HEAP[:4]]
        except _ElsewhereError:
            heaps = list(_everywhere(number))
        except struct.error:
            raise _broken(path, base + header) from None
        for address in heaps:
            _check(number, path, address)


class _ElsewhereError(Exception):
    """The attributes of an object are not in its header."""


def _everywhere(file: int) -> Iterator[int]:
    """Yield where a heap may begin, anywhere in a file."""
    with mmap.mmap(file, 0, access=mmap.ACCESS_READ) as content:
        at = content.find(HEAP)
        while at >= 0:
            yield at
            at = content.find(HEAP, at + 1)


def _check(file: int, path: str, address: int) -> None:
    head = os.pread(file, len(HEAP) + 8, address)
    size = int.from_bytes(head[len(HEAP) :], "little")
    if head[: len(HEAP)] != HEAP or size > MAX_HEAP_BYTES:
        raise _damaged(path, address)
    content = os.pread(file, size, address)
    at = len(HEAP) + 8
    while at + PIECE_HEADER <= len(content):
        index, _, _, length = struct.unpack_from("<HHIQ", content, at)
        # A free piece, of index 0, counts its header in its length.
        step = length if index == 0 else PIECE_HEADER + -(-length // 8) * 8
        if not PIECE_HEADER <= step <= len(content) - at:
            raise _damaged(path, address)
        at += step
    if len(content) < size:
        raise _damaged(path, address)


def _damaged(path: str, address: int) -> ReadError:
    return ReadError(f"{path}: damaged: the heap of texts at byte {address} is broken")


def _broken(path: str, address: int) -> ReadError:
    return ReadError(f"{path}: damaged: the object header at byte {address} is broken")


def _addresses(block: bytes, size: int) -> Iterator[int]:
    """Yield what may be addresses in a block: numbers of 8 bytes, anywhere, that point into the file."""
    padded = np.frombuffer(block + bytes(8), np.uint8)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 8)[: len(block)]
    values = np.ascontiguousarray(windows).view("<u8").ravel()
    yield from np.unique(values[(values > 0) & (values < size)]).tolist()


def _blocks(file: int, path: str, base: int, header: int) -> Iterator[bytes]:
    """Yield the blocks of an object header, in either version of the format."""
    start = os.pread(file, 64, base + header)
    new = start[:4] == b"OHDR"
    waiting = [_first_block_new(start, header) if new else (header + 16, *struct.unpack_from("<I", start, 8))]
    seen: set[int] = set()
    while waiting:
        address, length = waiting.pop()
        if address in seen or len(seen) > MAX_BLOCKS or length > MAX_HEADER_BYTES:
            raise _broken(path, base + header)
        seen.add(address)
        block = os.pread(file, length, base + address)
        yield block
        for kind, flags, body in _messages(block, new, start[5] if new else 0):
            if (kind == ATTRIBUTE and flags & SHARED) or (kind == ATTRIBUTES_ELSEWHERE and _elsewhere(body)):
                raise _ElsewhereError
            if kind == CONTINUATION and len(body) >= 16:
                waiting.append(struct.unpack_from("<QQ", body))


def _first_block_new(start: bytes, header: int) -> tuple[int, int]:
    """Return where the first block of a header of version 2 begins, and its length."""
    flags = start[5]
    at = 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
    width = 1 << (flags & 3)
    return header + at + width, int.from_bytes(start[at : at + width], "little")


def _messages(block: bytes, new: bool, flags: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield type, flags and body of the messages in a block."""
    form = "<BHB" if new else "<HHB3x"
    head = struct.calcsize(form) + (2 if new and flags & 4 else 0)
    at = 4 if block[:4] == b"OCHK" else 0
    while at + head <= len(block):
        kind, length, message_flags = struct.unpack_from(form, block, at)
        yield kind, message_flags, block[at + head : at + head + length]
        at += head + length


def _elsewhere(body: bytes) -> bool:
    """Say whether an attribute info message points to a heap of attributes."""
    at = 2 + (2 if body[1:2] and body[1] & 1 else 0)
    return int.from_bytes(body[at : at + 8].ljust(8, b"\xff"), "little") != UNDEFINED
