"""The chain of pages in a TIFF file, followed to its end before a library does."""

import struct
from pathlib import Path
from typing import IO

from oatkit.errors import ReadError
from oatkit.hostile import regular_file

MAX_PAGES = 100_000
MAX_TAGS = 4096
BYTE_ORDERS = {b"II": "<", b"MM": ">"}
FORMS = {42: ("I", 4, "H", 12), 43: ("Q", 8, "Q", 20)}
"""By version: format of an offset, where the first one stands, format of the number of tags, bytes of a tag."""


def count_pages(path: Path) -> int:
    """Return the number of pages.

    Raises `ReadError` where the chain leads out of the file or in a circle, or is longer than 100 000 pages: the
    library follows a circle without end, and takes a chain that is broken for one that has ended.
    """
    seen: set[int] = set()
    try:
        with open(regular_file(path), "rb") as file:
            order, version = _start(file)
            offset_form, first, count_form, tag_bytes = FORMS[version]
            offset = _number(file, first, order + offset_form)
            while offset and offset not in seen and len(seen) < MAX_PAGES:
                seen.add(offset)
                n_tags = _number(file, offset, order + count_form)
                if n_tags > MAX_TAGS:
                    raise ReadError(f"{path}: page {len(seen) - 1} has {n_tags} tags; at most {MAX_TAGS} are read")
                tags = offset + struct.calcsize(order + count_form)
                offset = _number(file, tags + n_tags * tag_bytes, order + offset_form)
    except (OSError, LookupError, ValueError, OverflowError, struct.error):
        after = f" after {len(seen)} pages" if seen else ""
        raise ReadError(f"{path}: not a TIFF file, or damaged: its chain of pages breaks off{after}") from None
    if offset:
        raise ReadError(f"{path}: damaged: its chain of pages does not end after {len(seen)} of them")
    return len(seen)


def _start(file: IO[bytes]) -> tuple[str, int]:
    """Return byte order and version."""
    order = BYTE_ORDERS[file.read(2)]
    return order, _number(file, 2, f"{order}H")


def _number(file: IO[bytes], offset: int, form: str) -> int:
    file.seek(offset)
    return int(struct.unpack(form, file.read(struct.calcsize(form)))[0])
