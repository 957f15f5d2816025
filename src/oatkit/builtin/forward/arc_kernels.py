"""The two inner loops of the arc model: serial, without the GIL."""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from oatkit.compiled import fast


def _quad(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    """Return a pointer to the `index`-th group of four numbers of a contiguous array."""
    data = context.make_array(array_type)(context, builder, array).data
    place = builder.gep(data, [builder.mul(index, ir.Constant(index.type, 4))])
    return builder.bitcast(place, ir.VectorType(context.get_value_type(array_type.dtype), 4).as_pointer())


def _on_quads(combine: Callable[..., Any]) -> Any:
    """Make an intrinsic ``f(target, i, source, j)`` that stores ``combine`` of the two groups of four into the first.

    Written as four statements, numba keeps the four numbers apart and the loop around takes twice as long.
    """

    @intrinsic
    def on_quads(typing: Any, target: Any, i: Any, source: Any, j: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            to = _quad(context, builder, target, *arguments[:2])
            of = _quad(context, builder, source, *arguments[2:])
            align = target.dtype.bitwidth // 8
            builder.store(combine(builder, to, of, align), to, align=align)
            return context.get_dummy_value()

        return types.void(target, types.uintp, source, types.uintp), generate

    return on_quads


add_quad = _on_quads(lambda b, to, of, align: b.fadd(b.load(to, align=align), b.load(of, align=align)))
copy_quad = _on_quads(lambda b, to, of, align: b.load(of, align=align))


@fast
def scatter(
    rows: np.ndarray,
    columns: np.ndarray,
    y: np.ndarray,
    x: np.ndarray,
    detectors: np.ndarray,
    origins: np.ndarray,
    nodes: np.ndarray,
) -> None:
    """Scatter an image by cubic B-splines onto the time axes of some detectors.

    `rows` is the image, `columns` its transpose; `y`, `x` and `detectors` are in steps of the axes, which begin at
    the distances `origins`; `nodes`, shape ``(detector, node)``, is overwritten.
    """
    ny, nx = rows.shape
    table = np.empty(4 * nodes.shape[1], rows.dtype)
    parts = np.empty((4, nodes.shape[1]), rows.dtype)
    moments = np.empty(4 * max(ny, nx), rows.dtype)
    bins = np.empty(max(ny, nx), np.int32)
    middle_y, middle_x = 0.5 * (y[0] + y[-1]), 0.5 * (x[0] + x[-1])
    for d in range(len(origins)):
        y2 = ((y - detectors[d, 0]) ** 2).astype(rows.dtype)
        x2 = ((x - detectors[d, 1]) ** 2).astype(rows.dtype)
        origin = rows.dtype.type(origins[d])
        table[:] = 0
        # Along the axis on which the distance changes fastest, neighbouring pixels meet different bins and need not
        # wait for each other.
        if abs(middle_y - detectors[d, 0]) > abs(middle_x - detectors[d, 1]):
            _scatter_lines(columns, x2, y2, origin, bins, moments, table)
        else:
            _scatter_lines(rows, y2, x2, origin, bins, moments, table)
        _fold(table, parts, nodes[d])


@fast
def _scatter_lines(
    lines: np.ndarray,
    across2: np.ndarray,
    along2: np.ndarray,
    origin: Any,
    bins: np.ndarray,
    moments: np.ndarray,
    table: np.ndarray,
) -> None:
    for k in range(lines.shape[0]):
        _moments(lines[k], across2[k], along2, origin, bins, moments)
        for j in range(lines.shape[1]):
            add_quad(table, np.uintp(np.uint32(bins[j])), moments, np.uintp(j))


@fast
def _moments(
    line: np.ndarray, across2: Any, along2: np.ndarray, origin: Any, bins: np.ndarray, moments: np.ndarray
) -> None:
    for j in range(line.size):
        position = np.sqrt(across2 + along2[j]) - origin
        bins[j] = np.int32(position)
        offset = position - line.dtype.type(bins[j])
        first = line[j] * offset
        second = first * offset
        moments[4 * j] = line[j]
        moments[4 * j + 1] = first
        moments[4 * j + 2] = second
        moments[4 * j + 3] = second * offset


@fast
def _fold(table: np.ndarray, parts: np.ndarray, nodes: np.ndarray) -> None:
    """Turn the moments of the offsets in each bin into the coefficients of cubic B-splines."""
    for i in range(nodes.size):
        m0, m1, m2, m3 = table[4 * i], table[4 * i + 1], table[4 * i + 2], table[4 * i + 3]
        parts[0, i] = (m0 - 3 * m1 + 3 * m2 - m3) / 6
        parts[1, i] = (4 * m0 - 6 * m2 + 3 * m3) / 6
        parts[2, i] = (m0 + 3 * m1 + 3 * m2 - 3 * m3) / 6
        parts[3, i] = m3 / 6
    nodes[:2] = nodes[-2:] = 0
    for i in range(2, nodes.size - 2):
        nodes[i] = parts[0, i + 1] + parts[1, i] + parts[2, i - 1] + parts[3, i - 2]


@fast
def gather(
    nodes: np.ndarray, y: np.ndarray, x: np.ndarray, detectors: np.ndarray, origins: np.ndarray, image: np.ndarray
) -> None:
    """Add to each pixel the cubic splines of some detectors at its distances; the transpose of `scatter`."""
    table = np.zeros(4 * nodes.shape[1], nodes.dtype)
    cubics = np.empty(4 * x.size, nodes.dtype)
    bins = np.empty(x.size, np.int32)
    offsets = np.empty(x.size, nodes.dtype)
    for d in range(len(origins)):
        y2 = ((y - detectors[d, 0]) ** 2).astype(nodes.dtype)
        x2 = ((x - detectors[d, 1]) ** 2).astype(nodes.dtype)
        origin = nodes.dtype.type(origins[d])
        _expand(nodes[d], table)
        for k in range(y.size):
            _locate(y2[k], x2, origin, bins, offsets)
            for j in range(x.size):
                copy_quad(cubics, np.uintp(j), table, np.uintp(np.uint32(bins[j])))
            _add_cubics(offsets, cubics, image[k])


@fast
def _expand(nodes: np.ndarray, table: np.ndarray) -> None:
    """Turn spline coefficients into the cubic of each bin; the transpose of `_fold`."""
    for i in range(1, nodes.size - 2):
        a, b, c, d = nodes[i - 1], nodes[i], nodes[i + 1], nodes[i + 2]
        table[4 * i] = (a + 4 * b + c) / 6
        table[4 * i + 1] = (c - a) / 2
        table[4 * i + 2] = (a - 2 * b + c) / 2
        table[4 * i + 3] = (d - a + 3 * (b - c)) / 6


@fast
def _locate(across2: Any, along2: np.ndarray, origin: Any, bins: np.ndarray, offsets: np.ndarray) -> None:
    for j in range(along2.size):
        position = np.sqrt(across2 + along2[j]) - origin
        bins[j] = np.int32(position)
        offsets[j] = position - along2.dtype.type(bins[j])


@fast
def _add_cubics(offsets: np.ndarray, cubics: np.ndarray, line: np.ndarray) -> None:
    for j in range(line.size):
        t = offsets[j]
        line[j] += cubics[4 * j] + t * (cubics[4 * j + 1] + t * (cubics[4 * j + 2] + t * cubics[4 * j + 3]))
