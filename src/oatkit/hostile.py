"""Guards for files that may be damaged or hostile: XML, HDF5, and names and texts taken from a file.

Each refuses before it reads: sizes are compared with the limits below, HDF5 links and external storage are looked at
without being followed, and XML entities and document types are never expanded. What they raise is `ReadError`.
"""

import struct
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

from oatkit.errors import OatkitError, ReadError
from oatkit.hdf5_heaps import UNDEFINED, check_heap, check_heaps_of

MAX_XML_BYTES = 64 * 2**20
MAX_XML_DEPTH = 64
MAX_XML_ELEMENTS = 1_000_000
MAX_CHUNK_BYTES = 64 * 2**20
MAX_ATTRIBUTES = 100
MAX_TEXT_BYTES = 64 * 2**10
"""Limit for a text in an HDF5 file."""
HDF5_FILTERS = frozenset({1, 2, 3})
"""Deflate, shuffle and fletcher32: those that every HDF5 library has built in."""
MAX_DEFLATE_RATIO = 1100
"""Deflate cannot shrink data by more than a factor of 1032."""


def regular_file(path: Path) -> Path:
    """Return `path`, or raise `ReadError` where it is no readable regular file (a device would block for ever)."""
    try:
        if not path.exists():
            raise ReadError(f"{path}: there is no such file")
        if not path.is_file():
            raise ReadError(f"{path}: expected a file, found a folder or a device")
    except (OSError, ValueError) as error:
        raise ReadError(f"{path}: cannot be opened ({error})") from None
    return path


def read_at_most(path: Path, limit: int) -> bytes:
    """Return the content of a regular file of at most `limit` bytes."""
    size = regular_file(path).stat().st_size
    if size > limit:
        raise ReadError(f"{path}: {size} bytes; at most {limit} are read of such a file")
    try:
        return path.read_bytes()
    except OSError as error:
        raise ReadError(f"{path}: cannot be read ({error.strerror})") from None


def inside(folder: Path, name: str) -> Path:
    """Return the path of `name` in `folder`; refuse one that leads out of it, by itself or through a symbolic link."""
    try:
        path, root = folder / name, folder.resolve()
        resolved = path.resolve()
        if resolved.is_symlink():  # newer Pythons leave a circle of links as it is
            raise OSError("a circle of symbolic links")
        if resolved.is_relative_to(root) and resolved != root:
            return path
    except (OSError, ValueError, RuntimeError) as error:
        raise ReadError(f"{folder}: {name!r} is no file name ({error})") from None
    raise ReadError(f"{folder}: {name!r} leads out of the folder; only files inside it are read")


def printable(text: str, limit: int = 500) -> str:
    """Return `text` without control characters (a terminal would obey them) and cut to `limit` characters."""
    return "".join(c if c.isprintable() else "?" for c in text.strip())[:limit]


class _LimitedBuilder(TreeBuilder):
    """Builds the tree and counts; `Element` trees that are too deep crash whoever walks or frees them."""

    def __init__(self, where: Path) -> None:
        super().__init__()
        self._where, self._depth, self._count = where, 0, 0

    def start(self, tag: str, attrs: Any, /) -> Element:
        self._depth += 1
        self._count += 1
        if self._depth > MAX_XML_DEPTH:
            raise ReadError(f"{self._where}: XML nested deeper than {MAX_XML_DEPTH} elements at <{tag[:60]}>")
        if self._count > MAX_XML_ELEMENTS:
            raise ReadError(f"{self._where}: more than {MAX_XML_ELEMENTS} XML elements")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def parse_xml(content: bytes, where: Path) -> Element:
    """Return the root element of an XML text in any encoding that it declares; `where` is named in errors."""
    from defusedxml.common import DefusedXmlException
    from defusedxml.ElementTree import DefusedXMLParser

    if len(content) > MAX_XML_BYTES:
        raise ReadError(f"{where}: {len(content)} bytes of XML; at most {MAX_XML_BYTES} are read")
    parser = DefusedXMLParser(target=_LimitedBuilder(where), forbid_dtd=True)
    try:
        parser.feed(content)
        return parser.close()
    except DefusedXmlException as error:
        raise ReadError(f"{where}: XML with a document type or entities is refused ({type(error).__name__})") from None
    except (ParseError, LookupError, ValueError) as error:
        raise ReadError(f"{where}: expected complete XML, found an error: {error}") from None


@contextmanager
def open_hdf5(path: Path) -> Iterator[Any]:
    """Open an HDF5 file for reading; whatever the library finds broken, then or later, becomes a `ReadError`."""
    import h5py

    regular_file(path)
    try:
        with h5py.File(path, "r") as file:
            yield file
    except OatkitError:
        raise
    except (
        OSError,
        RuntimeError,
        LookupError,
        ValueError,
        TypeError,
        MemoryError,
        ArithmeticError,
        struct.error,
    ) as error:
        raise ReadError(f"{path}: not a complete HDF5 file, or damaged ({printable(str(error), 200)})") from None


def hdf5_dataset(file: Any, name: str, kinds: str, ndim: int | Collection[int], limit: int | None = None) -> Any:
    """Return the dataset `name` of an open file or group, checked before anything of it is read.

    `kinds` are numpy's letters for the types that it may have, `ndim` the number of axes, or those that are allowed,
    `limit` the largest number of bytes that it may declare. Refused are links other than hard ones, external and
    virtual storage, more bytes declared than can be in the file, oversized chunks, unusual filters and masses of
    attributes.
    """
    import h5py

    item = _hard_linked(file, name, "dataset", h5py.Dataset)
    problem = _wrong_type(item, kinds, ndim) or _wrong_storage(item, limit)
    if problem:
        raise ReadError(f"{_where(file, name)}: {problem}")
    return item


def hdf5_group(file: Any, name: str, limit: int) -> Any:
    """Return the group `name` of an open file or group, reached by hard links, of at most `limit` members."""
    import h5py

    group = _hard_linked(file, name, "group", h5py.Group)
    if len(group) > limit:
        raise ReadError(f"{_where(file, name)}: {len(group)} members; at most {limit} are read")
    return group


def holds_text(file: Any, name: str) -> bool:
    """Say whether the dataset `name` of an open file or group is of a type of texts."""
    import h5py

    return h5py.check_string_dtype(_hard_linked(file, name, "dataset", h5py.Dataset).dtype) is not None


def hdf5_text(file: Any, name: str) -> str:
    """Return a single text of at most `MAX_TEXT_BYTES`, of fixed or variable length, or as MATLAB's character codes.

    Guarded as `hdf5_dataset` is; the length of a text that lies in the file's heap is looked at before it is read.
    """
    import h5py

    item = _hard_linked(file, name, "text", h5py.Dataset)
    if not holds_text(file, name):
        return _of_codes(hdf5_dataset(file, name, "u", (1, 2), MAX_TEXT_BYTES), _where(file, name))
    one = prod(item.shape) == 1
    problem = _wrong_storage(item, MAX_TEXT_BYTES) or _wrong_heap(item) if one else "expected one text"
    if problem:
        raise ReadError(f"{_where(file, name)}: {problem}")
    return _decoded(item[()], _where(file, name))


def _where(file: Any, name: str) -> str:
    inside = f"{file.name}/{name}".lstrip("/")
    return f"{printable(str(file.file.filename))} '{printable(inside, 120)}'"


def _hard_linked(file: Any, name: str, what: str, kind: type) -> Any:
    """Return the member `name` if it is of a kind of h5py's and every link on the way to it a hard one."""
    import h5py

    item = file
    for part in name.split("/"):
        link = item.get(part, getlink=True) if isinstance(item, h5py.Group) else None
        if link is None:
            raise ReadError(f"{_where(file, name)}: expected a {what}, found nothing")
        if not isinstance(link, h5py.HardLink):
            raise ReadError(f"{_where(file, name)}: links are refused, found a {type(link).__name__}")
        item = item[part]
    if not isinstance(item, kind):
        raise ReadError(f"{_where(file, name)}: expected a {what}, found a {type(item).__name__}")
    return item


def _of_codes(dataset: Any, where: str) -> str:
    """Return the text that MATLAB stores as numbers of 16 bits."""
    if dataset.dtype.itemsize > 2:
        raise ReadError(f"{where}: expected a text, found numbers of type {dataset.dtype}")
    return "".join(map(chr, dataset[()].ravel().tolist()))


def _decoded(value: Any, where: str) -> str:
    """Return the text in what h5py gives for a dataset of one text: bytes, or an array that holds them."""
    stored = value if isinstance(value, bytes) else value.ravel()[0]
    try:
        return stored.decode()
    except UnicodeDecodeError:
        raise ReadError(f"{where}: expected a text in UTF-8, found {bytes(stored[:16])!r}") from None


def _wrong_heap(item: Any) -> str:
    """Say what is wrong with the length of a text that lies in the heap of the file, or nothing."""
    import h5py

    if h5py.check_string_dtype(item.dtype).length is not None:
        return ""
    offset = item.id.get_offset()
    if offset is None:
        return "" if item.id.get_storage_size() == 0 else "a text of variable length in chunks, which is not read"
    # What is stored is a reference: the length in 4 bytes, then the address of the heap in 8, then the index in it.
    with open(item.file.filename, "rb") as file:
        file.seek(offset)
        length, address = struct.unpack("<IQ", file.read(12))
    if length > MAX_TEXT_BYTES:
        return f"a text of {length} bytes; at most {MAX_TEXT_BYTES} are read"
    if address not in (0, UNDEFINED):
        check_heap(item.file.filename, item.file.userblock_size + address)
    return ""


def check_attribute_heaps(item: Any) -> None:
    """Raise `ReadError` where the texts of variable length among an object's attributes cannot be read safely."""
    import h5py

    check_heaps_of(item.file.filename, item.file.userblock_size, h5py.h5o.get_info(item.id).addr)


def _wrong_type(item: Any, kinds: str, ndim: int | Collection[int]) -> str:
    """Say what is wrong with the type of a dataset, or nothing."""
    if item.dtype.kind not in kinds or item.dtype.hasobject:
        return f"expected a type of kind '{kinds}', found {item.dtype}"
    allowed = (ndim,) if isinstance(ndim, int) else ndim
    if item.ndim not in allowed:
        return f"expected {' or '.join(map(str, allowed))} axes, found the shape {item.shape}"
    if len(item.attrs) > MAX_ATTRIBUTES:
        return f"{len(item.attrs)} attributes; at most {MAX_ATTRIBUTES} are taken"
    return ""


def _wrong_storage(item: Any, limit: int | None) -> str:
    """Say what is wrong with the way in which a dataset is stored, or nothing."""
    if item.is_virtual or item.external:
        return "the data lie in other files, which are not read"
    creation = item.id.get_create_plist()
    filters = {creation.get_filter(i)[0] for i in range(creation.get_nfilters())}
    if not filters <= HDF5_FILTERS:
        return f"the HDF5 filters {sorted(filters - HDF5_FILTERS)} are not among those that are read"
    chunk_bytes = prod(item.chunks or (0,)) * item.dtype.itemsize
    if chunk_bytes > MAX_CHUNK_BYTES:
        return f"a chunk of {chunk_bytes} bytes; at most {MAX_CHUNK_BYTES} are read"
    declared = prod(item.shape) * item.dtype.itemsize
    if limit is not None and declared > limit:
        return f"the shape {item.shape} declares {declared} bytes; at most {limit} are read"
    stored = min(item.id.get_storage_size(), Path(item.file.filename).stat().st_size)
    if declared > stored * (MAX_DEFLATE_RATIO if 1 in filters else 1):
        return f"the shape {item.shape} declares {declared} bytes, the file holds {stored}"
    return ""
