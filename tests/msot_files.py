"""Hand-written iThera scans, as small as they can be."""

import base64
from pathlib import Path

import numpy as np

RING = [(0.04 * np.cos(a), 0.04 * np.sin(a), 0.0) for a in np.linspace(0.3, 5.0, 5)]
"""Five detectors on an arc, (x, y, z), m."""


def projections(points=RING) -> str:
    """A geometry as a list of points."""
    values = ["".join(f'<VALUE axis-ref="{i + 1}">{float(v)!r}</VALUE>' for i, v in enumerate(p)) for p in points]
    return "".join(f'<PROJECTION number="{i + 1}">{v}</PROJECTION>' for i, v in enumerate(values))


def equal(start: float, step: float, end: float, radius: float) -> str:
    """A geometry as an arc."""
    return (
        f"<EQUAL><START>{start!r}</START><STEP>{step!r}</STEP><END>{end!r}</END>"
        f'<CONSTANT axis-ref="2">{radius!r}</CONSTANT><CONSTANT axis-ref="3">0.04</CONSTANT></EQUAL>'
    )


def header(
    wavelengths=(700, 800),
    pulses=None,
    offsets=None,
    geometry=None,
    version="2.2",
    n_samples=8,
    transducer="msot2",
    embedded=None,
    ultrasound=None,
    more="",
) -> str:
    """The text of a header; `pulses` are the wavelengths of its frames, one sweep unless given.

    `ultrasound` are the ultrasound images that go with the pulses, `more` is text before the end.
    """
    pulses = list(wavelengths) if pulses is None else pulses
    offsets = list(range(len(pulses))) if offsets is None else offsets
    listed = "".join(f'<WAVELENGTH number="{i + 1}">{w}</WAVELENGTH>' for i, w in enumerate(wavelengths))
    beside = [""] * len(pulses) if ultrasound is None else [f' ultraSound-frame-offset="{u}"' for u in ultrasound]
    frames = "".join(
        f'<DataModelScanFrame><Frame timestamp="{637371523560823431 + 10**6 * i}"{beside[i]}><Z-POS>{10 + i}</Z-POS>'
        f"<TEMPERATURE>{30 + i}</TEMPERATURE><WAVELENGTH>{w}</WAVELENGTH><POWER>{100 + i}</POWER></Frame>"
        f"<IDOffset>{offset}</IDOffset></DataModelScanFrame>"
        for i, (w, offset) in enumerate(zip(pulses, offsets, strict=True))
    )
    response = "" if embedded is None else base64.b64encode(np.asarray(embedded, "<f8").tobytes()).decode()
    return f"""<?xml version="1.0" encoding="utf-8"?>
<DataModelMsotProject>
<DataModelVersion>{version}</DataModelVersion>
<HARDWARE-DESC xmlns="Header_Schema">
<SAMPLING-FREQUENCY unit="Hz" unit-modifier="M">40</SAMPLING-FREQUENCY>
<TRANSDUCER>{transducer}</TRANSDUCER>
<SPEED-OF-SOUND-UPPER-SLIDER-LIMI.>50</SPEED-OF-SOUND-UPPER-SLIDER-LIMI.>
<SPEED-OF-SOUND-BASE>-90</SPEED-OF-SOUND-BASE>
<FRAME-DESC>{projections() if geometry is None else geometry}</FRAME-DESC>
</HARDWARE-DESC>
<MEASUREMENT-DESC xmlns="Header_Schema">
<RECORDED-LENGTH>{n_samples}</RECORDED-LENGTH>
<WAVELENGTHS>{listed}</WAVELENGTHS>
</MEASUREMENT-DESC>
<ScanNode><Name>hand-written</Name><TrimSpeedOfSound>43</TrimSpeedOfSound>
<ScanFrames>{frames}</ScanFrames></ScanNode>
<ReconPreset><ImpulseResponse>true</ImpulseResponse></ReconPreset>
{f"<ImpulseResponse>{response}</ImpulseResponse>" if response else ""}
{more}</DataModelMsotProject>"""


def field_of_view(name: str, counts, extents) -> str:
    """A grid as newer headers give it."""
    pixels = "".join(f"<{axis}>{n}</{axis}>" for axis, n in zip("XYZ", counts, strict=True))
    sizes = "".join(f"<{axis}>{size!r}</{axis}>" for axis, size in zip("XYZ", extents, strict=True))
    return f"<{name}><PixelCount>{pixels}</PixelCount><Extents>{sizes}</Extents></{name}>"


def recon_node(guid: str, frames=None, view: str = "<Resolution>4</Resolution><Roi>0.03</Roi>") -> str:
    """A stored reconstruction; `frames` are (IDOffset of the pulse, IDOffset of the image)."""
    listed = "".join(
        f"<DataModelReconstructionFrame><ScanFramesID><int>{pulse}</int></ScanFramesID><IDOffset>{record}</IDOffset>"
        "<zOffset>0</zOffset><HasErrors>false</HasErrors></DataModelReconstructionFrame>"
        for pulse, record in frames or ()
    )
    return (
        f"<DataModelNewReconstructionNode><Name>20mm(75um)</Name><GUID>{guid}</GUID><Method>model_lin</Method>{view}"
        f"<ReconFrames>{listed}</ReconFrames></DataModelNewReconstructionNode>"
    )


def msp_node(guid: str, recon_guid: str, slices) -> str:
    """A stored unmixing; `slices` are lists of (IDOffset of the image, name of the spectrum)."""
    listed = "".join(
        "<MspSliceFrame><HasErrors>false</HasErrors><ReconFrameID><int>0</int></ReconFrameID><ComponentList>"
        + "".join(
            f"<MspSliceComponent><IDOffset>{record}</IDOffset><ComponName>c</ComponName><ComponRef>0</ComponRef>"
            f"<invert>false</invert><SpectraName>{spectrum}</SpectraName></MspSliceComponent>"
            for record, spectrum in components
        )
        + "</ComponentList></MspSliceFrame>"
        for components in slices
    )
    return (
        f"<DataModelNewMspNode><Name>MSP</Name><GUID>{guid}</GUID><ReconGUID>{recon_guid}</ReconGUID>"
        f"<Method>regression</Method><SlicesFrame>{listed}</SlicesFrame></DataModelNewMspNode>"
    )


def nodes(recons=(), msps=()) -> str:
    """The two lists of stored images."""
    return f"<ReconNodes>{''.join(recons)}</ReconNodes><MspNodes>{''.join(msps)}</MspNodes>"


def write(folder: Path, text: str | bytes, records: int = 2, detectors: int = 5, n_samples: int = 8) -> Path:
    """Write a header with raw signals beside it, record k holding 1000 k + 10 (detector) + (sample)."""
    folder.mkdir(exist_ok=True)
    msot = folder / "Scan_1.msot"
    msot.write_bytes(text.encode() if isinstance(text, str) else text)
    k, d, t = np.ogrid[:records, :detectors, :n_samples]
    (1000 * k + 10 * d + t).astype("<u2").tofile(folder / "Scan_1.bin")
    return msot
