"""Evaluation of trajectories as steps of a planned program."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ir_description import Cell, PowerData, ProgramStep
from ir_description.cell import cell_in
from ir_krl.write import WrittenStatement
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import Evaluation, evaluate_trajectory
from ir_planner.errors import RequestError
from ir_planner.program import doors_along
from ir_planner.scene import Drives, PlanningScene, with_parts

ReadBack = Callable[[Sequence[WrittenStatement]], list[JointTrajectory]]
"""The movements of parts as the controller's model drives them, from rest to rest."""

# Steps of a planned program, each evaluated as it was planned: with its load, its parts where they
# lie, doors as its signals move them, sweeping while they do, and what its station allows.


@dataclass(frozen=True, eq=False)
class StepEvaluator:
    """Evaluates trajectories as the steps that they belong to: with their load, their parts, their
    station.

    scenes: of each step by its id(); margin: S_m [m].
    """

    scenes: Mapping[int, PlanningScene]
    margin: float

    def __call__(self, trajectory: JointTrajectory, step: PlannedMovement) -> Evaluation:
        """What a trajectory makes of a step."""
        return evaluate_trajectory(trajectory, self.scene(step), self.margin, contacts_at(step))

    def scene(self, step: PlannedMovement) -> PlanningScene:
        """In which a step is driven."""
        return self.scenes[id(step)]


def evaluator_of(
    steps: Sequence[PlannedMovement], cell: Cell, power: PowerData, drives: Drives, margin: float
) -> StepEvaluator:
    """The evaluator of these steps, S_m `margin` m."""
    found = zip(steps, scenes_of(steps, cell, power, drives), strict=True)
    return StepEvaluator({id(step): scene for step, scene in found}, margin)


def contacts_at(step: PlannedMovement) -> str:
    """The station or path whose allowed contacts hold in a step, "" for none."""
    at = {
        MovementKind.SERVICE_EXIT: step.from_station,
        MovementKind.SERVICE_ENTRY: step.to_station,
        MovementKind.CARTESIAN: step.to_station,
    }
    return at.get(MovementKind(step.kind), "")


def scenes_of(
    steps: Sequence[PlannedMovement], cell: Cell, power: PowerData, drives: Drives
) -> list[PlanningScene]:
    """The scene of each step: what is held, where the parts lie, how the doors stand or sweep."""
    scenes = []
    places = cell.parts_at_start()
    doors = [dict(before) for before, _ in doors_along(cell, [_signalling(step) for step in steps])]
    for step, moved in zip(steps, doors, strict=True):
        standing = cell_in(with_parts(cell, places), moved)
        for (
            text
        ) in step.states:  # of machines that no signal moves: those that the step was planned with
            machine, _, state = text.partition("=")
            if machine not in moved:
                standing = standing.with_equipment(machine, state=state)
        scenes.append(PlanningScene(standing, cell.loads(places.held), power, drives))
        if step.attach or step.detach:
            places = places.after(
                ProgramStep("STATION", step.to_station, attach=step.attach, detach=step.detach)
            )
    return scenes


def _signalling(step: PlannedMovement) -> ProgramStep:
    """What a step waits for and sets, and how long it dwells."""
    return ProgramStep(
        "POSTURE",
        "home",
        dwell=step.duration if step.is_pause else 0.0,
        wait_for=tuple(_signal(text) for text in step.wait_for),
        set_signals=tuple(_signal(text) for text in step.set_signals),
    )


def _signal(text: str) -> Signal:
    name, _, value = text.partition("=")
    return Signal(name, value != "0")


def points_of(step: PlannedMovement) -> JointTrajectory:
    """The trajectory of a movement. Raises RequestError for one of which only the id is known."""
    if step.trajectory is None:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN, f"{called(step)} has no points: get them by its id"
        )
    return step.trajectory


def called(step: PlannedMovement) -> str:
    """What people call a movement."""
    return f"{step.from_station or 'start'} -> {step.to_station or 'goal'}"
