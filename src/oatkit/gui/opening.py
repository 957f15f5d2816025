"""Opens what a user drags into the window: scans, results, pipelines. What takes time runs beside the window."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from oatkit.api import Reader
from oatkit.data import Image, Scan
from oatkit.describe import Beside, look_beside
from oatkit.errors import OatkitError, ReadError, ValidationError
from oatkit.gui.document import PipelineDocument
from oatkit.gui.job import Job
from oatkit.gui.preview.quick_look import quick_look
from oatkit.gui.samples import SAMPLES
from oatkit.gui.workbench import Workbench
from oatkit.registry import installed
from oatkit.store import load
from oatkit.store.manifest import FILE_NAME

SCAN = "scan"
"""Key of the layer that shows a scan before it is reconstructed."""
SCANNER = "scanner"
"""Group of the images, and key of the regions, that come with a scan."""


def can_open(path: Path) -> bool:
    """Say whether a path is a result, a scan that a reader claims, or a pipeline."""
    return _is_result(path) or _is_scan(path) or _is_pipeline(path)


def open_path(bench: Workbench, path: Path) -> None:
    """Open a scan, of which a coarse picture is shown soon after, a result, or a pipeline, known by its content.

    Finished images beside a scan are added to it, out of sight; of a file without signals they are what is seen.
    Raises `ReadError`, `ResultError` or `ValidationError`.
    """
    if _is_result(path):
        bench.layers.show_result(load(path), path.stem)
        bench.viewer.reset_view()
    elif _is_pipeline(path) and not _is_scan(path):
        bench.session.document = PipelineDocument.open(path)
        bench.pipeline_changed.emit()
    else:
        try:
            bench.session.open_scan(path)
        except ReadError:
            if not _show_finished(bench, path):
                raise
        else:
            _scan_is_open(bench, path)


def open_sample(bench: Workbench, name: str) -> None:
    """Simulate one of `SAMPLES` and open it as the scan; the window goes on meanwhile."""

    def work(job: Job) -> Iterator[Any]:
        yield (scan := SAMPLES[name]())
        yield quick_look(scan, 0, bench.session.pipeline)

    def take(item: Scan | Image) -> None:
        if isinstance(item, Scan):
            bench.session.take_scan(item)
            bench.scan_changed.emit()
        else:
            _show(bench, item)

    _beside(bench, work, take)


def _scan_is_open(bench: Workbench, path: Path) -> None:
    session = bench.session
    scan, pipeline = session.scan, session.pipeline
    assert scan is not None
    bench.scan_changed.emit()

    def work(job: Job) -> Iterator[Any]:
        yield quick_look(scan, 0, pipeline)
        yield look_beside(path)

    def take(item: Image | Beside) -> None:
        if session.scan is not scan:
            return
        if isinstance(item, Image):
            _show(bench, item)
        else:
            _show_beside(bench, item, visible=False)

    _beside(bench, work, take)


def _show_finished(bench: Workbench, path: Path) -> bool:
    """Show the finished images of a file that has no signals; say whether it has some."""
    found = look_beside(path)
    if not found.images:
        return False  # regions alone are nothing to look at
    _remove_finished(bench)
    _show_beside(bench, found, visible=True)
    bench.viewer.reset_view()
    return True


def _show_beside(bench: Workbench, found: Beside, visible: bool) -> None:
    """Show what lay beside a scan: images, and the outlines of regions; what cannot be read is told in a note."""
    notes = list(found.notes)
    with bench.layers.together():
        for name, frames in found.images.items():
            try:
                bench.layers.show_images({name: frames}, SCANNER, visible)
            except OatkitError as error:
                notes.append(f"{name}: {error}")
        bench.layers.show_outlines(found.regions, SCANNER, f"{SCANNER}: regions", visible)
    for note in notes:
        _tell(bench, note)


def _remove_finished(bench: Workbench) -> None:
    bench.layers.remove_group(SCANNER)
    bench.layers.remove_drawing(SCANNER)


def _tell(bench: Workbench, note: str) -> None:
    """Show a note that nobody has to answer."""
    if getattr(bench.viewer, "window", None) is not None:
        from napari.utils.notifications import show_info

        show_info(note)


def _show(bench: Workbench, image: Image) -> None:
    """Show the first picture of a scan; what was made of the scan before is taken away."""
    bench.side_by_side.leave()
    bench.layers.remove_group("")
    _remove_finished(bench)
    scan = bench.session.scan
    bench.layers.show(image, SCAN, f"scan {scan.name}" if scan and scan.name else "scan")
    bench.layers.select(SCAN)
    bench.viewer.reset_view()


def _beside(bench: Workbench, work: Callable[[Job], Iterator[Any]], take: Callable[[Any], None]) -> None:
    """Run work beside the window; without a window, at once."""
    job = Job(work).start()
    window = getattr(bench.viewer, "window", None)
    if window is not None:
        from napari.utils.notifications import show_error

        from oatkit.gui.watching import watch  # Qt

        watch(job, take, show_error, window._qt_window)
        return
    job.wait(600)
    if job.failure:
        raise ValidationError(job.failure.sentence)
    for item in job.drain():
        take(item)


def _is_result(path: Path) -> bool:
    return path.is_dir() and (path / FILE_NAME).is_file()


def _is_pipeline(path: Path) -> bool:
    return path.suffix.lower() == ".toml"


def _is_scan(path: Path) -> bool:
    for make in installed().of_kind("reader"):
        reader = make()
        assert isinstance(reader, Reader)
        try:
            if reader.can_read(path):
                return True
        except Exception:  # somebody's reader must not keep the others from reading
            continue
    return False
