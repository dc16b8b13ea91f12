"""Names in the graph: their types, as soon as discovery shows them, or a sentence that helps."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Mapping

from ir_msgs_py import names
from ir_msgs_py.ros.network import DOMAIN

from .errors import CommandError
from .only_one import claimed
from .suggestions import nearest, unknown_name

DISCOVERY_SECONDS = 10.0
"""Longest wait for a graph to grow; discovery takes tenths of a second, on a busy machine
seconds.
"""
START_SECONDS = 60.0
"""The same for what this project's nodes offer, while `ir up` starts or runs them on this host."""
SETTLED_SECONDS = 1.0
"""A graph that has not grown for this long, nor for as long as it took so far, is complete: a name
that is near a known one is a typo then, unless a node of this project has it as soon as it runs.
"""
POLL_SECONDS = 0.02
SEEN_SECONDS = 0.2
"""What counts of the time between two looks: more is a process that was held up, and saw
nothing.
"""
_OF_NODES = tuple(
    f"/{name}"
    for name in vars(names).values()
    if isinstance(name, str) and re.fullmatch(r"\w+/\w+", name)
)
"""Ends of what this project's nodes offer in any namespace."""


class _Watch:
    """A graph that is looked at again and again; watched, grown [s]: how long, and when it changed
    last. Time counts in which this process could see that.
    """

    def __init__(self, look: Callable[[], Mapping[str, str]]) -> None:
        self._look = look
        self._looked = time.monotonic()
        self.known = dict(look())
        self.watched = 0.0
        self.grown = 0.0

    def again(self) -> None:
        """Look after a moment."""
        time.sleep(POLL_SECONDS)
        now = time.monotonic()
        self.watched += min(now - self._looked, SEEN_SECONDS)
        self._looked = now
        found = dict(self._look())
        if found != self.known:
            self.known = found
            self.grown = self.watched

    @property
    def still(self) -> float:
        """How long it has not changed [s]."""
        return self.watched - self.grown

    @property
    def complete(self) -> bool:
        """Whether it will show no more."""
        return self.still > max(SETTLED_SECONDS, self.grown)


def absolute(name: str) -> str:
    """Return the name with the leading slash that people leave out."""
    return name if name.startswith("/") else "/" + name


def type_of(
    look: Callable[[], Mapping[str, str]], name: str, kind: str, seconds: float | None = None
) -> str:
    """Type of a name as soon as the graph shows it; `kind`: "service", "topic" or "action".
    seconds: longest wait for a graph that does not grow; None: as long as nodes may take.
    """
    own = name.endswith(_OF_NODES)
    graph = _Watch(look)
    while name not in graph.known:
        typo = not own and graph.complete and bool(nearest(name, graph.known))
        if typo or graph.still > (DISCOVERY_SECONDS if seconds is None else seconds):
            starting = (
                not typo and seconds is None and graph.still <= START_SECONDS and _starting(name)
            )
            if not starting:
                raise CommandError(_missing(name, kind, graph.known))
        graph.again()
    return graph.known[name]


def settled(look: Callable[[], Mapping[str, str]]) -> dict[str, str]:
    """Names with their types once the graph has not grown for a moment, or changes without end."""
    graph = _Watch(look)
    while not graph.complete and graph.watched < DISCOVERY_SECONDS:
        graph.again()
    return graph.known


def _starting(name: str) -> bool:
    """Whether a process of this host has started, and watches, the nodes that have this name."""
    namespace = next((name.removesuffix(end) for end in _OF_NODES if name.endswith(end)), None)
    return namespace is not None and claimed(os.environ.get(DOMAIN, ""), namespace)


def checked_type(typed: str, found: str, name: str, kind: str) -> str:
    """The type that was typed, where it is that of the name; CommandError at once where it is
    another.
    """
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
