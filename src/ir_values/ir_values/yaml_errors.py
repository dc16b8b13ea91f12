"""Everything that is wrong with a cell or robot file, in one run.

The reader stops at the first error. Here what it refused is left out and the rest is read again,
until nothing is wrong any more. Errors that only follow from what was left out (a missing key, a
name that was in it) are not reported.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import TypeVar

from ir_values.errors import DescriptionFileError
from ir_values.yaml_items import Item
from ir_values.yaml_tree import Node, Scalar, parse_yaml

ERRORS_MAX = 100
"""Errors of one file; after so many the rest is not looked for."""

_PLACE = re.compile(r"[A-Za-z_]\w*(?:\[\d+\]|\.[A-Za-z_][\w-]*)*")
_STEP = re.compile(r"\[(\d+)\]|([A-Za-z_][\w-]*)")
_UNKNOWN_KEY = re.compile(r"has the unknown key '([^']*)'")
_MISSING = re.compile(r"has no (\w+)|must have exactly one of| belongs to a |known are none$")
_HANDS = re.compile(r"can't be (attached|detached)")

Step = str | int
Error = TypeVar("Error", bound=DescriptionFileError)


def document_errors(
    text: str, source: str, kind: type[Error], read: Callable[[Item], object]
) -> tuple[Error, ...]:
    """All errors of a text, by line; none: `read` can read it. kind: what `read` raises."""
    found: list[Error] = []
    try:
        document = _Document(parse_yaml(text, source, kind))
    except kind as error:
        return (error,)
    for _ in range(ERRORS_MAX):
        try:
            read(Item(document.root, source, kind, ""))
            break
        except kind as error:
            place = document.place_of(error.sentence)
            if not document.follows(error.sentence, place):
                found.append(kind(source, error.line, document.renumbered(error.sentence, place)))
            if not document.leave_out(
                place, unknown=_UNKNOWN_KEY.search(error.sentence) is not None
            ):
                break
    return tuple(sorted(found, key=lambda error: error.line))


class _Document:
    """A tree whose wrong parts are left out one after the other."""

    def __init__(self, root: Node) -> None:
        self.root = root
        self._names: set[str] = set()  # that stood in what was left out
        self._thinned: dict[
            int, Node
        ] = {}  # by id: what misses something now, and what that is a part of
        self._step_gone = False  # of the program, or a part of one
        self._known: dict[int, Node] = {}  # by id: mappings of which a known key is missing now
        self._numbers: dict[int, list[int]] = {}  # of the entries that a list still has

    def place_of(self, sentence: str) -> tuple[Step, ...]:
        """The steps from the root to what a sentence blames; an unknown key is the last of them."""
        found = _PLACE.match(sentence)
        steps: list[Step] = []
        for number, key in _STEP.findall(found.group()) if found else ():
            step = int(number) if number else key
            if self._child(self._at(tuple(steps)), step) is None:
                break
            steps.append(step)
        unknown = _UNKNOWN_KEY.search(sentence)
        return (*steps, unknown.group(1)) if unknown else tuple(steps)

    def follows(self, sentence: str, place: tuple[Step, ...]) -> bool:
        """Whether the error is only there because something was left out before.

        The keys of a mapping are checked before the values of any: where a value was left out, a
        key that is unknown now was known with it, as `unit` beside the `mesh` of a body.
        """
        if _UNKNOWN_KEY.search(sentence) is not None:
            return id(self._at(place[:-1]).content) in self._known
        if _HANDS.search(sentence) is not None:
            return self._step_gone
        missing = _MISSING.search(sentence) is not None
        thinned = any(id(node) in self._thinned for node in self._along(place))
        return (missing and thinned) or any(
            f"'{name}' is unknown" in sentence for name in self._names
        )

    def leave_out(self, place: tuple[Step, ...], unknown: bool = False) -> bool:
        """Remove the smallest part at a place that stands for itself; False where there is none.

        unknown: it is a key that is not known there.
        """
        while (
            place and isinstance(place[-1], int) and not isinstance(self._at(place).content, dict)
        ):
            place = place[:-1]  # a number of a vector is nothing without the others
        if not place:
            return False
        *above, last = place
        parent = self._at(tuple(above))
        gone = self._child(parent, last)
        if gone is None:
            return False
        self._names.update(_names_in(gone))
        self._step_gone |= place[0] == "program"
        self._thinned.update((id(node), node) for node in self._along(tuple(above)))
        if isinstance(parent.content, list):
            assert isinstance(last, int)  # place_of gives a list numbers
            del self._numbers_of(parent.content)[last]
            del parent.content[last]
        elif isinstance(parent.content, dict):
            del parent.content[str(last)]
            if not unknown:
                self._known[id(parent.content)] = parent
        return True

    def renumbered(self, sentence: str, place: tuple[Step, ...]) -> str:
        """The sentence with the numbers that entries have in the file; without known names where
        some are gone.
        """
        if self._names:
            sentence = (
                sentence.partition("; known are")[0] if "is unknown" in sentence else sentence
            )
        for steps in (place, place[:-1]):  # an unknown key stands after its mapping
            if steps and sentence.startswith(_named(steps)):
                return _named(self._in_file(steps)) + sentence[len(_named(steps)) :]
        return sentence

    def _in_file(self, place: tuple[Step, ...]) -> tuple[Step, ...]:
        node = self.root
        steps = list[Step]()
        for step in place:
            if isinstance(step, int) and isinstance(node.content, list):
                steps.append(self._numbers_of(node.content)[step])
            else:
                steps.append(step)
            node = self._at_child(node, step)
        return tuple(steps)

    def _numbers_of(self, entries: list[Node]) -> list[int]:
        return self._numbers.setdefault(id(entries), list(range(len(entries))))

    def _at(self, place: tuple[Step, ...]) -> Node:
        node = self.root
        for step in place:
            node = self._at_child(node, step)
        return node

    def _along(self, place: tuple[Step, ...]) -> list[Node]:
        """The nodes from the root to a place, without those that everything is a part of: the root
        (unless it is the place) and its lists.
        """
        nodes = [self.root]
        for step in place:
            child = self._child(nodes[-1], step)
            nodes += [child] if child is not None else []
        first = 2 if len(nodes) > 1 and isinstance(nodes[1].content, list) else 1
        return nodes[first:] if place else nodes

    def _at_child(self, node: Node, step: Step) -> Node:
        child = self._child(node, step)
        assert child is not None  # place_of goes no farther
        return child

    def _child(self, node: Node, step: Step) -> Node | None:
        if isinstance(node.content, list) and isinstance(step, int) and step < len(node.content):
            return node.content[step]
        if isinstance(node.content, dict) and step in node.content:
            return node.content[str(step)].node
        return None


def _named(place: tuple[Step, ...]) -> str:
    """A place as sentences name it."""
    text = ""
    for step in place:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def _names_in(node: Node) -> Iterator[str]:
    if isinstance(node.content, list):
        for entry in node.content:
            yield from _names_in(entry)
    elif isinstance(node.content, dict):
        for key, value in node.content.items():
            if key == "name" and isinstance(value.node.content, Scalar):
                yield value.node.content.text
            yield from _names_in(value.node)
