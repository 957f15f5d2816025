"""The live preview: two sliders, and a coarse image that follows them and every other edit of the pipeline."""

from collections.abc import Callable
from functools import partial
from typing import Any

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QCheckBox, QGridLayout, QWidget

from oatkit.data import Image, Scan
from oatkit.errors import ValidationError
from oatkit.focus.sweep import AROUND_M_S, SOFT_TISSUE_M_S
from oatkit.gui.document import PipelineDocument
from oatkit.gui.job import Failure
from oatkit.gui.leaving import link, when_gone
from oatkit.gui.parts.forms import Message, plain
from oatkit.gui.parts.number_slider import NumberSlider, Scale
from oatkit.gui.pipeline.runner import Runner
from oatkit.gui.preview.preview import Preview, Wanted, has_weight, settled, speed_of, with_speed
from oatkit.gui.workbench import Workbench
from oatkit.weights import with_weight

PREVIEW = "preview"
"""Key of its layer."""
PERIOD_MS = 5
"""Between two looks at what the pass has made; only while there is one."""
SPEEDS = Scale(*SOFT_TISSUE_M_S, int(SOFT_TISSUE_M_S[1] - SOFT_TISSUE_M_S[0]))
WEIGHTS = Scale(1e-5, 10.0, 300, logarithmic=True)
"""Fifty steps in each decade."""

Edit = Callable[[Callable[[PipelineDocument], None]], None]


class PreviewPanel(QWidget):
    """While a slider moves only the preview follows; when it is let go, the pipeline is edited, once.

    The preview lies over the result as long as the parameters are not those of the result, and goes when they are.
    """

    def __init__(self, bench: Workbench, runner: Runner, edit: Edit, parent: Any = None) -> None:
        super().__init__(parent)
        self._bench, self._runner, self._edit = bench, runner, edit
        self.preview = Preview()
        self._asked: Wanted | None = None
        self._basis: Wanted | None = None
        """What the image on screen that is no preview was made from."""
        self._covered: Any = None
        """The layer that was selected before the preview came."""
        self._timer = QTimer(self, interval=PERIOD_MS)
        self._timer.timeout.connect(self._look)
        self._lay_out()
        self._connect()
        self._show_scan()

    def _lay_out(self) -> None:
        self.live = QCheckBox("Live preview")
        self.live.setToolTip("A coarse image follows each change of the pipeline, before anything is run.")
        self.live.setChecked(True)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setVerticalSpacing(2)
        grid.addWidget(self.live, 0, 0, 1, 3)
        tip = "Moving it shows a preview; letting go writes the number into the pipeline."
        self.speed = NumberSlider(grid, "Speed of sound", tip, SPEEDS, lambda c: f"{c:.0f} m/s", self)
        self.weight = NumberSlider(grid, "Weight", tip, WEIGHTS, lambda w: f"{w:.3g}", self)
        self.message = Message()
        grid.addWidget(self.message, grid.rowCount(), 0, 1, 3)
        grid.setColumnStretch(1, 1)

    def _connect(self) -> None:
        bench = self._bench
        self.live.toggled.connect(self.refresh)
        for slider, write in ((self.speed, self._write_speed), (self.weight, self._write_weight)):
            slider.moved.connect(self._follow)
            slider.released.connect(partial(self._commit, write))
        self._runner.progressed.connect(self._make_way)
        self._runner.ended.connect(self._take_run)
        watched = (
            (bench.scan_changed, self._show_scan),
            (bench.pipeline_changed, self._show_pipeline),
            (bench.viewing.changed, self._show_wavelength),
        )
        for signal, slot in watched:
            link(self, signal, slot)
        when_gone(self, self.preview.stop)

    def finish(self) -> None:
        """Write into the pipeline what a slider has been moved to just now."""
        self.speed.finish()
        self.weight.finish()

    def stop(self) -> None:
        """End the pass, with the window."""
        self._timer.stop()
        self.preview.stop()

    def refresh(self) -> None:
        """Show what the pipeline would give now, or nothing where that is on screen already."""
        wanted = self._wanted()
        if wanted is None or not self.live.isChecked() or wanted.gives_what(self._basis):
            self._clear()
        elif not self._runner.running and not wanted.equals(self._asked):
            self._ask(wanted)

    def _follow(self) -> None:
        """Follow a slider.

        A pass that is under way for it may finish: were it stopped at each move, a picture would come only when the
        hand rests. Its end asks for where the slider is by then.
        """
        if not self.preview.waiting:
            self.refresh()

    def _commit(self, write: Callable[[PipelineDocument], None]) -> None:
        try:
            self._edit(write)
        except ValidationError as error:
            self.message.say(plain(error))
        self._show_pipeline()

    def _write_speed(self, document: PipelineDocument) -> None:
        document.set("scan", "speed_of_sound_m_s", self.speed.number)

    def _write_weight(self, document: PipelineDocument) -> None:
        document.set("reconstruct", "weight", self.weight.number)

    def _wanted(self) -> Wanted | None:
        """Return what to look at: the pipeline with the sliders where they are."""
        session = self._bench.session
        if session.scan is None:
            return None
        pipeline = settled(session.pipeline, session.scan, session.result)
        if self.speed.moving:
            pipeline = with_speed(pipeline, self.speed.number)
        if self.weight.moving and has_weight(pipeline.reconstruct):
            pipeline = pipeline.with_solver(with_weight(pipeline.reconstruct, self.weight.number))
        return Wanted(session.scan, session.frame, self._wavelength(session.scan), pipeline)

    def _wavelength(self, scan: Scan) -> int:
        at = self._bench.viewing.wavelength_nm
        distances = [abs(wavelength - at) if at is not None else 0.0 for wavelength in scan.wavelengths_nm]
        return distances.index(min(distances))

    def _ask(self, wanted: Wanted) -> None:
        self._asked = wanted
        self.preview.ask(wanted)
        self._timer.start()

    def _look(self) -> None:
        """Paint what has come, and go on to where a slider has been moved meanwhile."""
        made = self.preview.poll()
        asked = self._asked
        if made is not None and asked is not None and not asked.gives_what(self._basis):
            self._paint(made)
        if made is not None and (self.speed.moving or self.weight.moving):
            self.refresh()
        if not self.preview.busy:
            self._timer.stop()

    def _paint(self, made: Image | Failure) -> None:
        if isinstance(made, Failure):
            self.message.say(made.sentence.splitlines()[0])
            self._uncover()
            return
        self.message.say("")
        layers, selection = self._bench.layers, self._bench.viewer.layers.selection
        first, active = layers.find(PREVIEW) is None, selection.active
        ny, nx = made.grid.shape
        layer = layers.show(made, PREVIEW, f"preview {nx} x {ny}")
        if first:
            self._covered, selection.active = active, layer

    def _clear(self) -> None:
        self._asked = None
        self.preview.drop()
        self.message.say("")
        self._uncover()

    def _uncover(self) -> None:
        """Take the preview away, and select again what was selected before it."""
        viewer_layers, layer = self._bench.viewer.layers, self._bench.layers.find(PREVIEW)
        if layer is not None:
            was_active, covered, self._covered = viewer_layers.selection.active is layer, self._covered, None
            viewer_layers.remove(layer)
            if was_active and covered in viewer_layers:
                viewer_layers.selection.active = covered

    def _make_way(self) -> None:
        """Leave the cores to a run."""
        if self._runner.running and self.preview.busy:
            if self.preview.waiting:
                self._asked = None  # its picture is still owed
            self.preview.drop()

    def _take_run(self) -> None:
        """Go where a run has made the result; after one that failed or was cancelled, follow again."""
        session = self._bench.session
        if self._runner.ended_by == "result" and session.scan is not None:
            ran = settled(self._runner.pipeline, session.scan, session.result)
            self._basis = Wanted(session.scan, session.frame, 0, ran)
        self._show_pipeline()

    def _show_scan(self) -> None:
        """Begin with another scan from what the window shows of it first, or go on to another frame."""
        wanted = self._wanted()
        self.setEnabled(wanted is not None)
        if wanted is not None and (self._basis is None or self._basis.scan is not wanted.scan):
            self._basis = wanted
            if self.live.isChecked():
                self._ask(wanted)  # for nobody to see: what is compiled and kept now is not waited for later
        self._show_pipeline()

    def _show_pipeline(self) -> None:
        """Let the sliders stand where the pipeline is, and the preview follow."""
        session = self._bench.session
        if session.scan is not None:
            pipeline = settled(session.pipeline, session.scan, session.result)
            speed = speed_of(pipeline)
            self.speed.show_number(speed, _speeds(session.scan, speed))
            if has_weight(pipeline.reconstruct):
                self.weight.show_number(pipeline.reconstruct.weight)  # type: ignore[attr-defined]
        self.weight.set_visible(has_weight(session.pipeline.reconstruct))
        self.refresh()

    def _show_wavelength(self) -> None:
        """Follow the slider of wavelengths where a preview is on screen or under way."""
        asked = self._asked
        if asked is not None and self._wavelength(asked.scan) != asked.wavelength:
            self.refresh()


def _speeds(scan: Scan, speed: float) -> Scale:
    """Return the range of the slider: that of soft tissue, or about the scan's speed where that is not in it."""
    own = scan.geometry.speed_of_sound_m_s
    low, high = SOFT_TISSUE_M_S
    if not low <= own <= high:
        low, high = round(own - AROUND_M_S), round(own + AROUND_M_S)
    low, high = min(low, round(speed)), max(high, round(speed))
    return Scale(low, high, int(high - low))
