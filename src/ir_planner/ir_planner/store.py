"""Trajectories and programs by their id: a memory bounded in number and bytes, the oldest go
first.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Generic, TypeVar

from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError, unfit
from ir_values.argument_types import typed_methods

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class StoredProgram:
    """A planned program."""

    program_id: str
    movements: tuple[PlannedMovement, ...]
    report: TrajectoryReport


@typed_methods(unfit)
class Store(Generic[T]):
    """Values by id; safe to use from several threads.

    what: the word for sentences ("trajectory"). capacity and megabytes: how many and how much is
    kept; the last value always is. bytes_of: the memory that a value takes.
    """

    def __init__(
        self,
        what: str,
        capacity: int,
        megabytes: int,
        id_of: Callable[[T], str],
        bytes_of: Callable[[T], int],
    ) -> None:
        self._what = what
        self._capacity = capacity
        self._megabytes = megabytes
        self._id_of = id_of
        self._bytes_of = bytes_of
        self._values: OrderedDict[str, T] = OrderedDict()
        self._bytes = 0
        self._lock = Lock()

    def add(self, value: T) -> str:
        """Remember a value; returns its id."""
        key = self._id_of(value)
        with self._lock:
            if key in self._values:
                self._bytes -= self._bytes_of(self._values.pop(key))
            self._values[key] = value
            self._bytes += self._bytes_of(value)
            while len(self._values) > 1 and self._is_overfull():
                self._bytes -= self._bytes_of(self._values.popitem(last=False)[1])
        return key

    def _is_overfull(self) -> bool:
        return len(self._values) > self._capacity or self._bytes > self._megabytes * 1_000_000

    def get(self, key: str) -> T:
        """The value. Raises RequestError: unknown or forgotten."""
        with self._lock:
            if key in self._values:
                return self._values[key]
            count = len(self._values)
        raise RequestError(
            StatusCode.INVALID_OBJECT_NAME,
            f"{self._what} {key[:40]!a} is unknown: the last {count} are kept, at most "
            f"{self._capacity} and {self._megabytes} MB",
        )

    def __len__(self) -> int:
        return len(self._values)


def trajectory_store(capacity: int, megabytes: int) -> Store[JointTrajectory]:
    """A memory of trajectories."""
    return Store("trajectory", capacity, megabytes, lambda t: t.trajectory_id, _trajectory_bytes)


def program_store(capacity: int, megabytes: int) -> Store[StoredProgram]:
    """A memory of programs."""
    return Store("program", capacity, megabytes, lambda program: program.program_id, _program_bytes)


def _trajectory_bytes(trajectory: JointTrajectory) -> int:
    """Memory of a trajectory with the polynomials between its points: six coefficients a joint and
    point.
    """
    return (
        (9 * len(trajectory.joint_names) + 1)
        * trajectory.positions.itemsize
        * len(trajectory.times_ns)
    )


def _program_bytes(program: StoredProgram) -> int:
    """Memory of a program's trajectories, and of a report for each step."""
    trajectories = (movement.trajectory for movement in program.movements)
    report = 10_000  # bytes: some hundred numbers
    return sum(report + (0 if t is None else _trajectory_bytes(t)) for t in trajectories)
