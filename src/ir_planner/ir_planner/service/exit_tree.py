"""Exit paths by two trees: one from the interaction configuration, one from configurations
outside.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.settings import check_settings, setting
from ir_planner.request import Work
from ir_planner.search import connect, joint_scale
from ir_planner.service.exit import Exit
from ir_planner.service.exit_search import ExitsFound


@dataclass(frozen=True)
class ExitTree:
    """Bidirectional trees to configurations outside the zone: finds narrow exits, given work."""

    drawn: int = setting(512, "Random configurations drawn outside.", minimum=1, maximum=100_000)
    goals: int = setting(
        8, "How many of those outside, the nearest, the trees aim at.", minimum=1, maximum=1000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def title(self) -> str:
        """The name of its stage in answers."""
        return "tree"

    def find(
        self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work
    ) -> ExitsFound:
        """Grow until the trees meet: one path, or none when the work ended before."""
        rng = np.random.default_rng(seed.spawn(1)[0])
        goals = self._outside(problem, rng)
        path = None
        if len(goals):
            path = connect(
                problem.interaction, goals, problem.inside, int(rng.integers(2**63))
            ).path
        if path is None:
            return ExitsFound([], problem.interaction, "no path")
        return ExitsFound([_until_out(path, problem)], path[-1], f"{len(path)} points")

    def _outside(self, problem: Exit, rng: np.random.Generator) -> FloatArray:
        """Free configurations (G, n) outside: park and machine home where they are, and the nearest
        of those drawn.
        """
        cell = problem.inside.scene.cell
        space = problem.inside
        postures = np.array([cell.park, cell.machine_home])
        drawn = rng.uniform(space.low, space.high, (self.drawn, len(postures[0])))
        drawn = drawn[problem.is_out(drawn)]
        away = np.linalg.norm((drawn - problem.interaction) * joint_scale(space), axis=1)
        nearest = drawn[np.argsort(away, kind="stable")[: self.goals]]
        return np.concatenate([postures[problem.is_out(postures)], nearest])


def _until_out(path: FloatArray, problem: Exit) -> FloatArray:
    """The path up to the first of its points that is outside."""
    last = int(np.argmax(problem.is_out(path[1:]))) + 1
    return path[: last + 1]
