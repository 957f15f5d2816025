"""A simulated scan of a phantom."""

from typing import Literal

import numpy as np

from oatkit.api import ForwardModel
from oatkit.content import check_range
from oatkit.data import Geometry, Grid, Scan
from oatkit.errors import ValidationError
from oatkit.simulate.arrays import msot_geometry
from oatkit.simulate.phantoms import Phantom, truth


def simulate_scan(
    phantom: str | Phantom,
    forward_model: ForwardModel,
    *,
    geometry: Geometry | None = None,
    field_of_view_m: float = 25e-3,
    pixels: int = 541,
    snr_db: float | None = 32.0,
    snr_window: Literal["useful", "record"] = "useful",
    frames: int = 1,
    seed: int = 0,
) -> Scan:
    r"""Return the noisy signals of a phantom as a scan; `truth(phantom, grid)` is the image to compare with.

    The phantom is a name in `PHANTOMS` or a function from a grid to an `Image`; each plane of that image becomes a
    wavelength (700 nm where it names none). It is sampled on its own grid of `pixels` a side, by default more than
    twice as fine as a reconstruction of 200 or 256 and, 541 being prime, no multiple of any: data that come off the
    very grid they are reconstructed on flatter every method (the "inverse crime"). The default `geometry` is
    `msot_geometry()`.

    White Gaussian noise, drawn by `seed` and independent in each frame, is added to the whole record. Its level is

    .. math:: \mathrm{SNR} = 20 \log_{10} \frac{\mathrm{rms}(signal)}{\sigma(noise)}

    with the rms of the noise-free signals over all detectors and wavelengths and those samples that `snr_window`
    names: ``"useful"``, the samples that the field of view can reach (see `useful_window`), or ``"record"``, all of
    them. The longer the empty parts of the record, the weaker is the noise at a given SNR over the record.
    `snr_db=None` adds no noise.

    Raises `ValidationError` for values out of range, for a field of view that the detectors cannot see, and where the
    phantom gives no signal.
    """
    geometry = msot_geometry() if geometry is None else geometry
    _check(pixels, field_of_view_m, snr_db, snr_window, frames)
    grid = Grid((pixels, pixels), field_of_view_m / pixels)
    geometry.check_grid(grid)
    image = truth(phantom, grid)
    operator = forward_model.operator(geometry, grid)
    signals = np.stack([np.asarray(operator.matvec(plane.ravel()), float) for plane in image.values])
    signals = signals.reshape(len(signals), *geometry.shape)
    window = useful_window(geometry, grid) if snr_window == "useful" else np.ones(geometry.shape, bool)
    name = phantom if isinstance(phantom, str) else getattr(phantom, "__name__", "phantom")
    noise = "no noise" if snr_db is None else f"SNR {snr_db:g} dB over the {snr_window} window, seed {seed}"
    return Scan(
        _noisy(signals, _noise_level(signals[:, window], snr_db), frames, seed),
        geometry,
        image.wavelengths_nm or (700.0,),
        name=name,
        source=f"simulated from the phantom '{name}' by the forward model '{forward_model.name}'",
        speed_of_sound_source="simulation",
        notes=(f"simulated on {pixels} x {pixels} pixels over {field_of_view_m * 1e3:g} mm; {noise}",),
    )


def useful_window(geometry: Geometry, grid: Grid) -> np.ndarray:
    """Return which samples a point of `grid` can reach: shape ``(detector, sample)``, bool.

    It is pure geometry: those at distances between the nearest and the farthest point of the grid from the detector.
    The ringing of an impulse response may go beyond.
    """
    near, far = geometry.reach(grid)
    distance = geometry.times_s * geometry.speed_of_sound_m_s
    return (distance >= near[:, None]) & (distance <= far[:, None])


def _check(pixels: int, field_of_view_m: float, snr_db: float | None, snr_window: str, frames: int) -> None:
    check_range("pixels", pixels, 2, 10_000, "a number of pixels along one side")
    check_range("field_of_view_m", field_of_view_m, 1e-4, 1.0, "the unit is m, so 25 mm is 25e-3")
    check_range("frames", frames, 1, 1_000_000, "a scan has at least one frame")
    if snr_db is not None:
        check_range("snr_db", snr_db, -100, 300, "the unit is dB; None adds no noise")
    if snr_window not in ("useful", "record"):
        raise ValidationError(f"snr_window: expected 'useful' or 'record', got {snr_window!r}")


def _noise_level(signals: np.ndarray, snr_db: float | None) -> float:
    """Return the standard deviation of the noise for signals that hold the window alone."""
    if not signals.any():
        raise ValidationError("phantom: it gives no signal; is it inside the field of view (the unit is m)?")
    return 0.0 if snr_db is None else float(np.sqrt((signals**2).mean()) * 10 ** (-snr_db / 20))


def _noisy(signals: np.ndarray, level: float, frames: int, seed: int) -> np.ndarray:
    """Return `frames` copies of the signals, float32, each with its own noise."""
    noise = np.random.default_rng(seed).standard_normal((frames, *signals.shape), dtype=np.float32)
    return (signals + level * noise).astype(np.float32)
