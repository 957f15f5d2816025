"""Run, cancel, and what a run tells: where it is, how it converges, what is to be known of its result."""

from typing import Any

from qtpy.QtCore import Signal
from qtpy.QtWidgets import QHBoxLayout, QLabel, QListWidget, QVBoxLayout, QWidget

from oatkit.gui.parts.buttons import button
from oatkit.gui.parts.forms import Message
from oatkit.gui.pipeline.convergence import Convergence
from oatkit.gui.pipeline.runner import Runner


class RunPanel(QWidget):
    """The foot of the pipeline widget."""

    recipe_wanted = Signal()

    def __init__(self, runner: Runner, parent: Any = None) -> None:
        super().__init__(parent)
        self._runner = runner
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        row = QHBoxLayout()
        self.run = button("Run", "run the whole pipeline on this frame", runner.start)
        self.cancel = button("Cancel", "end the run", runner.cancel)
        self.recipe = button("Recipe", "how the image of the selected layer was made", self.recipe_wanted.emit)
        for one in (self.run, self.cancel, self.recipe):
            row.addWidget(one)
        column.addLayout(row)
        self.progress = QLabel()
        self.progress.setWordWrap(True)
        column.addWidget(self.progress)
        self.message = Message()
        column.addWidget(self.message)
        self.convergence = Convergence()
        column.addWidget(self.convergence)
        self.notes = QListWidget()
        self.notes.setWordWrap(True)
        self.notes.setMaximumHeight(84)
        self.notes.setToolTip("what is to be known of the last result")
        column.addWidget(self.notes)
        runner.progressed.connect(self.show_run)
        runner.ended.connect(self.show_run)
        self.show_run()

    def show_run(self) -> None:
        """Show where the run is, or how it ended."""
        runner = self._runner
        self.run.setEnabled(not runner.running)
        self.cancel.setEnabled(runner.running)
        self.progress.setText(self._words())
        self.message.say(runner.failure.sentence if runner.failure and runner.failed_at is None else "")
        self.convergence.show_curve(runner.log.curve)
        self.convergence.setVisible(runner.log.curve is not None)
        if self.notes.count() != len(runner.log.notes):
            self.notes.clear()
            self.notes.addItems([f"• {note}" for note in runner.log.notes])
        self.notes.setVisible(bool(runner.log.notes))

    def _words(self) -> str:
        runner = self._runner
        if runner.running:
            return runner.log.text(len(runner.session.scan.wavelengths_nm) if runner.session.scan else 0)
        if runner.ended_by == "result":
            return f"done in {runner.seconds:.1f} s"
        if runner.ended_by == "failure":
            return f"failed at {runner.failed_at.slot.title}" if runner.failed_at else ""
        return "cancelled" if runner.ended_by == "cancel" else ""
