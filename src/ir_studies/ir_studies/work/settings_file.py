"""Settings files of studies: YAML with known keys and values in their ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from ir_studies.errors import SettingsError
from ir_values.errors import DescriptionFileError, unknown_name
from ir_values.yaml_tree import YamlLimits, plain_values

MOST_CHARACTERS = 1_000_000  # of a settings file
Bounds: TypeAlias = "tuple[str, float, float]"
"""A key, its least and its largest value."""
Placed = Callable[[str], str]
"""From the name of a cell or a plant as the settings have it to what reads it: a bundled name, or a
path.
"""


def read_text(path: str | Path) -> str:
    """The text of a settings file. SettingsError where it can't be read."""
    file = Path(path)
    try:
        if file.exists() and not file.is_file():
            raise SettingsError(f"{path} is no file with settings")
        if file.stat().st_size > MOST_CHARACTERS:
            raise SettingsError(
                f"{path} is larger than {MOST_CHARACTERS} bytes: it is no settings file"
            )
        return file.read_text(encoding="utf-8")
    except OSError as error:
        raise SettingsError(f"{path} can't be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise SettingsError(f"{path} is no YAML: {error}") from error


def beside(path: str | Path) -> Placed:
    """Cell files by their place beside a settings file."""
    folder = Path(path).parent
    return lambda name: str(folder / name) if name.endswith((".yaml", ".yml")) else name


def settings_values(content: str, format_name: str, known: Collection[str]) -> dict[str, Any]:
    """Keys and values of a text, without its format; lists as tuples. SettingsError for unknown
    keys.
    """
    read = _mapping(content)
    if read is None or read.get("format") != format_name:
        raise SettingsError(f"expected keys and values with format: {format_name}")
    values: dict[str, Any] = {}
    for key, value in read.items():
        if key == "format":
            continue
        if key not in known:
            raise SettingsError(unknown_name("key", str(key), known))
        values[key] = tuple(value) if isinstance(value, list) else value
    return values


def kind_of(content: str) -> str:
    """The kind of study that the format of a text names; SettingsError where it names none."""
    found = str((_mapping(content) or {}).get("format", ""))
    if not (found.startswith("ir_") and found.endswith("/1")):
        raise SettingsError(f"format is {found!r:.60}: a study's is like ir_layout/1")
    return found.removeprefix("ir_").removesuffix("/1")


def _mapping(content: str) -> dict[Any, Any] | None:
    """What a text holds; None where it is no mapping."""
    try:
        read = plain_values(content, "", YamlLimits(characters=MOST_CHARACTERS))
    except DescriptionFileError as error:
        place = f"line {error.line}: " if error.line else ""
        raise SettingsError(f"{place}{error.sentence}") from error
    return read if isinstance(read, dict) else None


def checked_number(key: str, value: Any, low: float, high: float, *, whole: bool = False) -> None:
    """SettingsError where a value is no number of the range."""
    kinds = int if whole else int | float
    if isinstance(value, bool) or not isinstance(value, kinds) or not _is_within(value, low, high):
        number = "a whole number" if whole else "a number"
        raise SettingsError(f"{key} is {value!r:.60}: it must be {number} in {low:g} .. {high:g}")


def checked_numbers(settings: object, whole: Sequence[Bounds], real: Sequence[Bounds]) -> None:
    """SettingsError where an attribute is no number of its range, or no whole one."""
    for some, integers in ((whole, True), (real, False)):
        for name, low, high in some:
            checked_number(name, getattr(settings, name), low, high, whole=integers)


def checked_known(key: str, names: Iterable[object], known: Collection[str]) -> None:
    """SettingsError where a name is none of those that are known."""
    for name in names:
        if name not in known:
            raise SettingsError(unknown_name(f"{key}:", name, dict.fromkeys(known)))


def _is_within(value: float, low: float, high: float) -> bool:
    """Whether a number is finite and in [low, high]; an integer may be too large for a float."""
    return (
        low <= value <= high
        if isinstance(value, int)
        else math.isfinite(value) and low <= value <= high
    )
