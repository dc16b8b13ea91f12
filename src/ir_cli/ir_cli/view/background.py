"""Checks and plans of the viewed cell in a thread; a newer request ends the one under way."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from ir_cli.plan import sentences_of
from ir_cli.planning import CEILING, clock
from ir_cli.view.clearance import StationAccess, station_accesses
from ir_cli.view.playback import PlayedMotion, motion_of
from ir_description import Cell
from ir_kernels.errors import KernelError
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_planner import CancelledError, Goal, Planner, PlannerError
from ir_planner.before_after import before_after_common
from ir_recorder.analysis.production import planned_share
from ir_recorder.report.before_after import (
    assumptions,
    basis_section,
    change_table,
    figure_table,
)
from ir_recorder.report.number_text import kilowatt_hours, seconds
from ir_recorder.report.prices import Costs
from ir_values.errors import IrError

# The latest action of each kind counts: a quick hand drags a machine through a hundred places a
# second, and only the last that waits is looked at.

Action = Callable[[], None]


class Inbox:
    """Actions by key, filled by any thread, emptied by one."""

    def __init__(self) -> None:
        self._waiting: dict[str, Action] = {}
        self._changed = threading.Condition()

    def post(self, key: str, action: Action) -> None:
        """Keep an action; one with the same key that still waits is dropped."""
        with self._changed:
            self._waiting.pop(key, None)
            self._waiting[key] = action
            self._changed.notify()

    def take(self, patience: float) -> list[Action]:
        """All that waits, in the order in which it came; after at most `patience` s none."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(patience)
            actions = list(self._waiting.values())
            self._waiting.clear()
            return actions


QUIET = 0.4
"""Seconds without a change after which a cell is planned; its stations are checked at once."""


@dataclass(frozen=True, eq=False)
class ViewRequest:
    """A cell to check, those stations first, and to plan: `stations`, none: its program, or its
    tasks. plan: False for a recording, whose motion is known; compare: held against PTP at 100 %
    instead.
    """

    number: int
    cell: Cell
    first: frozenset[str] = frozenset()
    stations: tuple[str, ...] = ()
    quiet: float = 0.0
    plan: bool = True
    compare: bool = False


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan as it is played (None: there is none), its report, what is known about it, and why it
    was not found. compared: tables of a comparison, as HTML, in place of a plan.
    """

    motion: PlayedMotion | None
    lines: tuple[str, ...] = ()
    failure: str = ""
    report: TrajectoryReport | None = None
    compared: str = ""


@dataclass(frozen=True, eq=False)
class Listener:
    """What is called, in the thread that empties the inbox, with the number of what was asked.

    checked: the stations so far, and whether these are all; progress: phase, done, total.
    """

    checked: Callable[[int, tuple[StationAccess, ...], bool], None]
    progress: Callable[[int, str, int, int], None]
    planned: Callable[[int, Planned], None]


class PlanWorker:
    """Works on what was asked last, until it is closed."""

    def __init__(self, inbox: Inbox, listener: Listener) -> None:
        self._inbox = inbox
        self._listener = listener
        self._asked: ViewRequest | None = None
        self._latest = 0
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="plan", daemon=True)
        self._thread.start()

    def ask(self, asked: ViewRequest) -> None:
        """Work on this; what was under way ends."""
        with self._changed:
            self._asked = asked
            self._latest = asked.number
            self._changed.notify()

    def cancel(self) -> None:
        """End what is under way, without an answer."""
        with self._changed:
            self._asked = None
            self._latest = 0
            self._changed.notify()

    def close(self, patience: float = 5.0) -> None:
        """End the thread, at its next look at its work."""
        with self._changed:
            self._closed = True
            self._asked = None
            self._latest = 0
            self._changed.notify()
        self._thread.join(patience)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._asked is not None or self._closed)
                if self._closed:
                    return
                asked = self._asked
                self._asked = None
            assert asked is not None
            try:
                self._work(asked)
            except CancelledError:
                continue
            except (KernelError, IrError, PlannerError) as error:
                self._post(
                    "planned",
                    self._listener.planned,
                    asked.number,
                    Planned(None, failure=str(error)),
                )
            except BaseException as error:
                self._inbox.post("fault", partial(_raise, error))
                return

    def _work(self, asked: ViewRequest) -> None:
        if asked.compare:
            answer = self._compared(asked)
            self._stop_if_old(asked)
            self._post("planned", self._listener.planned, asked.number, answer)
            return
        found: list[StationAccess] = []
        for each in station_accesses(asked.cell, asked.first):
            found.append(each)
            self._post("checked", self._listener.checked, asked.number, tuple(found), False)
            self._stop_if_old(asked)
        self._post("checked", self._listener.checked, asked.number, tuple(found), True)
        if not asked.plan:
            return
        with self._changed:
            self._changed.wait_for(lambda: self._latest != asked.number, asked.quiet)
        self._stop_if_old(asked)
        answer = self._plan(asked)
        self._stop_if_old(asked)
        self._post("planned", self._listener.planned, asked.number, answer)

    def _plan(self, asked: ViewRequest) -> Planned:
        cell = asked.cell
        planner = Planner(cell.name, clock=clock, read_cell=lambda text, file: cell)

        def old() -> bool:
            return self._latest != asked.number

        def progress(phase: str, done: int, total: int, cost: float) -> None:
            self._post("progress", self._listener.progress, asked.number, phase, done, total)

        if cell.program or asked.stations:
            options = PlanOptions(planning_time=CEILING)
            plan = planner.plan_program(
                stations=asked.stations,
                options=options,
                progress=progress,
                cancelled=old,
            )
            if not plan.status.ok:
                return Planned(None, failure=plan.status.message)
            others = sentences_of(plan, planner)[2:-1]  # totals are figures; the saving: compared
            lines = (_parts_line(plan.movements), *others)
            return Planned(motion_of(plan.movements, cell), lines, report=plan.report)
        movements = []
        failures = []
        for each in _tasks(planner, progress, old):
            if isinstance(each, str):
                failures.append(each)
            else:
                movements.append(each)
        return Planned(motion_of(movements, cell), (), "; ".join(failures))

    def _compared(self, asked: ViewRequest) -> Planned:
        """Today's program against the planner's, as the page of `ir compare` has it."""
        cell = asked.cell
        planner = Planner(cell.name, clock=clock, read_cell=lambda text, file: cell)

        def progress(phase: str, done: int, total: int, cost: float) -> None:
            self._stop_if_old(asked)
            self._post("progress", self._listener.progress, asked.number, phase, done, total)

        options = PlanOptions(planning_time=CEILING)
        start = cell.posture(cell.cycle_start(asked.stations))
        found = before_after_common(planner, asked.stations, start, 0.0, options, progress)
        costs = Costs()
        figures = figure_table(found, cell, costs) + change_table(found, cell, costs)
        return Planned(None, compared=figures + assumptions(costs) + basis_section(found, cell))

    def _stop_if_old(self, asked: ViewRequest) -> None:
        if self._latest != asked.number:
            raise CancelledError("another cell was asked for")

    def _post(self, key: str, action: Callable[..., None], *values: object) -> None:
        self._inbox.post(key, partial(action, *values))


def _tasks(
    planner: Planner, progress: Callable[[str, int, int, float], None], old: Callable[[], bool]
) -> Iterator[PlannedMovement | str]:
    """The cell's tasks one by one, or why one is not found."""
    tasks = planner.cell.tasks
    for done, task in enumerate(tasks):
        progress("tasks", done, len(tasks), 0.0)
        options = PlanOptions(planning_time=CEILING)
        plan = planner.plan_regional(
            start=task.start, goal=Goal(configuration=task.goal), options=options, cancelled=old
        )
        if plan.trajectory is None:
            yield f"task {task.name}: {plan.status.message}"
            continue
        yield PlannedMovement(
            kind="regional",
            from_station=task.name,
            trajectory_id=plan.trajectory.trajectory_id,
            trajectory=plan.trajectory,
            report=plan.report,
            duration=plan.report.duration,
            load=planner.scene().load_text,
        )


def _raise(error: BaseException) -> None:
    raise error


def _parts_line(steps: Sequence[PlannedMovement]) -> str:
    """Time and energy of the movements and of the pauses, in the units of the page."""
    shares = [planned_share(steps, part) for part in ("movements", "pauses")]
    return "; ".join(
        f"{own.name} {seconds(own.seconds)}, {kilowatt_hours(own.energy)}"
        for own in shares
        if own is not None
    )
