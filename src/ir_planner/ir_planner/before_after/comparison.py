"""Comparison of today's program with the planner's: at its cycle time and at others."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ir_description import ProgramStep
from ir_msgs_py.announcements import MachineState
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import BeforeAfter, Side
from ir_msgs_py.status import StatusCode
from ir_planner.before_after.changes import Costed, changes, costed, side_of
from ir_planner.before_after.today import Today, TodayMotion, nothing_moves
from ir_planner.before_after.today_steps import (
    StepToday,
    asked_program,
    assumed_doors,
    costed_steps,
    doors_at_the_start,
    freed_rests,
)
from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_planner.program import AUTO, ProgramPlan, ProgramRequest, Progress, Spreads, nobody
from ir_values.arrays import FloatArray

TODAY = "today"
SAME = "same cycle time"
FREE = "free"
LINE = "for the line"
PTP = "synchronous S-curve PTP at 100 %"
_NO_DIFFERENCE = 1e-3  # s


def before_after(
    planner: Planner,
    today: Today,
    cycle_time: float = 0.0,
    options: PlanOptions | None = None,
    progress: Progress = nobody,
) -> BeforeAfter:
    """Today's program against the planner's for the same stops and pauses; cycle_time [s]: what the
    line needs, 0: nobody said.

    Raises RequestError where today's program can't be asked for, and where nothing is found.
    """
    chosen = options or PlanOptions()
    asked = asked_program(today, planner.scene(NO_LOAD if chosen.load == NO_LOAD else ""))
    own = Planner(asked.cell, clock=planner.clock, settings=planner.settings)
    doors, stood = doors_at_the_start(today, asked, own.cell)
    own.heard.machines = tuple(
        MachineState(name, states[0], "".join(states[1:])) for name, states in doors
    )
    asking = _Asking(own, (), today.start, chosen, progress)
    before = asking.costed(costed_steps(asked.steps, asking.request))
    waiting = before
    if cycle_time > before.seconds + _NO_DIFFERENCE:
        left = cycle_time - before.seconds
        wait = StepToday(
            ProgramStep("PAUSE", dwell=left, power_mode=AUTO),
            (TodayMotion(None, today.start, left),),
        )
        waiting = asking.costed(costed_steps((*asked.steps, wait), asking.request))
    sides = [asking.planned(SAME, before.seconds, before), asking.planned(FREE, 0.0, before)]
    if _differs(cycle_time, before.seconds):
        sides.append(asking.planned(LINE, cycle_time, waiting))
    freed = freed_rests(planner.cell, asked)
    return asking.answer(
        today.name, today.kind, before, sides, (*today.notes, *asked.notes, *stood, *freed)
    )


def before_after_common(
    planner: Planner,
    stations: Sequence[str],
    start: FloatArray,
    cycle_time: float = 0.0,
    options: PlanOptions | None = None,
    progress: Progress = nobody,
) -> BeforeAfter:
    """PTP at 100 % through stations (the cell's program where there are none), from start (n,),
    against the planner's.

    Raises RequestError where nothing is found, or nothing moves.
    """
    asking = _Asking(planner, tuple(stations), start, options or PlanOptions(), progress)
    free = asking.plan(0.0, savings=True)
    common = free.common
    same = free.compared
    if common is None or same is None:
        reason = free.status.message if not free.status.ok else free.savings.sentence
        raise RequestError(StatusCode.PLANNING_FAILED, reason)
    if all(step.is_pause for step in common.movements):
        raise nothing_moves(f"the program of {planner.cell.name}")
    before = asking.costed(common.movements)
    sides = [
        asking.side(SAME, before.seconds, same, before),
        asking.side(FREE, 0.0, free, before),
    ]
    if _differs(cycle_time, before.seconds):
        line = asking.plan(cycle_time, savings=True)
        longer = cycle_time > before.seconds and line.common is not None
        waiting = (
            asking.costed(line.common.movements) if longer and line.common is not None else before
        )
        sides.append(asking.side(LINE, cycle_time, line, waiting))
    around = f"; {free.savings.around} of its movements had to be routed around machines"
    notes = (
        "the common program stands for today's (point to point at 100 %), which nobody recorded"
        f"{around if free.savings.around else ''}",
        *assumed_doors(planner.cell),
    )
    return asking.answer(PTP, "common program", before, sides, notes)


def _differs(cycle_time: float, today: float) -> bool:
    return cycle_time > 0.0 and abs(cycle_time - today) > _NO_DIFFERENCE


class _Asking:
    """The same request at several cycle times."""

    def __init__(
        self,
        planner: Planner,
        stations: tuple[str, ...],
        start: FloatArray,
        options: PlanOptions,
        progress: Progress,
    ) -> None:
        self._planner = planner
        self._options = options
        self._progress = progress
        settings = replace(planner.settings, transitions=planner.heard.transitions)
        power = planner.scene("").power
        start = np.asarray(start)
        self.request = ProgramRequest(
            planner.cell,
            power,
            stations,
            start,
            options,
            settings=settings,
            doors=planner.heard.doors(planner.cell),
        )
        self._spreads = Spreads(self.request)
        self._found: dict[str, Costed] = {}

    def plan(self, cycle_time: float, savings: bool = False) -> ProgramPlan:
        """The planner's answer."""
        asked = self.request
        return self._planner.plan_program(
            stations=asked.stations,
            cycle_time=cycle_time,
            options=self._options,
            start=asked.start,
            progress=self._progress,
            savings=savings,
        )

    def costed(self, steps: Sequence[PlannedMovement]) -> Costed:
        """Steps with their uncertainty."""
        return costed(steps, self._spreads)

    def planned(self, name: str, cycle_time: float, against: Costed) -> Side:
        """The side of a program that is planned now, or why it can't be asked for: today's motion
        may be faster than the limits allow.
        """
        try:
            plan = self.plan(cycle_time)
        except RequestError as error:
            return Side(name, cycle_time, problem=str(error))
        return self.side(name, cycle_time, plan, against)

    def side(self, name: str, cycle_time: float, plan: ProgramPlan, against: Costed) -> Side:
        """The side of a plan, or why there is none."""
        if not plan.status.ok:
            return Side(name, cycle_time, problem=plan.status.message)
        program = self.costed(plan.movements)
        self._found[name] = program
        return side_of(name, cycle_time, program, self.request, against)

    def answer(
        self, name: str, kind: str, before: Costed, sides: list[Side], notes: Sequence[str]
    ) -> BeforeAfter:
        """All sides and the changes to the first that was found."""
        towards = next((side.name for side in sides if side.found), "")
        if not towards:
            raise RequestError(
                StatusCode.PLANNING_FAILED, "; ".join(dict.fromkeys(s.problem for s in sides))
            )
        made = changes(before, self._found[towards])
        today = side_of(TODAY, 0.0, before, self.request, before)
        notes = (*notes, *_violations(today))
        return BeforeAfter(name, kind, today, tuple(sides), towards, made, notes)


def _violations(side: Side) -> list[str]:
    """Whether today's movements keep what the planner's are certified for."""
    bad = [step for step in side.movements if not step.is_pause and not step.report.certified]
    if not bad:
        return []
    places = ", ".join(f"{step.from_station or 'start'} to {step.to_station}" for step in bad[:4])
    more = "" if len(bad) <= 4 else f" and {len(bad) - 4} more"
    return [f"today's movements are not certified in this cell: {places}{more}"]
