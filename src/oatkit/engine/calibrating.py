"""The calibration of a scan by the spectra in it."""

from oatkit.blame import blame
from oatkit.data import Image, Scan
from oatkit.engine.stepping import steps
from oatkit.errors import ValidationError
from oatkit.events import Listener, StepDone, StepStarted, ignore
from oatkit.memo import Memo
from oatkit.pipeline import Pipeline
from oatkit.problem import Calibration
from oatkit.quantification import unmix_problem


def calibrate(pipeline: Pipeline, scan: Scan, frame: int, memo: Memo, on_event: Listener = ignore) -> Calibration:
    """Return the calibration that the pipeline's unmixer finds on one frame.

    Raises `ValidationError` where the pipeline has no unmixer, or one that cannot.
    """
    if pipeline.unmix is None:
        raise ValidationError('[absorption].calibrated_by = "spectra" needs [unmix], which is missing')
    images: dict[str, Image] = {}
    for event in steps(pipeline.model_copy(update={"absorption": None, "unmix": None}), scan, frame, memo):
        on_event(event)
        if isinstance(event, StepDone):
            images |= event.images
    on_event(StepStarted("finding the calibration"))
    with blame(pipeline.unmix):
        return pipeline.unmix.calibrate(unmix_problem(pipeline, images))


def calibrated(pipeline: Pipeline, found: Calibration) -> Pipeline:
    """Return the same pipeline with the calibration found, if one was."""
    table = pipeline.absorption
    if table is None or found.value is None:
        return pipeline
    return pipeline.model_copy(
        update={"absorption": table.model_copy(update={"calibration": found.value / table.grueneisen})}
    )


def asks_for_calibration(pipeline: Pipeline) -> bool:
    """Say whether the calibration is still to be found."""
    table = pipeline.absorption
    return table is not None and table.calibration is None and table.calibrated_by == "spectra"
