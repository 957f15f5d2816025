"""The batch widget: many scans through the pipeline in the window, each with its status."""

from pathlib import Path
from typing import Any

from qtpy.QtCore import QCoreApplication, Qt, QTimer
from qtpy.QtWidgets import (
    QAbstractItemView,
    QCheckBox,
    QFileDialog,
    QGridLayout,
    QHeaderView,
    QLineEdit,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from oatkit.errors import OatkitError
from oatkit.gui.batch.batch import FileStatus, outputs, run_all
from oatkit.gui.job import Job
from oatkit.gui.leaving import when_gone
from oatkit.gui.parts.buttons import button
from oatkit.gui.parts.forms import Message, plain
from oatkit.gui.pipeline.runner import PERIOD_MS
from oatkit.gui.workbench import workbench
from oatkit.store import load

WAITING = "waiting"
NAME, STATUS = 0, 1
"""Columns of the table."""


class BatchWidget(QWidget):
    """A list of scans, where their results go, and how far each is."""

    def __init__(self, napari_viewer: Any, parent: Any = None) -> None:
        super().__init__(parent)
        self.bench = workbench(napari_viewer)
        self.scans: list[Path] = []
        self.states: dict[int, FileStatus] = {}
        """How it stands with each scan that was begun, by its row."""
        self._outputs: list[Path] = []
        self._job: Job | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(PERIOD_MS)
        self._timer.timeout.connect(self._look)
        self.table = _table()
        self.table.cellDoubleClicked.connect(lambda row, _: self.show_result(row))
        self.folder = QLineEdit(str(Path.cwd() / "results"))
        self.folder.setToolTip("folder that the results go to, one for each scan")
        self.overwrite = QCheckBox("Overwrite results that are there")
        self.message = Message()
        self._arrange()
        stop = self._stopper()
        when_gone(self, stop)
        QCoreApplication.instance().aboutToQuit.connect(stop)

    @property
    def running(self) -> bool:
        """Whether scans are being run."""
        return self._job is not None

    def add(self, paths: list[Path]) -> None:
        """Add scans to the list, each once."""
        for path in paths:
            if path not in self.scans:
                self.scans.append(path)
        self._list()

    def start(self) -> None:
        """Run all scans of the list through the pipeline as it stands now."""
        self.states = {}
        self._list()
        try:
            folder = Path(self.folder.text()).expanduser()
            folder.mkdir(parents=True, exist_ok=True)
            self._outputs = outputs(self.scans, folder)
            self._job = run_all(self.bench.session.pipeline, list(self.scans), folder, self.overwrite.isChecked())
        except (OatkitError, OSError) as error:
            self.message.say(plain(error))
            return
        self.message.say("")
        self._timer.start()
        self._enable()

    def cancel(self) -> None:
        """End the run; results that are complete stay."""
        if self._job is not None:
            self._job.cancel()
            self._end("cancelled")

    def show_result(self, row: int) -> None:
        """Show the result of a scan that is done, or what went wrong with another."""
        state = self.states.get(row)
        if state is None or state.word != "done":
            self.message.say(state.sentence if state else "")
            return
        try:
            self.bench.layers.show_result(load(self._outputs[row]))
        except OatkitError as error:
            self.message.say(plain(error))

    def _look(self) -> None:
        job = self._job
        if job is None:
            self._timer.stop()
            return
        done = job.done
        for state in job.drain():
            self.states[state.index] = state
            self._show_state(state)
        if done:
            if job.failure:
                self.message.say(job.failure.sentence)
            self._end("")

    def _end(self, word: str) -> None:
        """Take note that nothing runs any more; what was at work becomes `word`."""
        self._job = None
        self._timer.stop()
        for index, state in self.states.items():
            if state.word == "running":
                self.states[index] = FileStatus(index, word, "")
                self._show_state(self.states[index])
        self._enable()

    def _list(self) -> None:
        self.table.setRowCount(len(self.scans))
        for row, path in enumerate(self.scans):
            item = QTableWidgetItem(path.name)
            item.setToolTip(str(path))
            self.table.setItem(row, NAME, item)
            self.table.setItem(row, STATUS, QTableWidgetItem(WAITING))
        for state in self.states.values():
            self._show_state(state)
        self._enable()

    def _show_state(self, state: FileStatus) -> None:
        item = QTableWidgetItem(f"{state.word}: {state.sentence}" if state.sentence else state.word)
        item.setToolTip(state.sentence)
        self.table.setItem(state.index, STATUS, item)

    def _remove(self) -> None:
        rows = {index.row() for index in self.table.selectionModel().selectedRows()}
        self.scans = [path for row, path in enumerate(self.scans) if row not in rows]
        self.states = {}
        self._list()

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(6, 6, 6, 6)
        grid = QGridLayout()
        self.adder = button("Add scans", "choose scan files", self._ask_scans)
        self.remover = button("Remove", "take the selected scans off the list", self._remove)
        self.run = button("Run all", "run all frames of each scan through the pipeline", self.start)
        self.stop = button("Cancel", "end the run; results that are complete stay", self.cancel)
        browse = button("Folder", "choose where the results go", self._ask_folder)
        grid.addWidget(self.adder, 0, 0)
        grid.addWidget(self.remover, 0, 1)
        grid.addWidget(self.folder, 1, 0)
        grid.addWidget(browse, 1, 1)
        grid.addWidget(self.overwrite, 2, 0, 1, 2)
        grid.addWidget(self.run, 3, 0)
        grid.addWidget(self.stop, 3, 1)
        column.addLayout(grid)
        column.addWidget(self.message)
        column.addWidget(self.table, 1)
        self._enable()

    def _enable(self) -> None:
        for one in (self.adder, self.remover, self.run):
            one.setEnabled(not self.running)
        self.stop.setEnabled(self.running)

    def _ask_scans(self) -> None:
        paths, _ = QFileDialog.getOpenFileNames(self, "Add scans")
        self.add([Path(path) for path in paths])

    def _ask_folder(self) -> None:
        path = QFileDialog.getExistingDirectory(self, "Where the results go", self.folder.text())
        if path:
            self.folder.setText(path)

    def _stopper(self) -> Any:
        """Return what ends the run when the widget is gone; it must not ask the widget's own parts."""

        def stop(*_: Any) -> None:
            if self._job is not None:
                self._job.cancel()
                self._job.wait(2)

        return stop


def _table() -> QTableWidget:
    table = QTableWidget(0, 2)
    table.setHorizontalHeaderLabels(["scan", "status"])
    table.setToolTip("double-click a scan that is done to see its images")
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.verticalHeader().hide()
    table.horizontalHeader().setSectionResizeMode(NAME, QHeaderView.ResizeMode.ResizeToContents)
    table.horizontalHeader().setSectionResizeMode(STATUS, QHeaderView.ResizeMode.Stretch)
    table.setTextElideMode(Qt.TextElideMode.ElideRight)
    return table
