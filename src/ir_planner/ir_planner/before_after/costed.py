"""Today's program costed as a planned one is: the same loads, the same doors, the capacitor's
charge carried from step to step, pauses as the controller spends them by itself.
"""

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_planner.before_after.asked import Asked
from ir_planner.before_after.today import Stretch
from ir_planner.checks import evaluate_trajectory
from ir_planner.program import Charge, Pause, ProgramRequest, Scenes, pause_by_itself, placed_steps
from ir_planner.scene import PlanningScene


def costed_steps(asked: tuple[Asked, ...], request: ProgramRequest) -> tuple[PlannedMovement, ...]:
    """The steps of today's program from the request's start. Raises RequestError for one that
    handles what isn't there.
    """
    cell = request.cell
    times = request.settings.transitions
    steps = tuple(step.step for step in asked)
    placed = placed_steps(cell, steps, cell.parts_at_start(), request.doors)
    scenes = Scenes(cell, request.power, request.settings.drives)
    costing = _Costing(request, Charge(times))
    here = ""
    for step, at in zip(asked, placed, strict=True):
        there = here if step.step.kind == "PAUSE" else step.step.target
        for stretch in step.stretches:
            doors = at.doors_before if stretch.doors is None else stretch.doors
            scene = scenes.of(at.before, doors)
            if stretch.trajectory is None:
                costing.pause(stretch, here, scene)
            else:
                costing.movement(stretch, here, there, scene)
        here = there
    return tuple(costing.steps)


class _Costing:
    """The steps so far, and where the robot stands after them."""

    def __init__(self, request: ProgramRequest, charge: Charge) -> None:
        self.steps: list[PlannedMovement] = []
        self._request = request
        self._charge = charge
        self._q: FloatArray = request.start

    def movement(self, stretch: Stretch, here: str, there: str, scene: PlanningScene) -> None:
        """A movement of the hop from `here` to `there`."""
        assert stretch.trajectory is not None  # asked before
        along = stretch.process is not None
        names = [there] if along else [station.name for station in scene.cell.stations]
        contacts = next((name for name in (there, here) if name in names), "")
        found = evaluate_trajectory(
            stretch.trajectory, scene, self._request.options.safety_distance, contacts
        )
        step = PlannedMovement(
            kind=MovementKind.CARTESIAN if along else MovementKind.REGIONAL,
            from_station=there if along else here,
            to_station=there,
            trajectory_id=stretch.trajectory.trajectory_id,
            trajectory=stretch.trajectory,
            report=found.report,
            duration=stretch.trajectory.duration,
            load=scene.load_text,
        )
        self.steps.append(self._charge.moved(step, found.energy, scene))
        self._q = stretch.q

    def pause(self, stretch: Stretch, here: str, scene: PlanningScene) -> None:
        """A standstill."""
        spent = Pause(here, stretch.seconds, "", self._q, scene)
        step = pause_by_itself(spent, self._request.settings.transitions)
        self.steps.append(self._charge.stood(step, spent))
