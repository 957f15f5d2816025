"""What runs on what: the scan and its frame, the pipeline, its file, undo and redo."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QKeySequence, QShortcut
from qtpy.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QMenu,
    QPushButton,
    QSizePolicy,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from oatkit.gui.document import PipelineDocument
from oatkit.gui.parts.buttons import tool
from oatkit.gui.parts.forms import Message
from oatkit.gui.parts.inputs import Chooser
from oatkit.gui.pipeline.script import script_of
from oatkit.gui.session import Session
from oatkit.pipeline import presets

PIPELINES = "Pipelines (*.toml)"
OWN = "own pipeline"
"""What the chooser of presets shows for a pipeline that began as none of them."""


class Header(QWidget):
    """The top of the pipeline widget."""

    frame_taken = Signal()
    """Another frame of the scan."""
    pipeline_taken = Signal()
    """Another pipeline, or an edit taken back."""

    def __init__(self, session: Session, open_path: Callable[[Path], None], parent: Any = None) -> None:
        super().__init__(parent)
        self._session, self._open = session, open_path
        self._origin = ""
        self.scan = QLabel()
        self.scan.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.frame = QSpinBox()
        self.frame.setToolTip("frame of the scan, from 0")
        self.frame.setKeyboardTracking(False)
        self.frame.valueChanged.connect(self._go_to_frame)
        self.preset = Chooser()
        self.preset.addItem(OWN)
        self.preset.addItems(list(presets()))
        self.preset.setToolTip("pipelines that come with oatkit")
        self.preset.activated.connect(self._take_preset)
        self.undo = tool("↶", "undo the last edit of the pipeline (Ctrl+Z)", self._undo)
        self.redo = tool("↷", "redo the edit (Ctrl+Shift+Z)", self._redo)
        self.message = Message()
        self._arrange()
        for keys, action in ((QKeySequence.StandardKey.Undo, self._undo), ("Ctrl+Shift+Z", self._redo)):
            shortcut = QShortcut(QKeySequence(keys), parent or self)
            shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            shortcut.activated.connect(action)
        self.show_scan()
        self.show_pipeline()

    def show_scan(self) -> None:
        """Show the scan of the session."""
        scan = self._session.scan
        self.scan.setText(scan.name or "scan" if scan else "no scan yet")
        self.scan.setToolTip(scan.source if scan else "drag a scan into the window, or open one")
        self.frame.blockSignals(True)
        self.frame.setRange(0, scan.frames - 1 if scan else 0)
        self.frame.setSuffix(f" of {scan.frames}" if scan else "")
        self.frame.setValue(self._session.frame)
        self.frame.setEnabled(scan is not None and scan.frames > 1)
        self.frame.blockSignals(False)

    def show_pipeline(self) -> None:
        """Show which pipeline it is, and what can be undone."""
        document = self._session.document
        known = [name for name, text in presets().items() if text == document.text]
        self._origin = known[0] if known else "" if document.path else self._origin
        self.preset.setItemText(0, f"{self._origin} *" if self._origin else OWN)
        self.preset.setCurrentIndex(self.preset.findText(self._origin) if known else 0)
        self.file.setText(("*" if document.changed else "") + (document.path.name if document.path else "Pipeline"))
        self.file.setToolTip(str(document.path or "open, save or export the pipeline"))
        self.undo.setEnabled(document.can_undo)
        self.redo.setEnabled(document.can_redo)

    def open_file(self, path: str | Path) -> None:
        """Open a scan, a result or a pipeline, or say why it cannot be; `open_path` tells all widgets."""
        self._try(lambda: self._open(Path(path)))

    def open_pipeline(self, path: Path) -> None:
        """Open a pipeline file, or say why it cannot be."""

        def take() -> None:
            self._session.document = PipelineDocument.open(path)

        self._try(take, self.pipeline_taken)

    def save(self, path: Path) -> None:
        """Write the pipeline, or say why it cannot be."""
        self._try(lambda: self._session.document.save(path), self.pipeline_taken)

    def export(self, path: Path) -> None:
        """Write the script, or say why it cannot be."""
        scan = self._session.scan
        source = scan.source if scan and _is_file(scan.source) else ""
        text = script_of(self._session.document, source, self._session.frame)
        self._try(lambda: path.write_text(text, encoding="utf-8"))

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(4)
        opener = QPushButton("Open scan")
        opener.setToolTip("open a scan file")
        opener.clicked.connect(self._ask_scan)
        self.frame.setMaximumWidth(96)
        self.file = QPushButton()
        self.file.setMenu(self._menu())
        for widgets in ((self.scan, self.frame, opener), (self.preset, self.file, self.undo, self.redo)):
            row = QHBoxLayout()
            row.setSpacing(4)
            for widget in widgets:
                row.addWidget(widget, 1 if widget in (self.scan, self.preset) else 0)
            column.addLayout(row)
        column.addWidget(self.message)

    def _menu(self) -> QMenu:
        menu = QMenu(self)
        menu.addAction("Open …", self._ask_pipeline)
        menu.addAction("Save", self._save)
        menu.addAction("Save as …", self._ask_save)
        menu.addSeparator()
        menu.addAction("Export as Python script …", self._ask_export)
        return menu

    def _try(self, action: Callable[[], Any], done: Any = None) -> None:
        if self.message.attempt(action) and done is not None:
            done.emit()

    def _go_to_frame(self, frame: int) -> None:
        self._try(lambda: self._session.go_to_frame(frame), self.frame_taken)

    def _take_preset(self, index: int) -> None:
        if index == 0:
            self.show_pipeline()
            return

        def take() -> None:
            self._session.document.replace(presets()[self.preset.itemText(index)])

        self._try(take, self.pipeline_taken)

    def _undo(self) -> None:
        self._try(self._session.document.undo, self.pipeline_taken)

    def _redo(self) -> None:
        self._try(self._session.document.redo, self.pipeline_taken)

    def _ask_scan(self) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Open a scan")
        if path:
            self.open_file(path)

    def _ask_pipeline(self) -> None:
        path, _ = QFileDialog.getOpenFileName(self, "Open a pipeline", "", PIPELINES)
        if path:
            self.open_pipeline(Path(path))

    def _save(self) -> None:
        path = self._session.document.path
        if path:
            self.save(path)
        else:
            self._ask_save()

    def _ask_save(self) -> None:
        proposed = str(self._session.document.path or "pipeline.toml")
        path, _ = QFileDialog.getSaveFileName(self, "Save the pipeline", proposed, PIPELINES)
        if path:
            self.save(Path(path))

    def _ask_export(self) -> None:
        path, _ = QFileDialog.getSaveFileName(self, "Export as a script", "pipeline.py", "Python (*.py)")
        if path:
            self.export(Path(path))


def _is_file(text: str) -> bool:
    try:
        return bool(text) and Path(text).exists()
    except (OSError, ValueError):  # a sentence in place of a path
        return False
