"""Pairs of configurations with a free straight movement between them, with and without load."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.checks import movement_energy
from ir_planner.request import Context, Work
from ir_planner.scene import PlanningScene
from ir_planner.timing import baseline
from ir_values.arrays import FloatArray

CELL = "open"
AROUND = 0.03  # m that the straight movement keeps
S_M = 0.02  # m
REACH = (0.3, 2.0)  # rad: largest joint of a movement
# m: height of the tool's end over its start from which on a movement lifts or lowers
LEVEL_M = 0.15
DRAWN = (
    "half with the 155 kg tool and half empty; from a random configuration in a random "
    f"direction of the joint space, the joint that moves most by {REACH[0]:g} to {REACH[1]:g} rad"
)
_SAMPLES = 60
ENERGY_STEP = 4e-3  # s: energies are compared to a percent, not to a joule


@dataclass(frozen=True, eq=False)
class Pair:
    """A straight movement q0 -> q1 (n,) with a load in a scene; rise [m] of the tool."""

    number: int
    scene: PlanningScene
    load: str
    q0: FloatArray
    q1: FloatArray

    @property
    def rise(self) -> float:
        """How much higher [m] the tool ends."""
        z = self.scene.chain.tcp_poses(np.stack([self.q0, self.q1]))[:, 2, 3]
        return float(z[1] - z[0])

    def straight_is_free(self) -> bool:
        """Whether the straight movement moves and keeps AROUND, as the drawn ones do."""
        delta = self.q1 - self.q0
        t = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
        moves = float(np.abs(delta).max()) > 1e-3
        return moves and bool(self.scene.collision.is_free(self.q0 + t * delta, AROUND).all())

    @property
    def direction(self) -> str:
        """Whether it lifts."""
        rise = self.rise
        return "up" if rise > LEVEL_M else "down" if rise < -LEVEL_M else "level"

    def context(self, options: PlanOptions) -> Context:
        """A request of its own."""
        return Context.of(self.scene, options, Work(100_000, np.inf, time.monotonic))

    def common(self, duration: float = 0.0, objective: str = "time") -> JointTrajectory | None:
        """The common S-curve PTP: of `duration` [s], else slowed down as is best for the objective;
        None where no torque carries the load.
        """
        options = PlanOptions(objective=objective, duration=duration, safety_distance=S_M)
        movement = baseline(self.q0, self.q1, self.context(options))
        return movement.trajectory if movement is not None else None

    def drive_energy(self, trajectory: JointTrajectory) -> float:
        """E_drive [J]."""
        found = movement_energy(trajectory, self.scene, ENERGY_STEP)
        return found.total - found.base


def pairs(planner: Planner, count: int, seed: int) -> Iterator[Pair]:
    """Movements in mixed directions, in turn with the cell's tool and without load, that a common
    PTP can make.
    """
    rng = np.random.default_rng([seed, 14])
    scenes = [planner.scene(), planner.scene(NO_LOAD)]
    robot = scenes[0].cell.robot
    found = 0
    while found < count:
        scene = scenes[found % 2]
        q0 = rng.uniform(robot.position_min, robot.position_max)
        step = rng.normal(size=robot.n)
        q1 = q0 + rng.uniform(*REACH) * step / np.abs(step).max()
        inside = (q1 > robot.position_min).all() and (q1 < robot.position_max).all()
        pair = Pair(found, scene, scene.load_text, q0, q1)
        if inside and pair.straight_is_free() and pair.common() is not None:
            found += 1
            yield pair
