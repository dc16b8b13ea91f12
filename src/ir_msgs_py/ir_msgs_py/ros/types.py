"""Interface types by the names that people type: "ir_msgs/srv/SetCell"."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ir_msgs_py.errors import UnknownTypeError

_KINDS = ("msg", "srv", "action")


def interface_type(name: str, kind: str) -> Any:
    """Return the class of a "msg", "srv" or "action"; "ir_msgs/SetCell" is enough where the kind is
    known.
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


def type_name(interface: Any, kind: str) -> str:
    """Name of an interface class: "ir_msgs/srv/SetCell"."""
    return f"{interface.__module__.split('.')[0]}/{kind}/{interface.__name__}"


def owner_of(part: Any, suffix: str, kind: str) -> Any:
    """Return the service or action type that a Request or Goal instance belongs to."""
    cls = type(part)
    if not cls.__name__.endswith(f"_{suffix}"):
        raise UnknownTypeError(f"{cls.__name__} is not the {suffix} of a {kind} type")
    package = cls.__module__.split(".")[0]
    return interface_type(f"{package}/{kind}/{cls.__name__.removesuffix(f'_{suffix}')}", kind)
