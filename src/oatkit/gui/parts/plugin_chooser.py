"""The chooser of a plugin: all that are installed and fit, and greyed what is broken, with the reason."""

from typing import Any

from qtpy.QtCore import Qt, Signal

from oatkit.gui.parts.choices import Choice, choices
from oatkit.gui.parts.inputs import Chooser
from oatkit.parameters import Parameters

NONE = "none"


class PluginChooser(Chooser):
    """Chooses among the plugins that fit `ability`."""

    picked = Signal(str)
    """The user has taken a plugin by its name; ``""`` for none."""

    def __init__(self, ability: type[Parameters], optional: bool = False, parent: Any = None) -> None:
        super().__init__(parent)
        if optional:
            self.addItem(NONE, "")
        for choice in choices(ability) if ability.kind else ():
            self._add(choice)
        if not ability.kind:
            self.addItem("on", "on")
        self.activated.connect(lambda index: self.picked.emit(self.itemData(index)))

    def show_part(self, part: Parameters | None) -> None:
        """Show what is chosen."""
        name = "" if part is None else (part.written_as or part.name or "on")
        self.setCurrentIndex(self.findData(name))
        self.setToolTip(self.itemData(self.currentIndex(), Qt.ItemDataRole.ToolTipRole) or "")

    def _add(self, choice: Choice) -> None:
        self.addItem(choice.name if choice.usable else f"{choice.name} (broken)", choice.name)
        index = self.count() - 1
        self.setItemData(index, choice.about, Qt.ItemDataRole.ToolTipRole)
        self.model().item(index).setEnabled(choice.usable)
