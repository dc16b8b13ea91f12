"""Trajectories and programs by their id: a bounded memory, the oldest are forgotten first."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class StoredProgram:
    """A planned program."""

    program_id: str
    movements: tuple[PlannedMovement, ...]
    report: TrajectoryReport


class Store(Generic[T]):
    """Values by id; safe to use from several threads.

    what: the word for sentences ("trajectory"). capacity: how many are kept.
    """

    def __init__(self, what: str, capacity: int, id_of: Callable[[T], str]) -> None:
        self._what, self._capacity, self._id_of = what, capacity, id_of
        self._values: OrderedDict[str, T] = OrderedDict()
        self._lock = Lock()

    def add(self, value: T) -> str:
        """Remember a value; returns its id."""
        key = self._id_of(value)
        with self._lock:
            self._values[key] = value
            self._values.move_to_end(key)
            while len(self._values) > self._capacity:
                self._values.popitem(last=False)
        return key

    def get(self, key: str) -> T:
        """The value. Raises RequestError: unknown or forgotten."""
        with self._lock:
            if key in self._values:
                return self._values[key]
            count = len(self._values)
        raise RequestError(
            StatusCode.INVALID_OBJECT_NAME,
            f"{self._what} {key[:40]!a} is unknown: the last {count} of at most {self._capacity} are kept",
        )

    def __len__(self) -> int:
        return len(self._values)
