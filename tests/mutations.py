"""Seeded damage to files: of any kind, and of the formats that readers know, by what stands where in them."""

import io
import re
import struct
from collections.abc import Callable, Mapping

import h5py
import numpy as np

Mutation = Callable[[bytes, np.random.Generator], bytes]

NUMBERS = (
    b"", b" ", b"nan", b"inf", b"-inf", b"0", b"-0", b"1", b"-1", b"0.5", b"1e308", b"-1e308", b"5e-324", b"1e999",
    b"99999999999999999999", b"1" * 5000, b"0x10", b"1,5", b"1_0", b"true", b"none", b"'", b"\x1b[2J", b"\xff\xfe",
    "\N{ARABIC-INDIC DIGIT THREE}".encode(),
)  # fmt: skip
"""What a number in a text may be replaced by."""
WHOLES = (0, 1, 2, 7, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF)
"""What a binary number may be replaced by, cut to its width."""
NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")


def place(size: int, rng: np.random.Generator) -> int:
    """Return a position in so many bytes: every second one near the beginning, where headers are."""
    near = int(np.exp(rng.uniform(0, np.log(max(size, 2))))) - 1
    return near if rng.random() < 0.5 else int(rng.integers(max(size, 1)))


def replaced(content: bytes, start: int, stop: int, by: bytes) -> bytes:
    """Return the content with one part of it replaced."""
    return content[:start] + by + content[stop:]


# Files of any kind ---------------------------------------------------------------------------------------------------


def flip_bit(content: bytes, rng: np.random.Generator) -> bytes:
    """Flip a bit."""
    at = place(len(content), rng)
    return replaced(content, at, at + 1, bytes([content[at] ^ 1 << int(rng.integers(8))]))


def cut(content: bytes, rng: np.random.Generator) -> bytes:
    """End early."""
    return content[: int(rng.integers(len(content)))]


def copy_block(content: bytes, rng: np.random.Generator) -> bytes:
    """Write a block over another one."""
    size = int(2 ** rng.uniform(1, 13))
    source, target = place(len(content), rng), place(len(content), rng)
    block = content[source : source + size]
    return replaced(content, target, target + len(block), block)[: len(content)]


def lose_block(content: bytes, rng: np.random.Generator) -> bytes:
    """Leave a block out."""
    start = place(len(content), rng)
    return replaced(content, start, start + int(2 ** rng.uniform(0, 13)), b"")


def blank_block(content: bytes, rng: np.random.Generator) -> bytes:
    """Fill a block with one byte, as a disk does that could not read it."""
    start = place(len(content), rng)
    size = min(int(2 ** rng.uniform(1, 13)), len(content) - start)
    return replaced(content, start, start + size, bytes([int(rng.choice([0, 0, 255]))]) * size)


def set_number(content: bytes, rng: np.random.Generator) -> bytes:
    """Set a number of 2, 4 or 8 bytes to an extreme one."""
    width, start = int(rng.choice([2, 4, 8])), place(len(content), rng)
    value = int(WHOLES[rng.integers(len(WHOLES))]) & ((1 << 8 * width) - 1)
    return replaced(content, start, start + width, value.to_bytes(width, "little"))[: len(content)]


def append(content: bytes, rng: np.random.Generator) -> bytes:
    """Add bytes at the end."""
    return content + rng.bytes(int(2 ** rng.uniform(0, 10)))


ANY: Mapping[str, Mutation] = {
    "bit": flip_bit, "cut": cut, "copied block": copy_block, "lost block": lose_block, "blank block": blank_block,
    "number of bytes": set_number, "bytes at the end": append,
}  # fmt: skip


# Texts ---------------------------------------------------------------------------------------------------------------


def _edited(number: bytes, rng: np.random.Generator) -> bytes:
    """Return something in place of a number: another one of the same kind as often as one that is impossible."""
    value = float(number)
    alike = (1e3 * value, 1e-3 * value, 1e6 * value, -value, value + 1, value * (1 + 1e-9))
    choices = [repr(float(v)).encode() for v in alike] if rng.random() < 0.5 else NUMBERS
    return choices[rng.integers(len(choices))]


def edit_number(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace a number."""
    found = list(NUMBER.finditer(content))
    if not found:
        return flip_bit(content, rng)
    match = found[rng.integers(len(found))]
    return replaced(content, *match.span(), _edited(match.group(), rng))


def edit_word(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace a word by another one of the same text."""
    found = list(re.finditer(rb"[A-Za-z_][\w.-]*", content))
    if not found:
        return flip_bit(content, rng)
    one, other = (found[rng.integers(len(found))] for _ in range(2))
    return replaced(content, *one.span(), other.group())


def _by_lines(change: Callable[[list[bytes], int, np.random.Generator], None]) -> Mutation:
    def mutation(content: bytes, rng: np.random.Generator) -> bytes:
        lines = content.splitlines(keepends=True) or [b""]
        change(lines, int(rng.integers(len(lines))), rng)
        return b"".join(lines)

    return mutation


def _swap(lines: list[bytes], at: int, rng: np.random.Generator) -> None:
    other = int(rng.integers(len(lines)))
    lines[at], lines[other] = lines[other], lines[at]


TEXT: Mapping[str, Mutation] = {
    "number": edit_number,
    "another number": edit_number,
    "word": edit_word,
    "lost line": _by_lines(lambda lines, at, rng: lines.__delitem__(at)),
    "line twice": _by_lines(lambda lines, at, rng: lines.insert(at, lines[at])),
    "swapped lines": _by_lines(_swap),
    "bracket": lambda content, rng: content.replace(
        *([(b"[", b"{"), (b"]", b""), (b'"', b"'"), (b"=", b"==")][rng.integers(4)])
    ),
}


# XML -----------------------------------------------------------------------------------------------------------------

LEAF = re.compile(rb"<([\w.-]+)([^<>]*)>([^<>]*)</\1>")
DOCTYPE = b'<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>'


def _leaf(content: bytes, rng: np.random.Generator) -> re.Match[bytes]:
    """Return an element without children: each name as likely as the others, however often it occurs."""
    found = list(LEAF.finditer(content))
    names = sorted({match.group(1) for match in found})
    name = names[rng.integers(len(names))]
    alike = [match for match in found if match.group(1) == name]
    return alike[rng.integers(len(alike))]


def edit_element(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace the text of an element."""
    match = _leaf(content, rng)
    text = match.group(3)
    by = _edited(text, rng) if NUMBER.fullmatch(text) else NUMBERS[rng.integers(len(NUMBERS))]
    return replaced(content, *match.span(3), by)


def edit_attribute(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace the value of an attribute."""
    found = list(re.finditer(rb'="([^"<>]*)"', content))
    match = found[rng.integers(len(found))]
    by = _edited(match.group(1), rng) if NUMBER.fullmatch(match.group(1)) else NUMBERS[rng.integers(len(NUMBERS))]
    return replaced(content, *match.span(1), by)


def lose_element(content: bytes, rng: np.random.Generator) -> bytes:
    """Take an element out."""
    return replaced(content, *_leaf(content, rng).span(), b"")


def repeat_element(content: bytes, rng: np.random.Generator) -> bytes:
    """Put an element in a second time."""
    match = _leaf(content, rng)
    return replaced(content, match.end(), match.end(), match.group())


def swap_elements(content: bytes, rng: np.random.Generator) -> bytes:
    """Put the text of an element into another one."""
    one, other = _leaf(content, rng), _leaf(content, rng)
    return replaced(content, *one.span(3), other.group(3))


def nest(content: bytes, rng: np.random.Generator) -> bytes:
    """Put an element deep into others, or beside very many."""
    match, count = _leaf(content, rng), int(10 ** rng.uniform(1, 4.5))
    around = (b"<a>" * count, b"</a>" * count) if rng.random() < 0.5 else (b"<a/>" * count, b"")
    return replaced(content, *match.span(), around[0] + match.group() + around[1])


def declare(content: bytes, rng: np.random.Generator) -> bytes:
    """Give the text a document type, or another encoding than it has."""
    head, body = content.split(b"?>", 1)
    if rng.random() < 0.5:
        return head + b"?>" + DOCTYPE + body
    encodings = [b"utf-16", b"latin-1", b"utf-7", b"klingon", b"cp037", b""]
    return (
        re.sub(rb'encoding="[^"]*"', b'encoding="' + encodings[rng.integers(len(encodings))] + b'"', head)
        + b"?>"
        + body
    )


XML: Mapping[str, Mutation] = {
    "text of an element": edit_element, "another text of an element": edit_element, "attribute": edit_attribute,
    "lost element": lose_element, "element twice": repeat_element, "swapped texts": swap_elements, "nesting": nest,
    "declaration": declare,
}  # fmt: skip


# NumPy's files and TIFF ----------------------------------------------------------------------------------------------


def edit_header(content: bytes, rng: np.random.Generator) -> bytes:
    """Replace a number or a word in the header of a .npy file, and keep its length where that is possible."""
    size = int.from_bytes(content[8:10], "little")
    head, body = content[10 : 10 + size], content[10 + size :]
    edit = edit_number if rng.random() < 0.6 else edit_word
    edited = edit(head, rng)
    spare = len(edited) - size
    if spare > 0 and edited.endswith(b" " * spare + b"\n"):
        edited = edited[: -spare - 1] + b"\n"
    elif spare < 0:
        edited = edited[:-1] + b" " * -spare + b"\n"
    return content[:8] + len(edited).to_bytes(2, "little") + edited + body


def _tiff_entries(content: bytes) -> tuple[str, list[int], list[int]]:
    """Return the byte order, where the entries of all directories lie and where their links to the next one do."""
    order = "<" if content[:2] == b"II" else ">"
    big = struct.unpack_from(f"{order}H", content, 2)[0] == 43
    first, offset_form, count_form, entry = (8, "Q", "Q", 20) if big else (4, "I", "H", 12)
    entries, links = [], [first]
    (page,) = struct.unpack_from(order + offset_form, content, first)
    while page:
        (count,) = struct.unpack_from(order + count_form, content, page)
        start = page + struct.calcsize(count_form)
        entries += [start + entry * i for i in range(count)]
        links.append(start + entry * count)
        (page,) = struct.unpack_from(order + offset_form, content, links[-1])
    return order, entries, links


def edit_tag(content: bytes, rng: np.random.Generator) -> bytes:
    """Change number, type, count or value of a tag."""
    order, entries, _ = _tiff_entries(content)
    at, field = entries[rng.integers(len(entries))], int(rng.integers(4))
    start, form = at + (0, 2, 4, 8)[field], "HHII"[field]
    value = int(WHOLES[rng.integers(len(WHOLES))]) if rng.random() < 0.6 else int(rng.integers(1, 400))
    width = struct.calcsize(form)
    return replaced(content, start, start + width, struct.pack(order + form, value & ((1 << 8 * width) - 1)))


def edit_link(content: bytes, rng: np.random.Generator) -> bytes:
    """Let a directory follow that is none, or one that came before."""
    order, entries, links = _tiff_entries(content)
    at = links[rng.integers(len(links))]
    value = int(rng.choice([0, 1, 8, 0x7FFFFFFF, entries[0] - 2, int(rng.integers(len(content)))]))
    return replaced(content, at, at + 4, struct.pack(f"{order}I", value))


NPY: Mapping[str, Mutation] = {"header": edit_header, "another header": edit_header}
TIFF: Mapping[str, Mutation] = {"tag": edit_tag, "another tag": edit_tag, "link of pages": edit_link}


# HDF5 ----------------------------------------------------------------------------------------------------------------


def _hdf5(change: Callable[[h5py.File, list[str], np.random.Generator], None]) -> Mutation:
    """Return the mutation that opens a file and changes it, which makes all checksums right again."""

    def mutation(content: bytes, rng: np.random.Generator) -> bytes:
        stream = io.BytesIO(content)
        with h5py.File(stream, "r+") as file:
            names: list[str] = []
            file.visit(names.append)
            change(file, sorted(names), rng)
        return stream.getvalue()

    return mutation


def _put(file: h5py.File, name: str, value: object) -> None:
    attributes = dict(file[name].attrs)
    del file[name]
    file[name] = value
    for key, held in attributes.items():
        file[name].attrs[key] = held


def _dataset(file: h5py.File, names: list[str], rng: np.random.Generator) -> str:
    """Return the name of a dataset; those of a group of many alike count as one."""
    by_form: dict[str, list[str]] = {}
    for name in names:
        if isinstance(file[name], h5py.Dataset):
            by_form.setdefault(re.sub(r"\d+", "0", name), []).append(name)
    alike = by_form[sorted(by_form)[rng.integers(len(by_form))]]
    return alike[rng.integers(len(alike))]


def _other_numbers(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    name = _dataset(file, names, rng)
    values = np.array(file[name][()])
    if values.dtype.kind not in "iuf" or not values.size:
        return _put(file, name, np.nan)
    values = np.array(values, values.dtype if rng.random() < 0.5 else float)
    extreme = [0, 1, 255, 1e-9, -1, 1e3, 1e6, 1e300, np.nan, np.inf]
    with np.errstate(all="ignore"):
        at = int(rng.integers(values.size))
        if rng.random() < 0.5:
            values.flat[at] = np.array(extreme[rng.integers(len(extreme))]).astype(values.dtype)
        else:
            values = (values * rng.choice([1e-3, 1e3, 1e6, -1.0])).astype(values.dtype)
    return _put(file, name, values)


def _other_form(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    name = _dataset(file, names, rng)
    values = np.array(file[name][()])
    forms = [
        values[..., :-1] if values.ndim else values[None],
        np.repeat(values, 2, axis=-1) if values.ndim else np.array([values] * 3),
        values[None],
        values.reshape(-1),
        values.T,
        np.zeros((0,) * max(1, values.ndim)),
        np.zeros((1,) * 6),
    ]
    _put(file, name, forms[rng.integers(len(forms))])


def _other_type(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    name = _dataset(file, names, rng)
    shape = file[name].shape
    texts = h5py.string_dtype()
    made = [
        lambda: np.zeros(shape, "i1"), lambda: np.zeros(shape, "c8"), lambda: np.zeros(shape, bool),
        lambda: np.full(shape, b"text", "S4"), lambda: np.zeros(shape, "f2"), lambda: h5py.Empty("f8"),
        lambda: np.zeros(shape, [("a", "f4"), ("b", "i2")]), lambda: "text", lambda: 7.0, lambda: 2**62,
        lambda: np.full(shape or (1,), "text", object).astype(texts),
    ]  # fmt: skip
    _put(file, name, made[rng.integers(len(made))]())


def _swapped(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    one, other = _dataset(file, names, rng), _dataset(file, names, rng)
    if one != other:
        first, second = file[one][()], file[other][()]
        _put(file, one, second)
        _put(file, other, first)


def _lost(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    del file[names[rng.integers(len(names))]]


def _other_attribute(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    held = [(name, key) for name in ("/", *names) for key in file[name].attrs]
    values = [
        0,
        -1,
        40,
        4e7,
        1e300,
        np.nan,
        "text",
        b"\xff",
        np.zeros(0),
        np.arange(3.0),
        h5py.Empty("f8"),
        2**62,
        True,
    ]
    name, key = held[rng.integers(len(held))] if held else ("/", "fs")
    choice = int(rng.integers(len(values) + 2))
    if choice < len(values):
        file[name].attrs[key] = values[choice]
    elif held and choice == len(values):
        del file[name].attrs[key]
    elif held:
        file[name].attrs[key] = file[held[0][0]].attrs[held[0][1]]


def _link(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    name = names[rng.integers(len(names))]
    shape = file[name].shape if isinstance(file[name], h5py.Dataset) else (3,)
    del file[name]
    choice = int(rng.integers(6))
    if choice == 0:
        file[name] = h5py.ExternalLink("/etc/passwd", "/x")
    elif choice == 1:
        file[name] = h5py.SoftLink("/nowhere")
    elif choice == 2:
        file[name] = h5py.SoftLink(f"/{name}")
    elif choice == 3:
        file.create_dataset(name, shape, "u1", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])
    elif choice == 4:
        file[name] = file["/"]
    else:
        file.create_group(name)


def _huge(file: h5py.File, names: list[str], rng: np.random.Generator) -> None:
    name = _dataset(file, names, rng)
    shape = tuple(10 ** int(rng.integers(1, 7)) for _ in file[name].shape)
    del file[name]
    file.create_dataset(name, shape, "f8", chunks=tuple(min(n, 2**5) for n in shape) or None)


HDF5: Mapping[str, Mutation] = {
    "numbers": _hdf5(_other_numbers), "shape": _hdf5(_other_form), "type": _hdf5(_other_type),
    "swapped datasets": _hdf5(_swapped), "lost member": _hdf5(_lost), "attribute": _hdf5(_other_attribute),
    "link": _hdf5(_link), "huge shape": _hdf5(_huge),
}  # fmt: skip

FORMATS: Mapping[str, Mapping[str, Mutation]] = {
    "binary": {}, "text": TEXT, "xml": XML | TEXT, "npy": NPY, "tiff": TIFF, "hdf5": HDF5,
}  # fmt: skip
"""Edits of what stands in a file, beside the damage that files of any kind may have."""


def mutate(content: bytes, form: str, rng: np.random.Generator) -> tuple[str, bytes]:
    """Return what was done and what came of it: damage in one half of the cases, an edit in the other."""
    edits = FORMATS[form]
    kinds = edits if edits and rng.random() < 0.5 else ANY
    kind = list(kinds)[rng.integers(len(kinds))]
    changed = kinds[kind](content, rng)
    return f"{'damage' if kinds is ANY else 'edit'}: {kind}", changed
