"""The steps of the pipeline as a stack of cards."""

from typing import Any

from qtpy.QtCore import Qt, Signal
from qtpy.QtWidgets import QFrame, QScrollArea, QVBoxLayout, QWidget

from oatkit.api import Preprocessor
from oatkit.errors import ValidationError
from oatkit.gui.parts.plugin_chooser import PluginChooser
from oatkit.gui.pipeline.cards import Card, Edit
from oatkit.gui.pipeline.runner import Runner
from oatkit.gui.pipeline.slots import Place, places


class Stack(QScrollArea):
    """All cards, in the order of the pipeline, in a list that scrolls."""

    run_to_here = Signal(str)

    def __init__(self, runner: Runner, edit: Edit, parent: Any = None) -> None:
        super().__init__(parent)
        self._runner, self._edit = runner, edit
        self.cards: dict[Place, Card] = {}
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        inside = QWidget()
        self._column = QVBoxLayout(inside)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(2)
        self.adder = _adder()
        self.adder.picked.connect(self._add)
        self._column.addWidget(self.adder)
        self._column.addStretch(1)
        self.setWidget(inside)
        self.show_pipeline()
        self.card("reconstruct").expand()

    def card(self, slot: str, index: int | None = None) -> Card:
        """Return the card of a place."""
        return next(c for p, c in self.cards.items() if p.slot.name == slot and p.index == index)

    def show_pipeline(self) -> None:
        """Show the pipeline of the session: cards come and go with its steps, the others stay as they are."""
        pipeline = self._runner.session.pipeline
        wanted = places(pipeline)
        for place in [place for place in self.cards if place not in wanted]:
            card = self.cards.pop(place)
            self._column.removeWidget(card)
            card.hide()
            card.deleteLater()
        for position, place in enumerate(wanted):
            if place not in self.cards:
                self._insert(position, place)
            self.cards[place].show_part(place.part(pipeline))
        self._put_adder(wanted)
        self.show_states()

    def show_states(self) -> None:
        """Show how each step stands to the last run."""
        session, ledger = self._runner.session, self._runner.ledger
        for place, card in self.cards.items():
            state = ledger.state(place, session.pipeline, session.scan, session.frame)
            card.show_state(state, self._runner.failure)

    def show_failure(self, place: Place) -> None:
        """Bring the card of a step that failed into sight."""
        if place in self.cards:
            self.ensureWidgetVisible(self.cards[place])

    def _insert(self, position: int, place: Place) -> None:
        card = self.cards[place] = Card(place, self._edit)
        card.run_to_here.connect(self.run_to_here)
        self._column.removeWidget(self.adder)
        self._column.insertWidget(position, card)

    def _put_adder(self, wanted: list[Place]) -> None:
        """Put the row that adds a step below the last step of ``preprocess``."""
        self._column.removeWidget(self.adder)
        after = [place.slot.name for place in wanted].index("forward")
        self._column.insertWidget(after, self.adder)

    def _add(self, name: str) -> None:
        try:
            if name:
                self._edit(lambda document: document.add("preprocess", name))
        except ValidationError as error:
            self.adder.setToolTip(str(error))
        self.adder.setCurrentIndex(0)


def _adder() -> PluginChooser:
    chooser = PluginChooser(Preprocessor, optional=True)
    chooser.setItemText(0, "add a preprocessing step …")
    chooser.setToolTip("adds a step on the raw signals, after the others")
    return chooser
