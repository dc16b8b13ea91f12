"""Fields of a ROS 2 message definition, read from its text without ROS.

A definition is the .msg text; in a recording the texts of all types it is built from follow, separated by a
line of 80 "=" and a line "MSG: package/Type" (the `ros2msg` schema of MCAP).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_NUMBERS = ("float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
PRIMITIVES = frozenset(("bool", "byte", "char", "string", "wstring", *_NUMBERS))
SEPARATOR = "=" * 80
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z][\w/]*)(?:<=\d+)?(?P<array>\[[^\]]*\])?\s+"
    r"(?P<name>[a-z]\w*)(?P<rest>.*)$"
)


@dataclass(frozen=True)
class Field:
    """One field: base type ("float64", "string", "std_msgs/Header"), and how many of it.

    `count` is None for a single value, a number for a fixed array, -1 for a sequence.
    """

    name: str
    type: str
    count: int | None

    @property
    def primitive(self) -> bool:
        """Whether the type is one of the language's own."""
        return self.type in PRIMITIVES


def fields_of(text: str, package: str) -> tuple[Field, ...]:
    """Fields of one .msg text; constants and comments are left out, types get their package's name."""
    fields = []
    for line in text.splitlines():
        match = _FIELD.match(line.split("#", 1)[0].strip())
        if match is None or match["rest"].lstrip().startswith("="):
            continue
        name = match["type"]
        if name not in PRIMITIVES:
            parts = name.split("/")
            name = f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else f"{package}/{name}"
        fields.append(Field(match["name"], name, _count(match["array"])))
    return tuple(fields)


def definitions_of(name: str, text: str) -> dict[str, tuple[Field, ...]]:
    """All types of a concatenated schema: "package/Type" -> fields; `name` is that of the first
    ("pkg/msg/Type").
    """
    definitions = {}
    head, *others = re.split(rf"^{SEPARATOR}\s*$", text, flags=re.MULTILINE)
    definitions[short_name(name)] = fields_of(head, name.split("/", 1)[0])
    for section in others:
        title, _, body = section.lstrip("\n").partition("\n")
        own = short_name(title.removeprefix("MSG:").strip())
        definitions[own] = fields_of(body, own.split("/", 1)[0])
    return definitions


def short_name(name: str) -> str:
    """Shorten "pkg/msg/Type" to "pkg/Type"."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"


def _count(array: str | None) -> int | None:
    if array is None:
        return None
    inside = array[1:-1]
    return int(inside) if inside.isdigit() else -1
