"""A form made from the declared parameters of a plugin or a table."""

from collections.abc import Callable
from typing import Any

from pydantic.fields import FieldInfo
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QGridLayout, QLabel, QVBoxLayout, QWidget

from oatkit.errors import OatkitError, ValidationError
from oatkit.gui.parts.fields import Sort, help_of, is_optional, label_of, parsed, sort_of, written
from oatkit.gui.parts.inputs import Input, input_for
from oatkit.gui.parts.plugin_chooser import PluginChooser
from oatkit.parameters import Parameters, bounds_of, part_of

Setter = Callable[[str, Any, str], None]
"""Called with the key, the value and the part (``""``, ``"regularizer"``); raises `ValidationError`."""


class Message(QLabel):
    """A sentence under a field that says what is wrong; nothing where all is well."""

    def __init__(self, parent: Any = None) -> None:
        super().__init__(parent)
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setStyleSheet("color: #e5484d; padding: 0px;")
        self.hide()

    def say(self, sentence: str) -> None:
        """Show a sentence, or nothing for an empty one."""
        self.setText(sentence)
        self.setVisible(bool(sentence))

    def attempt(self, action: Callable[[], Any]) -> bool:
        """Do what the user asked for, and say what is wrong with it, or nothing; return whether it went well."""
        try:
            action()
        except (OatkitError, OSError) as error:
            self.say(plain(error))
            return False
        self.say("")
        return True


class Form(QWidget):
    """The parameters of one part of a pipeline, each with its unit, help and what is wrong with it."""

    def __init__(self, part: Parameters, setter: Setter, way: str = "", parent: Any = None) -> None:
        super().__init__(parent)
        self.cls, self._set, self._way = type(part), setter, way
        self.inputs: dict[str, Input] = {}
        self.messages: dict[str, Message] = {}
        self.parts: dict[str, Part] = {}
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(6)
        self._grid.setVerticalSpacing(3)
        self._grid.setColumnStretch(1, 1)
        for name, field in self.cls.model_fields.items():
            self._add(name, field, part)
        if not self.cls.model_fields:
            self._grid.addWidget(QLabel("no parameters"), 0, 0)
        self.show_part(part)

    def show_part(self, part: Parameters) -> None:
        """Show the values of a part of the same class."""
        for name, widget in self.inputs.items():
            text = written(getattr(part, name))
            if self.messages[name].text() and text == widget.shown:
                continue  # what is refused stays to be mended, while other fields change
            widget.show_text(text)
            self._judge(name, "")
        for name, nested in self.parts.items():
            nested.show_part(getattr(part, name))

    def _add(self, name: str, field: FieldInfo, part: Parameters) -> None:
        row = self._grid.rowCount()
        label = QLabel(label_of(name, field))
        label.setToolTip(help_of(name, field))
        label.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        if sort_of(field) is Sort.PART:
            self._add_part(row, name, field, part)
            return
        self._grid.addWidget(label, row, 0)
        widget = self.inputs[name] = input_for(field)
        widget.setToolTip(help_of(name, field))
        widget.committed.connect(lambda text: self._commit(name, field, text))
        self._grid.addWidget(widget, row, 1)
        self._grid.addWidget(QLabel(bounds_of(field).unit), row, 2)
        message = self.messages[name] = Message()
        self._grid.addWidget(message, row + 1, 0, 1, 3)

    def _add_part(self, row: int, name: str, field: FieldInfo, part: Parameters) -> None:
        way = f"{self._way}.{name}" if self._way else name
        nested = self.parts[name] = Part(name, field, getattr(part, name), self._set, way)
        self._grid.addWidget(nested, row, 0, 1, 3)

    def _commit(self, name: str, field: FieldInfo, text: str) -> None:
        value = text == "true" if sort_of(field) is Sort.SWITCH else parsed(field, text)
        try:
            self._set(name, value, self._way)
        except ValidationError as error:
            self._judge(name, plain(error))
        else:
            self._judge(name, "")
            self.inputs[name].show_text(written(value) or self.inputs[name].shown)

    def _judge(self, name: str, sentence: str) -> None:
        """Say what is wrong with a value, or nothing."""
        self.inputs[name].mark(bool(sentence))
        self.messages[name].say(sentence)


class Part(QWidget):
    """A plugin within a plugin: its own chooser, and its own form."""

    def __init__(
        self, name: str, field: FieldInfo, part: Parameters | None, setter: Setter, way: str, parent: Any = None
    ) -> None:
        super().__init__(parent)
        ability = part_of(field)
        assert ability is not None
        self._name, self._set, self._way = name, setter, way
        self._part: Parameters | None = None
        self.form: Form | None = None
        self.chooser = PluginChooser(ability, optional=is_optional(field))
        self.chooser.picked.connect(self._pick)
        self.message = Message()
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        label = QLabel(label_of(name, field))
        label.setToolTip(help_of(name, field))
        head = QGridLayout()
        head.addWidget(label, 0, 0)
        head.addWidget(self.chooser, 0, 1)
        head.setColumnStretch(1, 1)
        self.chooser.setVisible(bool(ability.kind) or is_optional(field))
        self._column.addLayout(head)
        self._column.addWidget(self.message)
        self.show_part(part)

    def show_part(self, part: Parameters | None) -> None:
        """Show a part, with a new form where its class is another."""
        self._part = part
        self.chooser.show_part(part)
        self.message.say("")
        if self.form is not None and (part is None or type(part) is not self.form.cls):
            self._column.removeWidget(self.form)
            self.form.hide()
            self.form.deleteLater()
            self.form = None
        if part is not None and self.form is None:
            self.form = Form(part, self._set, self._way)
            self.form.setContentsMargins(12, 0, 0, 0)
            self._column.addWidget(self.form)
        elif part is not None and self.form is not None:
            self.form.show_part(part)

    def _pick(self, name: str) -> None:
        above, _, key = self._way.rpartition(".")
        try:
            if name:
                self._set("use", name, self._way)
            else:
                self._set(key, None, above)
        except ValidationError as error:
            self.chooser.show_part(self._part)
            self.message.say(plain(error))


def plain(error: Exception) -> str:
    """Return what is wrong without the name of the file that it would be wrong in."""
    return "\n".join(line.removeprefix("pipeline").lstrip(": ") for line in str(error).splitlines())
