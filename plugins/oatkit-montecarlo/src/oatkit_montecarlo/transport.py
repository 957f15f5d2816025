"""Photons on their way through the body: the compiled part. Lengths in pixels, coefficients per pixel.

A photon carries a weight for each wavelength. Between two events it flies straight through the pixels, in three
dimensions though only the plane is mapped: the body is the same all along z. Kernels are serial and release the GIL.
"""

from typing import Any

import numpy as np

from oatkit_montecarlo.chance import in_circle, seeded, uniform
from oatkit_montecarlo.compiled import kernel, part

SCATTERED, AT_WALL, AT_EDGE_Y, AT_EDGE_X, STUCK = range(5)
LAUNCHED, ABSORBED, ESCAPED, ROULETTE, LOST = range(5)
FAINT = 1e-4
"""Share of its first weight below which a photon plays roulette."""
SURVIVAL = 0.1
"""Chance to survive the roulette."""
MOST_STEPS = 10_000_000
"""Pixels and events in the life of a photon; one that is caught in a clear body between mirrors must end."""


@kernel
def mean_decay(x: float) -> float:
    """Return (1 - exp(-x)) / x, the mean of the decay over an optical length x, to rounding."""
    if x < 0.02:
        return 1 - x * (1 / 2 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720)))))
    return -np.expm1(-x) / x


@kernel
def reflectance(cosine: float, ratio: float) -> float:
    """Return Fresnel's reflectance of unpolarised light inside the body; `ratio` is index of couplant over body's."""
    squared = 1 - (1 - cosine * cosine) / (ratio * ratio)
    if squared <= 0:
        return 1.0
    beyond = np.sqrt(squared)
    across = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    along = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    return (across * across + along * along) / 2


@part
def triangle(u: float, v: float, centre: np.ndarray, corner: np.ndarray, iy: int, ix: int) -> tuple[float, float]:
    """Return the gradient (x, y) of the signed distance where (u, v) = (x, y) from the centre of the pixel."""
    a, b, c, d = corner[iy, ix], corner[iy, ix + 1], corner[iy + 1, ix + 1], corner[iy + 1, ix]
    twice = 2 * centre[iy, ix]
    if abs(u) >= abs(v):
        return (b + c - twice, c - b) if u > 0 else (twice - a - d, d - a)
    return (c - d, c + d - twice) if v > 0 else (b - a, twice - a - b)


@part
def way_to_wall(
    x: float, y: float, dx: float, dy: float, most: float, centre: np.ndarray, corner: np.ndarray, iy: int, ix: int
) -> tuple[float, float, float]:
    """Return the way to where the light leaves the body within the pixel, and the outward normal (x, y) there.

    The way is infinite where no wall comes before `most`. The signed distance is linear between the diagonals of the
    pixel: of each of up to three pieces, the first end at or beyond the wall, further out than where the piece began,
    is taken, so that no wall is passed by rounding.
    """
    u, v = x - ix - 0.5, y - iy - 0.5
    one = (v - u) / (dx - dy) if dx != dy else -1.0
    two = -(u + v) / (dx + dy) if dx != -dy else -1.0
    first, second = min(one, two), max(one, two)
    begin = 0.0
    for piece in range(3):
        end = first if piece == 0 else second if piece == 1 else most
        end = min(end, most)
        if end <= begin:
            continue
        middle = (begin + end) / 2
        gx, gy = triangle(u + dx * middle, v + dy * middle, centre, corner, iy, ix)
        rise = gx * dx + gy * dy
        at_end = centre[iy, ix] + gx * (u + dx * end) + gy * (v + dy * end)
        if rise > 0 and at_end >= 0:
            size = np.hypot(gx, gy)
            return max(begin, end - at_end / rise), gx / size, gy / size
        begin = end
    return np.inf, 0.0, 0.0


@part
def fly(
    photon: np.ndarray,
    cell: np.ndarray,
    weights: np.ndarray,
    normal: np.ndarray,
    depth: float,
    steps: np.ndarray,
    centre: np.ndarray,
    corner: np.ndarray,
    walled: np.ndarray,
    absorption: np.ndarray,
    scattering: np.ndarray,
    half_band: float,
    tally: np.ndarray,
    totals: np.ndarray,
) -> tuple[int, float]:
    """Let a photon fly until something happens; return what, and the optical depth of scattering that is left.

    `photon` is x, y, z and the direction; `cell` the row and column. Absorption is continuous along the way, and what
    is tallied in a pixel is the way in it, times the weight, where that is within the lit band.
    """
    ny, nx = scattering.shape
    x, y, z, dx, dy, dz = photon[0], photon[1], photon[2], photon[3], photon[4], photon[5]
    iy, ix = cell[0], cell[1]
    across_x, across_y = 1 / abs(dx), 1 / abs(dy)
    next_x = (ix + 1 - x if dx > 0 else x - ix) * across_x if dx != 0 else np.inf
    next_y = (iy + 1 - y if dy > 0 else y - iy) * across_y if dy != 0 else np.inf
    passed = 0
    way, event = 0.0, STUCK
    for _ in range(MOST_STEPS - steps[0]):
        passed += 1
        end = max(way, min(next_x, next_y))
        mu_s = scattering[iy, ix]
        scatters = depth < mu_s * (end - way)
        if scatters:
            end = way + depth / mu_s
        leaves = False
        if walled[iy, ix]:
            to_wall, nx_, ny_ = way_to_wall(x + dx * way, y + dy * way, dx, dy, end - way, centre, corner, iy, ix)
            if way + to_wall <= end:
                end, leaves = way + to_wall, True
                normal[0], normal[1] = nx_, ny_
        absorb(weights, way, end, z, dz, half_band, iy, ix, absorption, tally, totals)
        depth -= mu_s * (end - way)
        way = end
        if leaves:
            event = AT_WALL
            break
        if scatters:
            event = SCATTERED
            break
        if next_x <= next_y:
            ahead = ix + 1 if dx > 0 else ix - 1
            if not 0 <= ahead < nx:
                event = AT_EDGE_X
                break
            ix, next_x = ahead, next_x + across_x
        else:
            ahead = iy + 1 if dy > 0 else iy - 1
            if not 0 <= ahead < ny:
                event = AT_EDGE_Y
                break
            iy, next_y = ahead, next_y + across_y
    photon[0], photon[1], photon[2] = x + dx * way, y + dy * way, z + dz * way
    cell[0], cell[1] = iy, ix
    steps[0] += passed
    return event, max(depth, 0.0)


@part
def absorb(
    weights: np.ndarray,
    begin: float,
    end: float,
    z: float,
    dz: float,
    half_band: float,
    iy: int,
    ix: int,
    absorption: np.ndarray,
    tally: np.ndarray,
    totals: np.ndarray,
) -> None:
    """Take from the weights what is absorbed on the way from `begin` to `end`, and tally the weighted way."""
    length = end - begin
    if length <= 0:
        return
    lit_begin, lit_end = begin, end
    if half_band < np.inf and dz != 0:
        one, two = (-half_band - z) / dz, (half_band - z) / dz
        lit_begin, lit_end = max(begin, min(one, two)), min(end, max(one, two))
    elif abs(z) > half_band:
        lit_end = lit_begin
    whole = lit_begin == begin and lit_end == end
    for k in range(weights.size):
        mu = absorption[iy, ix, k]
        mean = mean_decay(mu * length)
        if whole:
            tally[iy, ix, k] += weights[k] * length * mean
        elif lit_end > lit_begin:
            before, lit = mu * (lit_begin - begin), lit_end - lit_begin
            tally[iy, ix, k] += weights[k] * (1 - before * mean_decay(before)) * lit * mean_decay(mu * lit)
        lost = weights[k] * mu * length * mean
        totals[ABSORBED, k] += lost
        weights[k] -= lost


@part
def scatter(photon: np.ndarray, anisotropy: float, stream: np.ndarray) -> None:
    """Turn the direction by the phase function of Henyey and Greenstein; with anisotropy 0 to anywhere."""
    a, b, size = in_circle(stream)
    if anisotropy == 0:
        sine = 2 * np.sqrt(1 - size)
        photon[3], photon[4], photon[5] = a * sine, b * sine, 1 - 2 * size
    else:
        # size is uniform between 0 and 1 and does not depend on the angle of (a, b).
        part = (1 - anisotropy * anisotropy) / (1 + anisotropy * (1 - 2 * size))
        cosine = min(1.0, max(-1.0, (1 + anisotropy * anisotropy - part * part) / (2 * anisotropy)))
        sine = np.sqrt((1 - cosine * cosine) / size)
        turn(photon, cosine, a * sine, b * sine)


@part
def turn(photon: np.ndarray, cosine: float, along: float, aside: float) -> None:
    """Turn the direction: `cosine` of it, and two parts across, are left."""
    dx, dy, dz = photon[3], photon[4], photon[5]
    flat = np.sqrt(dx * dx + dy * dy)
    if flat > 1e-8:
        # Unit vectors across the direction are (dx dz, dy dz, -flat^2) / flat and (-dy, dx, 0) / flat.
        dx, dy, dz = (
            cosine * dx + (along * dx * dz - aside * dy) / flat,
            cosine * dy + (along * dy * dz + aside * dx) / flat,
            cosine * dz - along * flat,
        )
    else:
        dx, dy, dz = along, aside, cosine * np.sign(dz)
    shrink = 1 / np.sqrt(dx * dx + dy * dy + dz * dz)
    photon[3], photon[4], photon[5] = dx * shrink, dy * shrink, dz * shrink


@part
def launch(
    photon: np.ndarray,
    cell: np.ndarray,
    place: float,
    ratio: float,
    collimated: bool,
    cumulative: np.ndarray,
    cells: np.ndarray,
    start: np.ndarray,
    end: np.ndarray,
    outwards: np.ndarray,
    stream: np.ndarray,
) -> int:
    """Put a photon on the wall at `place` of its length, 0 to 1, and send it in; return the piece of wall."""
    target = place * cumulative[-1]
    piece = min(np.searchsorted(cumulative, target, side="right"), cumulative.size - 1)
    before = cumulative[piece - 1] if piece > 0 else 0.0
    part = (target - before) / (cumulative[piece] - before)
    cell[0], cell[1] = cells[piece, 0], cells[piece, 1]
    photon[0] = start[piece, 1] + part * (end[piece, 1] - start[piece, 1])
    photon[1] = start[piece, 0] + part * (end[piece, 0] - start[piece, 0])
    photon[2] = 0.0
    my, mx = -outwards[piece, 0], -outwards[piece, 1]
    cosine = 1.0
    if not collimated:
        # Lambert's cosine law outside, refracted: the cosine inside times what the wall lets through.
        cosine = np.sqrt(uniform(stream))
        while uniform(stream) < reflectance(cosine, ratio):
            cosine = np.sqrt(uniform(stream))
    sine, phi = np.sqrt(1 - cosine * cosine), 2 * np.pi * uniform(stream)
    photon[3] = cosine * mx - sine * np.cos(phi) * my
    photon[4] = cosine * my + sine * np.cos(phi) * mx
    photon[5] = sine * np.sin(phi)
    return piece


@part
def stays(photon: np.ndarray, normal: np.ndarray, ratio: float, stream: np.ndarray) -> bool:
    """Reflect a photon at the wall by the chance of Fresnel; return whether it stays in the body."""
    cosine = photon[3] * normal[0] + photon[4] * normal[1]
    if uniform(stream) >= reflectance(min(cosine, 1.0), ratio):
        return False
    photon[3] -= 2 * cosine * normal[0]
    photon[4] -= 2 * cosine * normal[1]
    return True


@part
def survives(weights: np.ndarray, faint: float, totals: np.ndarray, stream: np.ndarray) -> bool:
    """Let a faint photon go on with a raised weight or end, by chance, so that its mean stays; return whether."""
    for k in range(weights.size):
        if weights[k] >= faint:
            return True
    lives = uniform(stream) < SURVIVAL
    for k in range(weights.size):
        after = weights[k] / SURVIVAL if lives else 0.0
        totals[ROULETTE, k] += weights[k] - after
        weights[k] = after
    return lives


@part
def book(totals: np.ndarray, where: int, weights: np.ndarray) -> None:
    """Add the weights to a line of the totals."""
    for k in range(weights.size):
        totals[where, k] += weights[k]


@kernel
def transport(
    first: int,
    count: int,
    seed: int,
    light: tuple[Any, ...],
    wall: tuple[Any, ...],
    brightness: np.ndarray,
    medium: tuple[Any, ...],
    anisotropy: float,
    tally: np.ndarray,
    totals: np.ndarray,
) -> None:
    """Send photons number `first` to `first + count` through the body, spread evenly along its wall.

    `brightness` (piece, wavelength) is their first weight. `tally` (y, x, wavelength) gets the weighted ways, `totals`
    (5, wavelength) where the weights went.
    """
    ratio, collimated = light
    cumulative, cells, start, end, outwards = wall
    centre, corner, walled, absorption, scattering, half_band = medium
    photon, cell, normal = np.empty(6), np.empty(2, np.int64), np.empty(2)
    stream, steps = np.empty(1, np.uint64), np.empty(1, np.int64)
    weights = np.empty(brightness.shape[1])
    for number in range(count):
        seeded(stream, seed, first + number)
        place = (number + uniform(stream)) / count
        piece = launch(photon, cell, place, ratio, collimated, cumulative, cells, start, end, outwards, stream)
        faint = 0.0
        for k in range(weights.size):
            weights[k] = brightness[piece, k]
            faint = max(faint, FAINT * weights[k])
        book(totals, LAUNCHED, weights)
        depth, steps[0] = -np.log(uniform(stream)), 0
        while True:
            event, depth = fly(
                photon, cell, weights, normal, depth, steps,
                centre, corner, walled, absorption, scattering, half_band, tally, totals,
            )  # fmt: skip
            if event == AT_WALL and not stays(photon, normal, ratio, stream):
                book(totals, ESCAPED, weights)
                break
            if event == STUCK:
                book(totals, LOST, weights)
                break
            if event == SCATTERED:
                scatter(photon, anisotropy, stream)
                depth = -np.log(uniform(stream))
            elif event == AT_EDGE_X:
                photon[3] = -photon[3]
            elif event == AT_EDGE_Y:
                photon[4] = -photon[4]
            if not survives(weights, faint, totals, stream):
                break
