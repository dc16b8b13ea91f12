"""Names in the graph: their types, as soon as discovery shows them, or a sentence that helps."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Mapping

from ir_msgs_py import names

from .errors import CommandError
from .suggestions import nearest, unknown_name

DISCOVERY_SECONDS = 10.0
"""Longest wait for a graph to grow; discovery takes tenths of a second, on a busy machine seconds."""
SETTLED_SECONDS = 1.0
"""A graph that has not grown for this long, nor for as long as it took so far, is complete: a name that is
near a known one is a typo then, unless a node of this project has it as soon as it runs."""
POLL_SECONDS = 0.02
_OF_NODES = tuple(
    f"/{name}" for name in vars(names).values() if isinstance(name, str) and re.fullmatch(r"\w+/\w+", name)
)
"""Ends of what this project's nodes offer in any namespace."""


def absolute(name: str) -> str:
    """Return the name with the leading slash that people leave out."""
    return name if name.startswith("/") else "/" + name


def type_of(
    look: Callable[[], Mapping[str, str]], name: str, kind: str, seconds: float = DISCOVERY_SECONDS
) -> str:
    """Type of a name as soon as the graph shows it; `kind`: "service", "topic" or "action"."""
    began = grown = time.monotonic()
    known = dict(look())
    while name not in known:
        now = time.monotonic()
        mistyped = bool(nearest(name, known)) and not name.endswith(_OF_NODES)
        typo = mistyped and _complete(began, grown, now)
        if typo or now - grown > seconds:
            raise CommandError(_missing(name, kind, known))
        time.sleep(POLL_SECONDS)
        found = dict(look())
        if found != known:
            known, grown = found, time.monotonic()
    return known[name]


def settled(look: Callable[[], Mapping[str, str]]) -> dict[str, str]:
    """Names with their types once the graph has not grown for a moment, or changes without end."""
    began = grown = time.monotonic()
    known = dict(look())
    while not _complete(began, grown, now := time.monotonic()) and now - began < DISCOVERY_SECONDS:
        time.sleep(POLL_SECONDS)
        found = dict(look())
        if found != known:
            known, grown = found, time.monotonic()
    return known


def _complete(began: float, grown: float, now: float) -> bool:
    """Whether a graph that was first seen at `began` and grew last at `grown` [s] will show no more."""
    return now - grown > max(SETTLED_SECONDS, grown - began)


def checked_type(typed: str, found: str, name: str, kind: str) -> str:
    """The type that was typed, where it is that of the name; CommandError at once where it is another."""
    short = "/".join(part for k, part in enumerate(found.split("/")) if k != 1)
    if typed and typed not in (found, short):
        raise CommandError(f"{kind} {name} has the type {found}, not {typed[:80]}")
    return found


def _missing(name: str, kind: str, known: Mapping[str, str]) -> str:
    if known:
        return unknown_name(kind, name, known, f"ir list {kind}s")
    domain = os.environ.get("ROS_DOMAIN_ID", "")
    where = f"ROS_DOMAIN_ID is {domain}" if domain else "ROS_DOMAIN_ID is not set, which means 0"
    return f"no {kind} {name}, and no other either: do the nodes run, and in this domain? {where}"
