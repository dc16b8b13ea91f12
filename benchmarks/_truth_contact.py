"""Contact: what touches a machine stops and says so, what touches nothing doesn't. Judged by Coal.

Trajectories are straight in the joints, from a free configuration to one that collides, or to a
free one. The judge has its own kinematics and Coal's distances, at the recorded positions of the
simulated robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from _coal_shapes import CoalScene
from _results import at_least, at_most
from _truth_section import Asked, Found
from scipy.spatial.transform import Rotation

from ir_description import Body, load_cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import make_simulation
from ir_sim_driver.controller import Simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_values.arrays import FloatArray

TITLE = "contact with machines, floor and parts"
TOUCHING = 100
FREE = 1000
QUICK_TOUCHING = 10
QUICK_FREE = 20
SLOWLY = 5.0  # times the duration
REACTION = 2.0  # ms from the first touch until the motors brake
AGREED = 1e-4  # m between the judge's distances and those of the driver, of shapes that curve
EVERY = 20  # steps between two looks of the judge, where nothing is expected


class Judge:
    """Coal's distances of everything that can touch in `cell` with this load."""

    def __init__(self, simulation: Simulation) -> None:
        cell = simulation.cell
        scene = simulation.cell_watch.scene
        self._robot = cell.robot
        self._base = cell.base_pose
        self._pairs = scene.model.pairs
        bodies = [*cell.bodies(), *simulation.cell_watch.lying]
        self._coal = CoalScene(scene.capsules, bodies)
        self._balls = {body.name: _ball(body) for body in bodies}

    def least(self, q: FloatArray) -> tuple[float, set[str]]:
        """Least distance [m] at q (n,) of the pairs whose bounding balls meet, and its pair; inf:
        none do.
        """
        poses = self._poses(q)
        near = [pair for pair in self._pairs if self._meet(pair[1], pair[2], poses)]
        found = [(self._coal.distance(*pair, poses), {pair[1], pair[2]}) for pair in near]
        return min(found, key=lambda entry: entry[0], default=(np.inf, set()))

    def _meet(self, a: str, b: str, poses: list[FloatArray]) -> bool:
        here, first = self._ball(a, poses)
        there, second = self._ball(b, poses)
        d = here - there
        return float(d @ d) <= (first + second) ** 2

    def _ball(self, name: str, poses: list[FloatArray]) -> tuple[FloatArray, float]:
        if name in self._balls:
            return self._balls[name]
        link, shape, local = self._coal.capsules[name]
        pose = poses[link]
        return pose[:3, :3] @ local[:3, 3] + pose[:3, 3], shape.radius + shape.halfLength

    def distance(self, bodies: set[str], q: FloatArray) -> float:
        """Distance [m] of one pair at q (n,)."""
        poses = self._poses(q)
        return min(
            self._coal.distance(*pair, poses) for pair in self._pairs if set(pair[1:]) == bodies
        )

    def _poses(self, q: FloatArray) -> list[FloatArray]:
        poses = [self._base]
        for origin, axis, angle in zip(
            self._robot.joint_origin, self._robot.joint_axis, q, strict=True
        ):
            turn = np.eye(4)
            turn[:3, :3] = Rotation.from_rotvec(angle * np.asarray(axis)).as_matrix()
            poses.append(poses[-1] @ np.asarray(origin) @ turn)
        return poses


@dataclass
class Tally:
    """What the trajectories of one kind did, counted."""

    driven: int = 0
    refused: int = 0  # before the start, where they were not allowed to collide
    stopped: int = 0
    successful: int = 0
    named: int = 0  # the pair touches by the judge, and nothing did before
    reaction: float = 0.0  # ms, longest
    stood: float = 0.0  # ms, longest
    depth: float = 0.0  # mm
    touched: int = 0  # by the judge


def measured(asked: Asked) -> Found:
    """Trajectories that touch and that don't, in all cells."""
    touching, free = (QUICK_TOUCHING, QUICK_FREE) if asked.quick else (TOUCHING, FREE)
    rng = np.random.default_rng(asked.seeds)
    found = Found()
    total = Tally()
    clear = Tally()
    places = _places(asked.cells)
    for k, (name, load) in enumerate(places):
        simulation = make_simulation(name, load)
        judge = Judge(simulation)
        share = slice(k, None, len(places))
        for number in range(touching)[share]:
            _touch(simulation, judge, rng, 1.0 if number % 2 else SLOWLY, total)
        for _ in range(free)[share]:
            _keep_clear(simulation, judge, rng, clear)
        found.rows.append(
            {"cell": name, "load": load, "touching": total.driven, "free": clear.driven}
        )
    found.claims.extend(
        [
            at_least(
                "touching trajectories: refused before the start", total.refused, "", total.driven
            ),
            at_least("started all the same: stopped with CONTACT", total.stopped, "", total.driven),
            at_most("started all the same: ended SUCCESSFUL", total.successful, "", 0),
            at_least("pair named as Coal finds it", total.named, "", total.driven),
            at_most("motors brake after the first touch, at most", total.reaction, "ms", REACTION),
            at_most("free trajectories: stopped", clear.stopped, "", 0),
            at_most("free trajectories: touch by Coal", clear.touched, "", 0),
            at_least("free trajectories: SUCCESSFUL", clear.successful, "", clear.driven),
        ]
    )
    found.rows.append({"longest stop ms": total.stood, "deepest mm": total.depth})
    return found


def _places(cells: Sequence[str]) -> list[tuple[str, str]]:
    """Cells with a load each; with a part where the cell has one."""
    result = []
    for name in cells:
        cell = load_cell(name)
        tool = [] if cell.tool is None else [cell.tool.name]
        result.append((name, "+".join(tool) or "none"))
        if cell.parts:
            result.append((name, "+".join([*tool, cell.parts[0].name])))
    return result


def _configuration(simulation: Simulation, rng: np.random.Generator, free: bool) -> FloatArray:
    """A random one that is free by 20 mm, or that touches."""
    model = simulation.cell_watch.scene.model
    robot = simulation.robot
    while True:
        q = rng.uniform(robot.position_min, robot.position_max, (64, robot.n))
        q[:, [3, 5]] *= 0.3  # whole turns of the wrist take long
        least = model.min_distance(q).distance
        good = np.flatnonzero(least > 0.02 if free else (least < -0.01) & (least > -0.2))
        if len(good):
            return np.asarray(q[good[0]])


def _goal(
    simulation: Simulation, start: FloatArray, end: FloatArray, slower: float
) -> TrajectoryGoal | None:
    """Straight from rest to rest, as fast as the limits allow, or so many times slower; None where
    the robot has not the torque.
    """
    robot = simulation.robot
    far = np.abs(end - start)
    fastest = (
        float((1.9 * far / robot.velocity_max).max()),
        float(np.sqrt(5.8 * far / robot.acceleration_max).max()),
    )
    T = max(*fastest, 0.1)
    for _ in range(8):
        rest = np.zeros((2, robot.n))
        times = np.array([0.0, T * slower])
        path = JointTrajectory.from_seconds(
            robot.joint_names, times, np.array([start, end]), rest, rest
        )
        goal = TrajectoryGoal(path, allow_collision=True)
        try:
            simulation.vet(goal, 0)
            return goal
        except TrajectoryRefusedError:  # torque: slower
            T *= 1.25
    return None


def _driven(
    simulation: Simulation, goal: TrajectoryGoal
) -> tuple[GoalOutcome, list[FloatArray], int]:
    """The outcome, positions after every step, and the step after which the robot was stopped."""
    simulation.execute(simulation.vet(goal, 0), 0)
    positions: list[FloatArray] = []
    stopped = -1
    while True:
        simulation.step()
        positions.append(simulation.backend.q)
        if simulation.fault and stopped < 0:
            stopped = len(positions) - 1
        outcomes = simulation.take_outcomes()
        if outcomes:
            return outcomes[-1], positions, stopped


def _stand(simulation: Simulation, q: FloatArray) -> None:
    """Put the robot at q, with nothing latched."""
    simulation.backend.reset(q)
    simulation.executor.hold(q)
    simulation.recover()
    simulation.cell_watch.recovered()
    simulation.run(0.05)
    while simulation.control.refusal():
        simulation.run(0.05)


def _touch(
    simulation: Simulation, judge: Judge, rng: np.random.Generator, slower: float, tally: Tally
) -> None:
    goal = None
    while goal is None:
        start = _configuration(simulation, rng, True)
        end = _configuration(simulation, rng, False)
        goal = _goal(simulation, start, end, slower)
    _stand(simulation, start)
    tally.driven += 1
    try:
        simulation.vet(TrajectoryGoal(goal.trajectory), 0)
    except TrajectoryRefusedError:
        tally.refused += 1
    outcome, positions, stopped = _driven(simulation, goal)
    tally.successful += outcome.code is ErrorCode.SUCCESSFUL
    if outcome.code is not ErrorCode.CONTACT or outcome.contact is None:
        return
    tally.stopped += 1
    pair = {outcome.contact.pair.body_a, outcome.contact.pair.body_b}
    first = stopped
    while first > 0 and judge.least(positions[first - 1])[0] < 0.0:
        first -= 1
    tally.named += judge.distance(pair, positions[stopped]) < AGREED
    tally.reaction = max(tally.reaction, (stopped - first + 1) * simulation.settings.dt * 1e3)
    tally.stood = max(tally.stood, outcome.contact.stopped_after * 1e3)
    tally.depth = max(tally.depth, outcome.contact.depth * 1e3)


def _keep_clear(
    simulation: Simulation, judge: Judge, rng: np.random.Generator, tally: Tally
) -> None:
    """A trajectory that the driver lets start: what the judge says of it."""
    while True:
        start, end = (_configuration(simulation, rng, True) for _ in range(2))
        end = start + rng.uniform(0.1, 0.6) * (end - start)
        goal = _goal(simulation, start, end, 1.0)
        if goal is None:
            continue
        try:
            simulation.vet(TrajectoryGoal(goal.trajectory), 0)
            break
        except TrajectoryRefusedError:
            continue
    _stand(simulation, start)
    tally.driven += 1
    outcome, positions, stopped = _driven(simulation, TrajectoryGoal(goal.trajectory))
    tally.successful += outcome.code is ErrorCode.SUCCESSFUL
    tally.stopped += stopped >= 0
    tally.touched += any(judge.least(q)[0] < 0.0 for q in positions[::EVERY])


def _ball(body: Body) -> tuple[FloatArray, float]:
    """Centre (3,) and radius [m] of a ball around a body; a plane has none."""
    if body.kind == "plane":
        return body.pose[:3, 3], np.inf
    low, high = body.bounds()
    return (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0
