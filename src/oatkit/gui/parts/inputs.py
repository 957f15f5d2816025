"""The fields of a form: one widget for each sort of parameter, all with a text and one signal."""

from typing import Any

from pydantic.fields import FieldInfo
from qtpy.QtCore import QEvent, Qt, Signal
from qtpy.QtGui import QKeySequence
from qtpy.QtWidgets import QCheckBox, QComboBox, QFileDialog, QHBoxLayout, QLineEdit, QToolButton, QWidget

from oatkit.gui.parts.fields import Sort, is_optional, sort_of, stepped, words_of, written


class Line(QLineEdit):
    """A line of text; with a parameter that is a number, wheel and arrow keys change it by a step."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(parent)
        self._field = field
        self.setMinimumWidth(60)
        self.setPlaceholderText(written(field.default) or "not set")

    def event(self, event: Any) -> bool:
        """Leave undo and redo to the pipeline, unless there is something typed to undo."""
        undoes = event.type() == QEvent.Type.ShortcutOverride and (
            event.matches(QKeySequence.StandardKey.Undo) or event.matches(QKeySequence.StandardKey.Redo)
        )
        if undoes and not self.isModified():
            event.ignore()
            return False
        return super().event(event)

    def wheelEvent(self, event: Any) -> None:  # noqa: D102
        if self.hasFocus() and self._step(1 if event.angleDelta().y() > 0 else -1):
            event.accept()
        else:
            event.ignore()

    def keyPressEvent(self, event: Any) -> None:  # noqa: D102
        steps = {Qt.Key.Key_Up: 1, Qt.Key.Key_Down: -1}.get(event.key(), 0)
        if not (steps and self._step(steps)):
            super().keyPressEvent(event)

    def _step(self, steps: int) -> bool:
        text = self.text() or written(self._field.default)
        new = stepped(self._field, text, steps)
        if new == text:
            return False
        self.setText(new)
        self.setModified(True)
        self.editingFinished.emit()
        return True


class Chooser(QComboBox):
    """A combo box that scrolling over it does not change."""

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.setMinimumContentsLength(4)
        self.setMinimumWidth(72)

    def wheelEvent(self, event: Any) -> None:  # noqa: D102
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()


class Input(QWidget):
    """A field for one parameter."""

    committed = Signal(str)
    """The user has entered a text (that of a check box is ``true`` or ``false``)."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(parent)
        self._field, self.shown = field, ""
        self._entered, self._wrong = "", False
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._row.setSpacing(2)

    def _hold(self, widget: Any) -> None:
        self._row.addWidget(widget, 1)
        self.setFocusProxy(widget)

    def show_text(self, text: str) -> None:
        """Show the value that the pipeline holds."""
        self.shown = self._entered = text
        self._display(text)

    def text(self) -> str:
        """Return what is entered."""
        raise NotImplementedError

    def mark(self, wrong: bool) -> None:
        """Draw a red border about a value that is refused; entered once more, it is tried again."""
        self._wrong = wrong
        self.focusProxy().setStyleSheet("border: 1px solid #e5484d;" if wrong else "")

    def _display(self, text: str) -> None:
        raise NotImplementedError

    def _commit(self, *_: Any) -> None:
        if self._wrong or self.text() != self._entered:
            self._entered = self.text()
            self.committed.emit(self._entered)


class SwitchInput(Input):
    """A check box."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(field, parent)
        self.box = QCheckBox()
        self.box.clicked.connect(self._commit)
        self._hold(self.box)

    def text(self) -> str:  # noqa: D102
        return written(self.box.isChecked())

    def _display(self, text: str) -> None:
        self.box.setChecked(text == "true")


class ChoiceInput(Input):
    """One of some words; with a number among the choices, a line that takes it, too."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(field, parent)
        self.box = Chooser()
        if is_optional(field) and sort_of(field) is Sort.CHOICE:
            self.box.addItem("")
        self.box.addItems([str(word) for word in words_of(field)])
        if sort_of(field) is Sort.MIXED:
            self.box.setEditable(True)
            self.box.setInsertPolicy(QComboBox.InsertPolicy.NoInsert)
            self.box.setCompleter(None)
            self.box.setLineEdit(Line(field))
            self.box.lineEdit().editingFinished.connect(self._commit)
        self.box.activated.connect(self._commit)
        self._hold(self.box)

    def text(self) -> str:  # noqa: D102
        return self.box.currentText()

    def _display(self, text: str) -> None:
        self.box.setCurrentIndex(self.box.findText(text))
        if self.box.isEditable():
            self.box.setEditText(text)


class TextInput(Input):
    """A line for a number, a text or a list."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(field, parent)
        self.line = Line(field)
        self.line.editingFinished.connect(self._commit)
        self._hold(self.line)

    def text(self) -> str:  # noqa: D102
        return self.line.text().strip()

    def _display(self, text: str) -> None:
        self.line.setText(text)
        self.line.setCursorPosition(0)


class PathInput(TextInput):
    """A line for a path, with a button that opens a file dialog."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(field, parent)
        button = QToolButton()
        button.setText("…")
        button.setToolTip("choose a file")
        button.clicked.connect(self._browse)
        self._row.addWidget(button)

    def _browse(self) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Choose a file", self.text())
        if path:
            self.line.setText(path)
            self._commit()


class FixedInput(TextInput):
    """A value that is shown only."""

    def __init__(self, field: FieldInfo, parent: Any = None) -> None:
        super().__init__(field, parent)
        self.line.setReadOnly(True)


INPUTS = {
    Sort.SWITCH: SwitchInput, Sort.CHOICE: ChoiceInput, Sort.MIXED: ChoiceInput, Sort.NUMBER: TextInput,
    Sort.TEXT: TextInput, Sort.PATH: PathInput, Sort.FIXED: FixedInput,
}  # fmt: skip


def input_for(field: FieldInfo) -> Input:
    """Return the widget for a parameter that is no part."""
    return INPUTS[sort_of(field)](field)
