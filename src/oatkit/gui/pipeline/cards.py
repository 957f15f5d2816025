"""One table of the pipeline as a card: its plugin, how it stands, what went wrong, and its form."""

from collections.abc import Callable
from typing import Any

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QGuiApplication
from qtpy.QtWidgets import QFrame, QHBoxLayout, QLabel, QPushButton, QToolButton, QVBoxLayout

from oatkit.errors import ValidationError
from oatkit.gui.document import PipelineDocument
from oatkit.gui.job import Failure
from oatkit.gui.parts.forms import Form, Message, plain
from oatkit.gui.parts.plugin_chooser import PluginChooser
from oatkit.gui.pipeline.ledger import State
from oatkit.gui.pipeline.slots import Place
from oatkit.parameters import Parameters

COLOURS = {"fresh": "#3fb950", "stale": "#d29922", "running": "#58a6ff", "failed": "#e5484d"}
MEANINGS = {
    "": "not run yet",
    "fresh": "up to date",
    "stale": "changed since the last run, here or before this step",
    "running": "at work",
    "failed": "failed in the last run",
}

BUTTON, TITLE = 20, 96
"""Widths, dots."""

RUNS = ("reconstruct", "segment", "fluence", "absorption", "unmix")
"""Steps that a run can end at."""

Edit = Callable[[Callable[[PipelineDocument], None]], None]
"""Changes the document and tells everybody; raises `ValidationError`."""


class Card(QFrame):
    """One place of the pipeline."""

    run_to_here = Signal(str)
    """The slot that a run is to end at."""

    def __init__(self, place: Place, edit: Edit, parent: Any = None) -> None:
        super().__init__(parent)
        self.place, self._edit = place, edit
        self.form: Form | None = None
        self._part: Parameters | None = None
        self._details = ""
        self.setFrameShape(QFrame.Shape.StyledPanel)
        column = QVBoxLayout(self)
        column.setContentsMargins(4, 2, 4, 2)
        column.setSpacing(3)
        column.addLayout(self._head())
        self.message = Message()
        column.addWidget(self.message)
        self.copy = QPushButton("Copy details")
        self.copy.setToolTip("copy the whole report of the error")
        self.copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(self._details))
        self.copy.hide()
        column.addWidget(self.copy, 0, Qt.AlignmentFlag.AlignLeft)
        self._body = QVBoxLayout()
        column.addLayout(self._body)

    @property
    def expanded(self) -> bool:
        """Whether the form is shown."""
        return self.arrow.isChecked()

    def expand(self, shown: bool = True) -> None:
        """Show or hide the form."""
        self.arrow.setChecked(shown)

    def show_part(self, part: Parameters | None) -> None:
        """Show what stands at this place, with a new form where its class is another."""
        self._part = part
        if self.chooser is not None:
            self.chooser.show_part(part)
        self.message.say("")
        self.copy.hide()
        self.arrow.setEnabled(part is not None)
        if self.form is not None and (part is None or type(part) is not self.form.cls):
            self._body.removeWidget(self.form)
            self.form.hide()
            self.form.deleteLater()
            self.form = None
        if self.form is not None and part is not None:
            self.form.show_part(part)
        self._unfold(self.expanded)

    def show_state(self, state: State, failure: Failure | None = None) -> None:
        """Show how this place stands to the last run, and why it failed."""
        colour = COLOURS.get(state.word, "")
        dot = f'<span style="color:{colour}">●</span>' if colour else ""
        self.status.setText(f"{dot} {self._words(state)}".strip())
        self.status.setToolTip(MEANINGS[state.word])
        if state.word == "failed":
            self.message.say(state.sentence)
            self._details = failure.details if failure else state.sentence
        elif self.copy.isVisibleTo(self):
            self.message.say("")
        self.copy.setVisible(state.word == "failed")

    def _words(self, state: State) -> str:
        if self.place.index is not None:
            return ""  # they run as one step, and their rows have other buttons
        return f"{state.seconds:.1f} s" if state.seconds is not None else state.word.replace("fresh", "")

    def _head(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(3)
        self.arrow = QToolButton()
        self.arrow.setText("▸")
        self.arrow.setFixedWidth(BUTTON)
        self.arrow.setCheckable(True)
        self.arrow.setToolTip("show the parameters")
        self.arrow.toggled.connect(self._unfold)
        row.addWidget(self.arrow)
        slot, index = self.place.slot, self.place.index
        self.title = QLabel(slot.title if index is None else f"{slot.title} {index + 1}")
        self.title.setMinimumWidth(TITLE)
        row.addWidget(self.title)
        self.chooser = PluginChooser(slot.takes, slot.optional) if slot.is_plugin or slot.optional else None
        if self.chooser is not None:
            self.chooser.picked.connect(self._pick)
            row.addWidget(self.chooser, 1)
        else:
            row.addStretch(1)
        self.status = QLabel()
        row.addWidget(self.status)
        for text, tip, action in self._buttons():
            button = QToolButton()
            button.setText(text)
            button.setFixedWidth(BUTTON)
            button.setToolTip(tip)
            button.clicked.connect(action)
            row.addWidget(button)
        return row

    def _buttons(self) -> list[tuple[str, str, Callable[[], Any]]]:
        slot, index = self.place.slot.name, self.place.index
        if index is not None:
            return [
                ("↑", "move this step up", lambda: self._move(-1)),
                ("↓", "move this step down", lambda: self._move(1)),
                ("✕", "remove this step", lambda: self._try(lambda document: document.remove(slot, index))),
            ]
        return [("▶", "run to here", lambda: self.run_to_here.emit(slot))] if slot in RUNS else []

    def _move(self, by: int) -> None:
        index = self.place.index
        assert index is not None

        def move(document: PipelineDocument) -> None:
            if 0 <= index + by < len(document.pipeline.preprocess):
                document.move(index, index + by)

        self._try(move)

    def _pick(self, name: str) -> None:
        slot, index = self.place.slot, self.place.index
        if not name:
            self._try(lambda document: document.remove(slot.name))
        elif self._part is None:
            self._try(lambda document: document.add(slot.name, name if slot.is_plugin else None))
        elif slot.is_plugin:
            self._try(lambda document: document.set(slot.name, "use", name, index=index))

    def _try(self, change: Callable[[PipelineDocument], None]) -> None:
        try:
            self._edit(change)
        except ValidationError as error:
            if self.chooser is not None:
                self.chooser.show_part(self._part)
            self.message.say(plain(error))

    def _set(self, key: str, value: Any, way: str) -> None:
        slot, index = self.place.slot.name, self.place.index
        self._edit(lambda document: document.set(slot, key, value, way, index))

    def _unfold(self, shown: bool) -> None:
        """Show or hide the form, which is made when it is first looked at."""
        self.arrow.setText("▾" if shown else "▸")
        if shown and self.form is None and self._part is not None:
            self.form = Form(self._part, self._set)
            self.form.setContentsMargins(8, 0, 4, 4)
            self._body.addWidget(self.form)
        if self.form is not None:
            self.form.setVisible(shown)
