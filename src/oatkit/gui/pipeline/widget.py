"""The pipeline widget: build it by looking, run it, and take it home as a file."""

from collections.abc import Callable
from functools import partial
from time import monotonic
from typing import Any

from qtpy.QtCore import QCoreApplication, QTimer
from qtpy.QtWidgets import QVBoxLayout, QWidget

from oatkit.events import StepIterate
from oatkit.gui.document import PipelineDocument
from oatkit.gui.images.layers import KEY
from oatkit.gui.leaving import link, when_closed, when_gone
from oatkit.gui.opening import open_path
from oatkit.gui.pipeline.header import Header
from oatkit.gui.pipeline.recipe_dialog import RecipeDialog
from oatkit.gui.pipeline.run_panel import RunPanel
from oatkit.gui.pipeline.runner import Runner
from oatkit.gui.pipeline.stack import Stack
from oatkit.gui.preview.panel import PreviewPanel
from oatkit.gui.session import image_of
from oatkit.gui.workbench import workbench

ITERATE = "iterate"
"""Key of the layer that shows a solver at work."""
LEAST_S = 0.1
"""Between two pictures of a solver at work."""


class PipelineWidget(QWidget):
    """The steps of the pipeline, and all that runs them."""

    def __init__(self, napari_viewer: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self.bench = workbench(napari_viewer)
        self.runner = Runner(self.bench.session, self)
        self._painted = 0.0
        self.header = Header(self.bench.session, partial(open_path, self.bench), self)
        self.stack = Stack(self.runner, self.edit)
        self.preview = PreviewPanel(self.bench, self.runner, self.edit)
        self.panel = RunPanel(self.runner)
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 6)
        column.setSpacing(6)
        column.addWidget(self.header)
        column.addWidget(self.stack, 1)
        column.addWidget(self.preview)
        column.addWidget(self.panel)
        self.setMinimumWidth(316)
        self._connect()

    def edit(self, change: Callable[[PipelineDocument], None]) -> None:
        """Change the pipeline and tell all widgets. Raises `ValidationError`."""
        before = self.bench.session.document.text
        change(self.bench.session.document)
        if self.bench.session.document.text != before:
            self.bench.pipeline_changed.emit()

    def _connect(self) -> None:
        bench, runner = self.bench, self.runner
        self.header.frame_taken.connect(bench.scan_changed.emit)
        self.header.pipeline_taken.connect(bench.pipeline_changed.emit)
        self.panel.run.pressed.connect(self.preview.finish)
        self.stack.run_to_here.connect(self.preview.finish)
        self.stack.run_to_here.connect(runner.start)
        self.panel.recipe_wanted.connect(self.show_recipe)
        runner.progressed.connect(self.stack.show_states)
        runner.iterated.connect(self._paint_iterate)
        runner.ended.connect(self._finish)
        watched = (
            (bench.scan_changed, self._show_scan),
            (bench.pipeline_changed, self._show_pipeline),
            (bench.run_wanted, runner.start),
        )
        for signal, slot in watched:
            link(self, signal, slot)
        when_closed(self, self._stop)
        when_gone(self, runner.stop)
        QCoreApplication.instance().aboutToQuit.connect(runner.stop)

    def _show_scan(self) -> None:
        """Show another scan or frame; a run of the one before ends, since its images would be taken for this one's."""
        session = self.bench.session
        if not self.runner.ledger.is_of(session.scan, session.frame):
            self.runner.cancel()
        self.header.show_scan()
        self.stack.show_states()

    def _show_pipeline(self) -> None:
        self.header.show_pipeline()
        self.stack.show_pipeline()

    def _paint_iterate(self, event: StepIterate) -> None:
        """Show the solver's image, not more often than the eye sees it."""
        if monotonic() - self._painted >= LEAST_S:
            self.bench.layers.show(image_of(event, self.runner.pipeline), ITERATE, visible=True)
            self._painted = monotonic()

    def _finish(self) -> None:
        """Show what came out of a run, or where it failed."""
        self.bench.layers.remove(ITERATE)
        self.stack.show_states()
        if self.runner.failed_at is not None:
            QTimer.singleShot(0, partial(self.stack.show_failure, self.runner.failed_at))
        if self.runner.ended_by == "result" and self.runner.log.result is not None:
            self.bench.layers.show_result(self.runner.log.result)
            self.bench.result_changed.emit()

    def show_recipe(self) -> None:
        """Open a window with the recipe of the selected layer, or say that it has none."""
        layer = self.bench.layers.viewer.layers.selection.active
        about = layer.metadata.get(KEY) if layer is not None else None
        if not about:
            self.panel.message.say("select a layer that shows an image of oatkit: it knows how it was made")
            return
        self.panel.message.say("")
        RecipeDialog(layer.name, about["image"], about.get("result"), self).show()

    def _stop(self) -> None:
        """End what is at work, for the window closes."""
        self.runner.cancel()
        self.runner.stop()
        self.preview.stop()
