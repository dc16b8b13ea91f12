"""Definitions of message types: read from their text, and from the installed interface packages."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from ir_recorder.errors import ReadError, SchemaError

# Fields of a ROS 2 message definition, read from its text without ROS.
#
# A definition is the .msg text; in a recording the texts of all types it is built from follow,
# separated by a line of 80 "=" and a line "MSG: package/Type" (the `ros2msg` schema of MCAP).

_NUMBERS = (
    "float32",
    "float64",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
)
TEXTS = ("string", "wstring")
PRIMITIVES = frozenset(("bool", "byte", "char", *TEXTS, *_NUMBERS))
MOST_TEXT = 1 << 19  # characters of a definition with all its types; those of ROS 2 have 20,000
MOST_TYPES = 1_000  # of a definition; those of ROS 2 are built from some dozens
MOST_DEPTH = 32  # types inside types; those of ROS 2 reach 6
MOST_FIELDS = 100_000  # of one message without its sequences; those of ROS 2 reach some hundreds
SEPARATOR = "=" * 80
_MOST_DIGITS = 18  # of the length of an array
_KEPT = 32  # definitions that are remembered; about as many topics are read
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
    """Fields of one .msg text; constants and comments are left out, types get their package's
    name. ReadError for an array whose length is no number that anything could have.
    """
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


def definitions_of(name: str, text: str) -> Mapping[str, tuple[Field, ...]]:
    """All types of a concatenated schema: "package/Type" -> fields; `name` is that of the first
    ("pkg/msg/Type").

    A text is read once, however many messages ask for it, in time that is proportional to its
    length. ReadError for one that is longer, or built of more or deeper types, than is read.
    """
    definitions, refusal = _read_once(name, text)
    if refusal:
        raise ReadError(refusal)
    return definitions


@lru_cache(maxsize=_KEPT)
def _read_once(name: str, text: str) -> tuple[Mapping[str, tuple[Field, ...]], str]:
    """The types, and why they are refused, "" where they aren't."""
    try:
        return _read(name, text), ""
    except ReadError as error:
        return {}, str(error)


def _read(name: str, text: str) -> Mapping[str, tuple[Field, ...]]:
    if len(text) > MOST_TEXT:
        raise ReadError(
            f"the definition of {name[:80]} has {len(text):,} characters, at most {MOST_TEXT:,} "
            "are read"
        )
    separator = rf"^{SEPARATOR}\s*$"
    head, *others = re.split(separator, text, maxsplit=MOST_TYPES, flags=re.MULTILINE)
    if len(others) >= MOST_TYPES:
        raise ReadError(f"the definition of {name[:80]} has more than {MOST_TYPES:,} types")
    definitions = {short_name(name): fields_of(head, name.split("/", 1)[0])}
    for section in others:
        title, _, body = section.lstrip("\n").partition("\n")
        own = short_name(title.removeprefix("MSG:").strip())
        definitions[own] = fields_of(body, own.split("/", 1)[0])
    _check_size(short_name(name), definitions, {}, ())
    return definitions


def _check_size(
    name: str,
    definitions: dict[str, tuple[Field, ...]],
    sizes: dict[str, int],
    above: tuple[str, ...],
) -> int:
    """Fields of one message of the type, arrays of fixed length counted out and at least one.

    ReadError for a type that contains itself, is built too deep, or has too many fields: a reader
    that walks it would not come to an end.
    """
    if name in sizes:
        return sizes[name]
    if name in above:
        raise ReadError(f"the definition of {name[:80]} contains itself")
    if len(above) >= MOST_DEPTH:
        raise ReadError(
            f"the definition of {above[0][:80]} is built deeper than {MOST_DEPTH} types"
        )
    total = 1
    for field in definitions.get(name, ()):
        count = 1 if field.count is None or field.count < 0 else field.count
        inner = (
            1 if field.primitive else _check_size(field.type, definitions, sizes, (*above, name))
        )
        values = 1 if field.primitive and field.type not in TEXTS else count
        if count == 0:
            raise ReadError(
                f"the definition of {name[:80]} has an array of no elements: {field.name[:80]}"
            )
        total += inner * values
        if total > MOST_FIELDS:
            raise ReadError(f"the definition of {name[:80]} has more than {MOST_FIELDS} fields")
    sizes[name] = total
    return total


def short_name(name: str) -> str:
    """Shorten "pkg/msg/Type" to "pkg/Type"."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"


def _count(array: str | None) -> int | None:
    if array is None:
        return None
    inside = array[1:-1]
    if not (inside.isascii() and inside.isdigit()):
        return -1
    if len(inside) > _MOST_DIGITS:
        raise ReadError(f"a definition has an array whose length has {len(inside):,} digits")
    return int(inside)


# Definitions of message types as a recording carries them, from the installed interface packages.
#
# MCAP's `ros2msg` encoding: the text of the type, then the texts of all types it is built from,
# read from `share/<package>/msg/*.msg`; the type's hash (RIHS01, REP-2016) from the .json beside
# it. Types that rosidl derives from actions and services have no such text, and readers refuse
# their names: they aren't recorded.

# names of packages and types as ROS 2 has them: no path, no dot, nothing to import but an interface
# package
_PACKAGE = re.compile(r"[a-z][a-z0-9_]{0,250}")
_TYPE = re.compile(r"[A-Z][A-Za-z0-9_]{0,250}")


@dataclass(frozen=True)
class MessageSchema:
    """A type's name ("sensor_msgs/msg/JointState"), concatenated text, and hash ("" where none is
    installed).
    """

    name: str
    text: str
    type_hash: str


class SchemaLibrary:
    """Looks definitions up below the `share` folders of the given prefixes (default: the
    environment's).
    """

    def __init__(self, prefixes: Sequence[Path] | None = None) -> None:
        self._prefixes = tuple(prefixes) if prefixes is not None else installed_prefixes()

    def schema(self, name: str) -> MessageSchema:
        """The schema of `name`; SchemaError when it or a type inside it isn't installed."""
        texts = self._texts(name)
        first, *others = texts.items()
        parts = [first[1].rstrip("\n") + "\n"]
        parts += [f"{SEPARATOR}\nMSG: {title}\n{text.rstrip()}\n" for title, text in others]
        return MessageSchema(name, "".join(parts), self._hash(name))

    def _texts(self, name: str) -> dict[str, str]:
        """Texts of a type and of all it is built from, the type itself first."""
        package, own = _split(name)
        texts = {f"{package}/{own}": self._file(package, f"msg/{own}.msg")}
        open_names = list(texts)
        while open_names:
            current = open_names.pop(0)
            for field in fields_of(texts[current], current.split("/", 1)[0]):
                if not field.primitive and field.type not in texts:
                    inner_package, inner = field.type.split("/")
                    texts[field.type] = self._file(inner_package, f"msg/{inner}.msg")
                    open_names.append(field.type)
        return texts

    def _hash(self, name: str) -> str:
        package, own = _split(name)
        try:
            described = json.loads(self._file(package, f"msg/{own}.json"))
        except (SchemaError, json.JSONDecodeError):
            return ""
        hashes = {
            entry["type_name"]: entry["hash_string"] for entry in described.get("type_hashes", ())
        }
        return str(hashes.get(name, ""))

    def _file(self, package: str, path: str) -> str:
        for prefix in self._prefixes:
            file = prefix / "share" / package / path
            if file.is_file():
                return file.read_text(encoding="utf-8")
        places = ", ".join(str(prefix / "share") for prefix in self._prefixes)
        raise SchemaError(
            f"no definition {package}/{path} below {places}: is the package installed?"
        )


def installed_prefixes() -> tuple[Path, ...]:
    """Prefixes of the installed interface packages: AMENT_PREFIX_PATH first, then the Python
    environment's own.
    """
    named = [
        Path(entry) for entry in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if entry
    ]
    return tuple(dict.fromkeys([*named, Path(sys.prefix)]))


def _split(name: str) -> tuple[str, str]:
    parts = name.split("/")
    if (
        len(parts) != 3
        or parts[1] != "msg"
        or not (_PACKAGE.fullmatch(parts[0]) and _TYPE.fullmatch(parts[2]))
    ):
        raise SchemaError(
            f"{name[:200]!r} is not a message type that recordings take: expected package/msg/Type"
        )
    return parts[0], parts[2]
