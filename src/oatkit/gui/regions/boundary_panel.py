"""The bar for the outline of the body: change it by hand, take it into the pipeline, and let the light follow."""

from typing import Any

from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QCheckBox, QFrame, QGridLayout, QLabel

from oatkit.gui.leaving import when_gone
from oatkit.gui.parts.buttons import button
from oatkit.gui.parts.forms import Message
from oatkit.gui.regions.boundary import Outline, outline_of
from oatkit.gui.workbench import Workbench

REST_MS = 400
"""After a change, before the pipeline runs."""
NOBODY_RUNS = "The outline is in the pipeline; open the Pipeline widget to run it."


class BoundaryPanel(QFrame):
    """Shown within the regions widget."""

    def __init__(self, bench: Workbench, parent: Any = None) -> None:
        super().__init__(parent)
        self.bench, self.outline = bench, Outline(bench)
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self.edit = button("Edit outline", "move, add and remove the corners of the body's outline", self._edit)
        self.draw = button("Draw anew", "click around the body; a double click ends the outline", self._draw)
        self.take = button("Take it", "put the outline into the pipeline, in place of its segmenter", self._take)
        self.back = button("Put it back", "show the outline again as it was", self._put_back)
        self.at_once = QCheckBox("Run at once")
        self.at_once.setToolTip(
            "after each change the outline is taken and the pipeline runs, so that the light follows"
        )
        self.status = QLabel()
        self.status.setWordWrap(True)
        self.message = Message()
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(REST_MS)
        self._timer.timeout.connect(self._run)
        self._arrange()
        outline = self.outline
        outline.changed.connect(self._show)
        self.at_once.toggled.connect(self._show)
        when_gone(self, outline.close)
        self._show()

    def _arrange(self) -> None:
        grid = QGridLayout(self)
        grid.setContentsMargins(6, 4, 6, 4)
        grid.setSpacing(4)
        grid.addWidget(QLabel("<b>Boundary</b>"), 0, 0)
        grid.addWidget(self.edit, 0, 1)
        grid.addWidget(self.draw, 0, 2)
        grid.addWidget(self.status, 1, 0, 1, 3)
        grid.addWidget(self.at_once, 2, 0)
        grid.addWidget(self.take, 2, 1)
        grid.addWidget(self.back, 2, 2)
        grid.addWidget(self.message, 3, 0, 1, 3)
        for column in (0, 1, 2):
            grid.setColumnStretch(column, 1)

    def _show(self) -> None:
        """Say how it stands with the outline, and run where that is asked for."""
        edited = self.outline.edited
        self.take.setEnabled(edited)
        self.back.setEnabled(edited or self._is_gone())
        self.status.setText(self._words(edited))
        self._timer.stop()
        if edited and self.at_once.isChecked():
            self._timer.start()

    def _words(self, edited: bool) -> str:
        if edited:
            return "The outline was changed by hand: take it, or put it back."
        if self.outline.word:
            return self.outline.word
        if self.outline.layer is None:
            return "No outline yet: run a pipeline with a Segment step, or draw one."
        if self._is_gone():
            return "No outline is drawn: draw one, or put back what was there."
        corners = outline_of(self.bench.session.pipeline)
        return "As the last run found it." if corners is None else f"By hand, {len(corners)} corners, in the pipeline."

    def _is_gone(self) -> bool:
        layer = self.outline.layer
        return layer is not None and layer.nshapes == 0

    def _edit(self) -> None:
        self.message.attempt(self.outline.edit)

    def _draw(self) -> None:
        self.message.attempt(self.outline.draw_anew)

    def _take(self) -> bool:
        return self.message.attempt(self.outline.take)

    def _put_back(self) -> None:
        self.message.attempt(self.outline.put_back)

    def _run(self) -> None:
        if self.outline.at_work:
            self._timer.start()
        elif self.outline.edited and self._take():
            self.bench.run_wanted.emit()
            self.message.say("" if len(self.bench.run_wanted) else NOBODY_RUNS)
