"""Interface types by the names that people type ("ir_msgs/srv/SetCell"), and messages as YAML.

Messages are read as `ros2 service call` reads them and written as `ros2 topic echo` writes them. A
scalar is taken by the type of its field, not by YAML's guess: an id of digits stays text.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
import yaml
from rosidl_parser.definition import (
    AbstractNestedType,
    AbstractString,
    AbstractWString,
    Array,
    BasicType,
    NamespacedType,
)

from ir_values.errors import InvalidValueError, UnknownTypeError

_KINDS = ("msg", "srv", "action")


def interface_type(name: str, kind: str) -> Any:
    """Return the class of a "msg", "srv" or "action"; "ir_msgs/SetCell" is enough where the kind is
    known. Raises UnknownTypeError for no such name.
    """
    parts = name.split("/")
    package = parts[0]
    interface = parts[-1]
    if kind not in _KINDS or len(parts) not in (2, 3) or (len(parts) == 3 and parts[1] != kind):
        raise UnknownTypeError(
            f'"{name[:80]}" is not the name of a {kind}: write package/{kind}/Name'
        )
    try:
        return getattr(import_module(f"{package}.{kind}"), interface)
    except (ModuleNotFoundError, AttributeError, ValueError) as error:
        raise UnknownTypeError(f'no {kind} type "{name[:80]}" is installed here') from error


def type_name(interface: Any) -> str:
    """Name of an interface's class: "ir_msgs/srv/SetCell"."""
    package, kind = interface.__module__.split(".")[:2]
    return f"{package}/{kind}/{interface.__name__}"


def owner_of(part: Any, suffix: str, kind: str) -> Any:
    """Return the service or action type that a Request or Goal instance belongs to. Raises
    UnknownTypeError for another class.
    """
    cls = type(part)
    if not cls.__name__.endswith(f"_{suffix}"):
        raise UnknownTypeError(f"{cls.__name__} is not the {suffix} of a {kind} type")
    package = cls.__module__.split(".")[0]
    return interface_type(f"{package}/{kind}/{cls.__name__.removesuffix(f'_{suffix}')}", kind)


_TRUE = frozenset({"true", "yes", "on", "1"})
_FALSE = frozenset({"false", "no", "off", "0"})


class _Text(yaml.BaseLoader):
    """Text alone, no guesses of its type. A field that stands twice is refused: one would not
    count.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """The fields of a mapping."""
        seen: dict[str, int] = {}
        for key, _ in node.value:
            name = str(key.value)
            line = key.start_mark.line + 1
            if name in seen:
                where = (
                    f"line {seen[name]} and line {line}" if seen[name] != line else f"line {line}"
                )
                raise InvalidValueError(f'field "{name[:60]}" stands twice, in {where}')
            seen[name] = line
        return super().construct_mapping(node, deep)


def message_from_yaml(message_type: Any, text: str) -> Any:
    """Message of this type; missing fields keep their defaults, "" is the default message.

    Raises InvalidValueError naming the field: unknown (lists the known ones), of a wrong kind, out
    of range or there twice.
    """
    try:
        content = yaml.load(text, Loader=_Text)
    except yaml.YAMLError as error:
        raise InvalidValueError(f"the text is not YAML: {' '.join(str(error).split())}") from error
    message = message_type()
    if content not in (None, ""):
        _fill(message, content, "")
    return message


def message_to_plain(message: Any, max_elements: int | None = None) -> dict[str, Any]:
    """Message as nested dicts and lists; arrays longer than max_elements end in "..."."""
    return {
        name: _plain(getattr(message, name), max_elements)
        for name in message.get_fields_and_field_types()
    }


def message_to_yaml(message: Any, max_elements: int | None = None) -> str:
    """Message as block YAML, in the order of its fields."""
    text: str = yaml.safe_dump(
        message_to_plain(message, max_elements), sort_keys=False, allow_unicode=True, width=10_000
    )
    return text


def _fill(message: Any, content: Any, where: str) -> None:
    names = list(message.get_fields_and_field_types())
    if not isinstance(content, Mapping):
        place = where or "the message"
        raise InvalidValueError(
            f"{place} is {_short(content)}: it must be fields, of {', '.join(names) or 'none'}"
        )
    types = dict(zip(names, message.SLOT_TYPES, strict=True))
    for name, value in content.items():
        path = f"{where}.{name}" if where else str(name)
        if name not in types:
            raise InvalidValueError(
                f'unknown field "{path[:80]}": known are {", ".join(names) or "none"}'
            )
        setattr(message, name, _value(types[name], value, path))


def _value(kind: Any, value: Any, path: str) -> Any:
    if isinstance(kind, NamespacedType):
        try:
            message = interface_type("/".join(kind.namespaced_name()), "msg")()
        except UnknownTypeError as error:
            raise InvalidValueError(f"{path}: {error}") from error
        _fill(message, value if value != "" else {}, path)
        return message
    if isinstance(kind, AbstractNestedType):
        if not isinstance(value, list):
            raise InvalidValueError(f"{path} is {_short(value)}: it must be a list")
        if isinstance(kind, Array) and len(value) != kind.size:
            raise InvalidValueError(f"{path} has {len(value)} elements: it must have {kind.size}")
        return [_value(kind.value_type, element, f"{path}[{i}]") for i, element in enumerate(value)]
    if not isinstance(value, str):
        raise InvalidValueError(f"{path} is {_short(value)}: it must be a single value")
    if isinstance(kind, (AbstractString, AbstractWString)):
        if "\0" in value:  # ROS would cut the text there without a word
            raise InvalidValueError(
                f"{path} is {value[:40]!a}: it must not contain the character NUL"
            )
        return value
    return _scalar(kind, value, path)


def _scalar(kind: BasicType, text: str, path: str) -> Any:
    name = kind.typename
    if name == "boolean":
        if text.lower() not in _TRUE | _FALSE:
            raise InvalidValueError(f'{path} is "{text[:40]}": it must be true or false')
        return text.lower() in _TRUE
    try:
        if name in ("float", "double", "long double"):
            return float(text.replace(".inf", "inf").replace(".nan", "nan").replace(".NaN", "nan"))
        number = int(text) if text.lstrip("+-").isdigit() else int(text, 0)
    except ValueError as error:
        raise InvalidValueError(f'{path} is "{text[:40]}": it must be a {name}') from error
    low, high = _integer_range(name)
    if not low <= number <= high:
        raise InvalidValueError(f"{path} is {text[:40]}: it must be in {low} .. {high}")
    return bytes([number]) if name == "octet" else number


def _integer_range(name: str) -> tuple[int, int]:
    if name in ("octet", "char"):
        return 0, 255
    bits = int(name.removeprefix("u").removeprefix("int"))
    return (0, 2**bits - 1) if name.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _plain(value: Any, max_elements: int | None) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        return message_to_plain(value, max_elements)
    if isinstance(value, (list, tuple, array, np.ndarray)):
        elements = list(value if max_elements is None else value[:max_elements])
        plain = [_plain(element, max_elements) for element in elements]
        return plain if len(plain) == len(value) else [*plain, "..."]
    if isinstance(value, bytes):
        return value[0]
    return value.item() if isinstance(value, np.generic) else value


def _short(content: Any) -> str:
    text = repr(content)
    return text if len(text) <= 60 else text[:57] + "..."
