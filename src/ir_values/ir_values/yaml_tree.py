"""YAML as a tree that knows its lines, and nothing a description has no use for.

Refused: aliases and anchors (they multiply), tags, several documents, keys that are not text,
duplicate keys, and texts beyond the limits. Scalars stay text here; `items` gives them their types.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from ir_values.errors import DescriptionFileError, shown
from ir_values.files import read_regular_file

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True)
class YamlLimits:
    """What a file may cost to read."""

    characters: int = 8_000_000
    nodes: int = 1_500_000
    depth: int = 16


@dataclass(frozen=True, slots=True)
class Scalar:
    """One value as it was written; plain means without quotes."""

    text: str
    plain: bool


@dataclass(frozen=True, slots=True)
class Entry:
    """A key with its line and its node."""

    line: int
    node: Node


Content: TypeAlias = "Scalar | list[Node] | dict[str, Entry]"


@dataclass(frozen=True, slots=True)
class Node:
    """A value of the document and the line (from 1) on which it starts."""

    line: int
    content: Content


def parse_yaml(
    text: str, source: str, error: type[DescriptionFileError], limits: YamlLimits | None = None
) -> Node:
    """Return the only document of `text` as a tree; every refusal is an `error` with path and
    line.
    """
    limits = limits or YamlLimits()
    if len(text) > limits.characters:
        raise error(
            source, 0, f"the text has {len(text)} characters, must be at most {limits.characters}"
        )
    try:
        return _Builder(text, source, error, limits).document()
    except yaml.MarkedYAMLError as broken:
        mark = broken.problem_mark or broken.context_mark
        line = mark.line + 1 if mark is not None else 0
        tab = mark is not None and "\t" in _before(text, mark)
        why = "a tab; indent by spaces" if tab else str(broken.problem or broken.context)
        raise error(source, line, f"this is not YAML: {why}") from broken
    except UnicodeEncodeError as broken:
        line = text.count("\n", 0, broken.start) + 1
        raise error(
            source, line, f"character {shown(text[broken.start])} is not allowed in YAML"
        ) from broken
    except yaml.reader.ReaderError as broken:
        line = text.count("\n", 0, broken.position) + 1 if isinstance(broken.position, int) else 0
        raise error(
            source, line, f"character {shown(broken.character)} is not allowed in YAML"
        ) from broken


def _before(text: str, mark: yaml.Mark) -> str:
    """What stands in the line of a mark up to and with it."""
    return (
        text.splitlines()[mark.line][: mark.column + 1] if mark.line < text.count("\n") + 1 else ""
    )


class _Builder:
    """Builds the tree from the parser's events."""

    def __init__(
        self, text: str, source: str, error: type[DescriptionFileError], limits: YamlLimits
    ) -> None:
        self._events = yaml.parse(text, Loader=_LOADER)
        self._source = source
        self._error = error
        self._limits = limits
        self._nodes = 0

    def document(self) -> Node:
        next(self._events)  # start of stream
        first = next(self._events)
        if isinstance(first, yaml.StreamEndEvent):
            raise self._error(self._source, 1, "the file is empty")
        root = self._node(next(self._events), 0)
        next(self._events)  # end of document
        after = next(self._events)
        if not isinstance(after, yaml.StreamEndEvent):
            raise self._error(
                self._source, _line(after), "a second document starts here; one file holds one"
            )
        return root

    def _node(self, event: yaml.Event, depth: int) -> Node:
        """The node that an event begins, with its line. Tags, anchors and aliases are refused, and
        more values or a deeper nesting than the limits.
        """
        line = _line(event)
        self._nodes += 1
        if self._nodes > self._limits.nodes:
            raise self._error(
                self._source, line, f"the file has more than {self._limits.nodes} values"
            )
        if depth > self._limits.depth:
            raise self._error(
                self._source, line, f"values are nested more than {self._limits.depth} deep"
            )
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise self._error(
                self._source,
                line,
                "anchors and aliases (& and *) are not allowed; write the value out",
            )
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise self._error(self._source, line, f"the tag {shown(tag)} is not allowed")
        if isinstance(event, yaml.ScalarEvent):
            return Node(line, Scalar(event.value, not event.style))
        if isinstance(event, yaml.SequenceStartEvent):
            return Node(line, self._sequence(depth))
        return Node(line, self._mapping(depth))

    def _sequence(self, depth: int) -> list[Node]:
        nodes = []
        event = next(self._events)
        while not isinstance(event, yaml.SequenceEndEvent):
            nodes.append(self._node(event, depth + 1))
            event = next(self._events)
        return nodes

    def _mapping(self, depth: int) -> dict[str, Entry]:
        entries: dict[str, Entry] = {}
        event = next(self._events)
        while not isinstance(event, yaml.MappingEndEvent):
            key = self._node(event, depth + 1)
            if not isinstance(key.content, Scalar):
                raise self._error(self._source, key.line, "a key must be a word")
            name = key.content.text
            if name in entries:
                first = entries[name].line
                raise self._error(
                    self._source,
                    key.line,
                    f"{shown(name)} stands here twice, first in line {first}",
                )
            entries[name] = Entry(key.line, self._node(next(self._events), depth + 1))
            event = next(self._events)
        return entries


def _line(event: yaml.Event) -> int:
    mark = event.start_mark
    return mark.line + 1 if mark is not None else 0


# A tree of YAML as text again, without its comments: reading it gives the same tree, but for its
# lines.

_PLAIN = re.compile(r"[-+.]?[0-9][-+.0-9A-Za-z]*|[A-Za-z][A-Za-z0-9_.\-/]*")


def yaml_text(node: Node) -> str:
    """The tree as the lines of a YAML document."""
    return "\n".join(_lines(node)) + "\n"


def _lines(node: Node) -> Iterator[str]:
    content = node.content
    if isinstance(content, dict) and not _is_small(node):
        for key, entry in content.items():
            if _is_small(entry.node):
                yield f"{key}: {_flow(entry.node)}"
            else:
                yield f"{key}:"
                yield from (f"  {line}" for line in _lines(entry.node))
    elif isinstance(content, list) and not _is_small(node):
        yield from (f"- {_flow(entry)}" for entry in content)
    else:
        yield _flow(node)


def _is_small(node: Node) -> bool:
    """Whether a value stands in one line: a figure, a word, a vector."""
    content = node.content
    if isinstance(content, dict):
        return "value" in content or not content
    return isinstance(content, Scalar) or not any(
        isinstance(each.content, dict) for each in content
    )


def _flow(node: Node) -> str:
    content = node.content
    if isinstance(content, Scalar):
        plain = content.plain and _PLAIN.fullmatch(content.text)
        return content.text if plain else json.dumps(content.text)
    if isinstance(content, list):
        return f"[{', '.join(map(_flow, content))}]"
    return f"{{{', '.join(f'{key}: {_flow(entry.node)}' for key, entry in content.items())}}}"


BYTES_MAX = 100_000
"""Size of a settings file."""

_DIGITS_MAX = 1_000
"""Characters of a number: few enough for a message, more than any float has."""
_DIGITS = re.compile(r"[-+.0-9][0-9a-fA-FxX_.:+\-]*")


def plain_yaml(path: Path) -> Any:
    """What the only document of a file holds. DescriptionFileError with path and line."""
    text = read_regular_file(path, BYTES_MAX).decode("utf-8", "replace")
    return plain_values(text, str(path))


def plain_values(text: str, source: str, limits: YamlLimits | None = None) -> Any:
    """The only document of a text as plain values: mappings, lists, numbers, texts, dates.

    DescriptionFileError with source and line for what `parse_yaml` refuses, and for numbers that
    are too long to be printed.
    """
    for line, length in _long_numbers(parse_yaml(text, source, DescriptionFileError, limits)):
        raise DescriptionFileError(
            source, line, f"a number has {length} characters, must have at most {_DIGITS_MAX}"
        )
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        # ValueError: 2026-99-99 as a date; OverflowError: 1:1:...:1.5, which YAML counts by sixties
        said = " ".join(str(error).split())[:200]
        raise DescriptionFileError(source, 0, f"this is not YAML: {said}") from error


def _long_numbers(node: Node) -> Iterator[tuple[int, int]]:
    """Line and length of numbers that are too long."""
    content = node.content
    if isinstance(content, Scalar):
        if content.plain and len(content.text) > _DIGITS_MAX and _DIGITS.fullmatch(content.text):
            yield node.line, len(content.text)
    elif isinstance(content, list):
        for each in content:
            yield from _long_numbers(each)
    else:
        for key, entry in content.items():
            if len(key) > _DIGITS_MAX and _DIGITS.fullmatch(key):
                yield entry.line, len(key)
            yield from _long_numbers(entry.node)
