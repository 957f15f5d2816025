"""Shows how the image of a layer was made, to read and to copy."""

from typing import Any

from qtpy.QtGui import QFontDatabase, QGuiApplication
from qtpy.QtWidgets import QDialog, QHBoxLayout, QPlainTextEdit, QPushButton, QVBoxLayout

from oatkit.data import Image
from oatkit.gui.pipeline.recipe import recipe_text, recipe_toml
from oatkit.result import Result


class RecipeDialog(QDialog):
    """The recipe of one image."""

    def __init__(self, title: str, image: Image, result: Result | None, parent: Any = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(f"Recipe of {title}")
        self.resize(640, 560)
        self.text = QPlainTextEdit(recipe_text(image, result))
        self.text.setReadOnly(True)
        self.text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        copy = QPushButton("Copy as TOML")
        copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(recipe_toml(image, result)))
        close = QPushButton("Close")
        close.clicked.connect(self.accept)
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(copy)
        row.addWidget(close)
        column = QVBoxLayout(self)
        column.addWidget(self.text)
        column.addLayout(row)
