"""The electrical impulse response beside or inside an iThera header."""

import base64
import binascii
from pathlib import Path

import numpy as np

from oatkit.builtin.readers.response_scale import of_unit_peak
from oatkit.builtin.readers.xml_fields import Node, local_name
from oatkit.errors import ReadError
from oatkit.hostile import inside, read_at_most

FLAG = 1000.0
"""Added to the first value by the vendor's software."""


def impulse_response(header: Node, msot: Path, n_samples: int) -> tuple[np.ndarray | None, str]:
    """Return the response, time zero at index ``n // 2``, with a note; None where there is none.

    It is taken from the file ``.irf``, or else from the header itself (version 2.4), and scaled by `of_unit_peak`.
    Raises `ReadError` where it does not hold one finite number for each of `n_samples`.
    """
    content, origin = _content(header, msot, 8 * n_samples)
    if content is None:
        return None, "There is no impulse response beside or in the header: signals are taken as the ideal ones."
    if len(content) != 8 * n_samples:
        raise ReadError(f"{origin}: expected {8 * n_samples} bytes of impulse response, found {len(content)}")
    return centred(np.frombuffer(content, "<f8").copy(), origin)


def centred(values: np.ndarray, origin: str) -> tuple[np.ndarray, str]:
    """Return a stored response without flag, time zero at index ``n // 2`` and scaled, with a note.

    `origin` is the file and the place in it. Raises `ReadError` where the response is not finite, or all zeros.
    """
    if values[0] >= FLAG:
        values[0] -= FLAG
    scaled, scale = of_unit_peak(values, origin)
    middle = len(values) // 2
    in_place = abs(int(np.argmax(abs(values))) - middle) <= len(values) // 4
    moved = "" if in_place else ", moved from index 0 (where its peak is) to the centre"
    scaled = scaled if in_place else np.fft.fftshift(scaled)
    return scaled, f"Impulse response from {Path(origin).name}, divided by {scale:.4g}{moved}."


def _content(header: Node, msot: Path, expected: int) -> tuple[bytes | None, str]:
    file = inside(msot.parent, f"{msot.stem}.irf")
    if file.exists():
        return read_at_most(file, max(expected, 2**20)), str(file)
    # Presets hold an element of the same name that is just "true" or "false".
    texts = (e.text or "" for e in header.element.iter() if local_name(e) == "ImpulseResponse")
    embedded = [text.strip() for text in texts if len(text.strip()) > len("false")]
    if not embedded:
        return None, ""
    origin = f"{header.where} <ImpulseResponse>"
    try:
        return base64.b64decode("".join(embedded[0].split()), validate=True), origin
    except (binascii.Error, ValueError):
        raise ReadError(f"{origin}: expected base64, found {embedded[0][:20]!r} ...") from None
