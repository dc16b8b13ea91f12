"""What OMPL's process is asked and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, field

from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import PlanningScene

STOP = "stop"
"""Sent after the problem, when the time is over: the answer is what was found so far."""


@dataclass(frozen=True)
class Parameters:
    """planner: name of a class in ompl.geometric; values: what its set... methods are called with,
    by the rest of their names; cell [rad]: cells of KPIECE's grid over the first three joints, 0
    for OMPL's own projection; reverse: it is asked for the movement from the goals to the start.
    """

    planner: str
    values: dict[str, float] = field(default_factory=dict)
    cell: float = 0.0
    reverse: bool = False


@dataclass(frozen=True, eq=False)
class Problem:
    """From start (n,) to any of goals (G, n), farther from everything than threshold (Z,) m;
    `edges`: checks before it is given up; `seconds`: after which the process is ended, whatever it
    does.
    """

    scene: PlanningScene
    threshold: FloatArray
    start: FloatArray
    goals: FloatArray
    parameters: Parameters
    seed: int
    edges: int
    seconds: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """A path (M, n), None where none was found; checks in edges; error: why OMPL could not be
    asked;
    unusable: because it is installed but can't be loaded.
    """

    path: FloatArray | None
    edges: int = 0
    error: str = ""
    unusable: bool = False
