"""Round numbers along an axis or a colour bar."""

import math
from dataclasses import dataclass

from matplotlib.ticker import MaxNLocator

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Tick:
    """A number, and how far along the axis it stands."""

    share: float
    """0 at the low end, 1 at the high one."""
    text: str


@dataclass(frozen=True)
class Axis:
    """The numbers of an axis, and the power of ten that they are to be multiplied by."""

    ticks: tuple[Tick, ...]
    factor: str = ""


def linear(low: float, high: float, count: int = 5) -> Axis:
    """Return at most about `count` round numbers between two finite values, the first below the second."""
    slack = 1e-9 * (high - low)
    found = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)
    values = [float(value) for value in found if low - slack <= value <= high + slack]
    exponent = math.floor(math.log10(max(abs(low), abs(high))))
    exponent = 0 if -2 <= exponent <= 3 else exponent
    digits = 10.0**exponent
    ticks = tuple(Tick((value - low) / (high - low), plain(round(value / digits, 9))) for value in values)
    return Axis(ticks, f"×{power(exponent)}" if exponent else "")


def logarithmic(low: float, high: float) -> Axis:
    """Return powers of ten between two positive values, the first below the second; 1, 2, 5 of each where few."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = max(1, (last - first) // 6)
    steps = (1, 2, 5) if math.log10(high / low) < 2 else (1,)
    values = [m * 10.0**k for k in range(first, last + 1, every) for m in steps if low <= m * 10.0**k <= high]
    return Axis(tuple(Tick(math.log(value / low) / math.log(high / low), _short(value)) for value in values))


def round_part(length: float) -> float:
    """Return 1, 2 or 5 times a power of ten: a fifth to a half of `length`."""
    return float(MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(0, length)[1])


def plain(value: float, digits: int = 6) -> str:
    """Write a number as in print, with its minus sign and powers of ten."""
    mantissa, _, exponent = f"{value:.{digits}g}".replace("-", "−").partition("e")
    return f"{mantissa}·{power(int(exponent.replace('−', '-')))}" if exponent else mantissa


def power(exponent: int) -> str:
    """Write a power of ten."""
    return f"10{str(exponent).translate(SUPERSCRIPTS)}"


def _short(value: float) -> str:
    return plain(value) if 1e-2 <= value < 1e4 else f"{_mantissa(value)}{power(math.floor(math.log10(value * 1.001)))}"


def _mantissa(value: float) -> str:
    leading = value / 10.0 ** math.floor(math.log10(value * 1.001))
    return "" if leading < 1.5 else f"{leading:.0f}·"
