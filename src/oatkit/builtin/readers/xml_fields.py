"""Fields of an XML header, each missing, empty or malformed one an error that names file and field."""

import math
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from oatkit.errors import ReadError
from oatkit.hostile import printable

MODIFIERS = {"none": 1.0, "": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
"""Values of the attribute ``unit-modifier`` that are understood for frequencies."""


@dataclass(frozen=True)
class Node:
    """An element, with the file and the path that errors name. Names are matched without their namespace."""

    element: Element
    where: str
    """The file."""
    path: str = ""
    """The names from the root to here, joined by ``/``."""

    def all(self, name: str) -> list["Node"]:
        """Return the children of that name, in the order of the file."""
        path = f"{self.path}/{name}".lstrip("/")
        found = [child for child in self.element if local_name(child) == name]
        numbered = len(found) > 1
        return [Node(e, self.where, f"{path}[{i + 1}]" if numbered else path) for i, e in enumerate(found)]

    def find(self, path: str) -> "Node | None":
        """Return the first element at a path of names joined by ``/``, or None."""
        node = self
        for name in path.split("/"):
            children = node.all(name)
            if not children:
                return None
            node = children[0]
        return node

    def get(self, path: str) -> "Node":
        """Return the first element at a path. Raises `ReadError` where there is none."""
        node = self.find(path)
        if node is None:
            raise ReadError(
                f"{self.where} <{self.path}/{path}>: expected this element, found nothing".replace("</", "<")
            )
        return node

    def some(self, path: str, name: str) -> list["Node"]:
        """Return the elements called `name` at a path. Raises `ReadError` where there is none."""
        parent = self.get(path)
        parent.get(name)
        return parent.all(name)

    @property
    def text(self) -> str:
        """The text, stripped. Raises `ReadError` where it is empty."""
        text = (self.element.text or "").strip()
        if not text:
            raise self.error("a text", "nothing")
        return text

    def attribute(self, name: str) -> str | None:
        """Return an attribute, or None."""
        return self.element.get(name)

    def number(self, expected: str) -> float:
        """Return the text as a finite number; `expected` says what it is, with its unit."""
        try:
            value = float(self.text)
        except ValueError:
            raise self.error(expected, repr(printable(self.text, 60))) from None
        if not math.isfinite(value):
            raise self.error(expected, self.text)
        return value

    def count(self, expected: str, lowest: int, highest: int) -> int:
        """Return the text as a whole number between two limits."""
        value = self.number(expected)
        if not (lowest <= value <= highest and value == int(value)):
            raise self.error(f"{expected}, a whole number in {lowest} .. {highest}", printable(self.text, 60))
        return int(value)

    def frequency_hz(self) -> float:
        """Return the text as a frequency, by its attribute ``unit-modifier`` (MHz without one)."""
        modifier = self.attribute("unit-modifier")
        modifier = "M" if modifier is None else modifier
        if modifier not in MODIFIERS:
            raise self.error(f"a unit-modifier among {', '.join(filter(None, MODIFIERS))}", printable(modifier, 60))
        return self.number("a frequency in MHz") * MODIFIERS[modifier]

    def error(self, expected: str, found: str) -> ReadError:
        """Return the error of this field."""
        return ReadError(f"{self.where} <{self.path}>: expected {expected}, found {found}")


def local_name(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rsplit("}", 1)[-1]
