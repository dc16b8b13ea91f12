"""Definitions of message types as a recording carries them, from the installed interface packages.

MCAP's `ros2msg` encoding: the text of the type, then the texts of all types it is built from, read
from `share/<package>/msg/*.msg`; the type's hash (RIHS01, REP-2016) from the .json beside it. Types
that rosidl
derives from actions and services have no such text, and readers refuse their names: they aren't
recorded.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ir_recorder.errors import SchemaError
from ir_recorder.format.definition import SEPARATOR, fields_of

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
