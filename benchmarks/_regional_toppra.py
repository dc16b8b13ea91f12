"""Times for a path by TOPP-RA (PyPI toppra), with the project's limits of speed, acceleration and
torque.

Torque is a linear constraint on s'' and s'^2: rigid-body torque and rotor inertia exactly, Coulomb
friction with the sign of the path's direction. Viscous friction and the torque envelope depend on
s' itself; both are tangents at the profile of the iteration before, and the step of the envelope
counts for every place that was ever beyond its speed. The profile is sampled afterwards and slowed
down uniformly as far as it still exceeds a limit. TOPP-RA knows no limit of jerk, so these
movements are ones that the drives could not follow.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from _regional_ompl import RESOLUTION, Free, OmplPath
from _regional_tasks import Cost, Task, cost_of
from toppra import SplineInterpolator
from toppra.algorithm import TOPPRA
from toppra.constraint import LinearConstraint
from toppra.constraint.linear_constraint import canlinear_colloc_to_interpolate

from ir_msgs_py.trajectory import MotionSamples
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import FloatArray

GRID = 120  # intervals of a path
ITERATIONS = 5
CHECK_S = 1e-3  # s between samples of the limits
SLACK = 1e-3  # of a limit: what TOPP-RA may exceed between its grid points
SLOWER = np.geomspace(1.0, 3.0, 40)
COARSE_S = 4e-3  # s between samples while energies are compared

logging.getLogger("toppra").setLevel(logging.ERROR)


class _Limits(LinearConstraint):  # type: ignore[misc]
    """All limits along one path; `tangent_at` moves to another profile."""

    def __init__(self, scene: PlanningScene, path: SplineInterpolator, grid: FloatArray) -> None:
        super().__init__()
        self.identical = True
        self._robot = scene.cell.robot
        self._grid = grid
        robot = scene.cell.robot
        dynamics = scene.dynamics
        self._q, self._ps, self._pss = (np.ascontiguousarray(path(grid, k)) for k in (0, 1, 2))
        rest = np.zeros_like(self._q)
        dry = robot.friction_coulomb * np.sign(self._ps)

        def rigid(qd: FloatArray, qdd: FloatArray) -> FloatArray:
            friction = robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
            return np.asarray(dynamics.inverse_dynamics(self._q, qd, qdd) - friction)

        held = rigid(rest, rest)
        self._a = rigid(rest, self._ps) - held
        self._b = rigid(self._ps, self._pss) - held
        self._c = held + dry
        fastest = (robot.velocity_max / np.maximum(np.abs(self._ps), 1e-9)).min(axis=1) ** 2
        self._xbound = np.column_stack([np.zeros(len(grid)), fastest])
        self._fast = np.zeros_like(self._q, dtype=bool)
        self.tangent_at(0.25 * fastest)

    def tangent_at(self, x: FloatArray) -> None:
        """Linearise what depends on s' at s'^2 = x (N+1,)."""
        robot = self._robot
        x = np.maximum(x, 1e-3 * self._xbound[:, 1])
        root = np.sqrt(x)[:, None]
        # |qd| = offset + slope x
        slope = np.abs(self._ps) / (2.0 * root)
        offset = 0.5 * np.abs(self._ps) * root
        sign = np.sign(self._ps)
        b = self._b + robot.friction_viscous * sign * slope
        c = self._c + robot.friction_viscous * sign * offset
        self._fast |= np.abs(self._ps) * root >= 0.999 * robot.envelope_speed[:, 0]
        rows = []  # a u + b x + c <= g, each (N+1, n)
        for side in (1.0, -1.0):
            rows.append((side * self._a, side * b, side * c, robot.envelope_torque[:, 0]))
            speed = robot.envelope_speed
            torque = robot.envelope_torque[:, 1:]
            for k in range(speed.shape[1] - 1):
                fall = (torque[:, k + 1] - torque[:, k]) / (speed[:, k + 1] - speed[:, k])
                here = np.where(self._fast, 1.0, 0.0)
                line = side * c - fall * (offset - speed[:, k])
                rows.append(
                    (
                        here * side * self._a,
                        here * (side * b - fall * slope),
                        here * line,
                        torque[:, k],
                    )
                )
            most = robot.acceleration_max
            rows.append((side * self._ps, side * self._pss, 0.0 * self._ps, most))
        unit = [np.broadcast_to(g, self._ps.shape) for *_, g in rows]
        self._rows = [
            np.hstack([row[k] / g for row, g in zip(rows, unit, strict=True)]) for k in range(3)
        ]

    def compute_constraint_params(
        self, path: SplineInterpolator, gridpoints: FloatArray
    ) -> tuple[FloatArray | None, ...]:
        a, b, c = self._rows
        F = np.eye(a.shape[1])
        g = np.ones(a.shape[1])
        parts = canlinear_colloc_to_interpolate(a, b, c, F, g, None, None, gridpoints, True)
        return (*parts[:5], None, self._xbound)


@dataclass(frozen=True, eq=False)
class _Leg:
    """One path with s'^2 = x (N+1,) at grid (N+1,), s'' constant in between."""

    path: SplineInterpolator
    grid: FloatArray
    x: FloatArray

    @property
    def times(self) -> FloatArray:
        """When each grid point is passed [s], (N+1,)."""
        root = np.sqrt(self.x)
        return np.concatenate([[0.0], np.cumsum(2.0 * np.diff(self.grid) / (root[1:] + root[:-1]))])


class PathTrajectory:
    """Legs one after the other, slowed down by a factor; sampled as the project's trajectories
    are.
    """

    def __init__(self, legs: list[_Leg], factor: float = 1.0) -> None:
        self._legs = legs
        self._factor = factor
        self._starts = np.concatenate([[0.0], np.cumsum([leg.times[-1] for leg in legs])])
        self.times = np.array([0.0, factor * self._starts[-1]])
        self.duration = float(self.times[-1])

    def slowed(self, factor: float) -> PathTrajectory:
        """The same path, every instant later by the factor."""
        return PathTrajectory(self._legs, self._factor * factor)

    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """No polynomials: whoever asks for them samples."""
        return np.zeros((0, self._legs[0].path.dof, 6)), np.zeros(0)

    def sample(self, t: FloatArray) -> MotionSamples:
        """Motion at t (M,) [s]."""
        quick = np.asarray(t) / self._factor
        which = np.clip(
            np.searchsorted(self._starts, quick, side="right") - 1, 0, len(self._legs) - 1
        )
        q, qd, qdd = (np.zeros((len(quick), self._legs[0].path.dof)) for _ in range(3))
        for index, leg in enumerate(self._legs):
            mine = which == index
            if not mine.any():
                continue
            times = leg.times
            local = np.clip(quick[mine] - self._starts[index], 0.0, times[-1])
            k = np.clip(np.searchsorted(times, local, side="right") - 1, 0, len(times) - 2)
            u = 0.5 * np.diff(leg.x)[k] / np.diff(leg.grid)[k]
            tau = local - times[k]
            v = np.sqrt(leg.x[k])
            s = leg.grid[k] + tau * (v + 0.5 * u * tau)
            sd = v + u * tau
            ps = leg.path(s, 1)
            pss = leg.path(s, 2)
            q[mine] = leg.path(s)
            qd[mine] = ps * sd[:, None] / self._factor
            qdd[mine] = (pss * sd[:, None] ** 2 + ps * u[:, None]) / self._factor**2
        return MotionSamples(q, qd, qdd, np.zeros_like(q))


def _excess(trajectory: PathTrajectory, scene: PlanningScene) -> float:
    """Largest used share of speed, acceleration and torque limits."""
    at = trajectory.sample(np.arange(0.0, trajectory.duration, CHECK_S))
    robot = scene.cell.robot
    torque = scene.dynamics.inverse_dynamics(at.q, at.qd, at.qdd) / scene.dynamics.torque_limit(
        at.qd
    )
    shares = (at.qd / robot.velocity_max, at.qdd / robot.acceleration_max, torque)
    return float(max(np.abs(share).max() for share in shares))


def _fastest_leg(points: FloatArray, scene: PlanningScene) -> _Leg | None:
    """TOPP-RA over a spline through the points, iterated until its tangents are where it drives."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    path = SplineInterpolator(length / length[-1], points, "natural")
    grid = 0.5 * (
        1.0 - np.cos(np.linspace(0.0, np.pi, GRID + 1))
    )  # finer at the ends, where s' changes most
    limits = _Limits(scene, path, grid)
    best: tuple[float, _Leg] | None = None
    for _ in range(ITERATIONS):
        instance = TOPPRA([limits], path, gridpoints=grid, solver_wrapper="seidel")
        _, speed, _ = instance.compute_parameterization(0.0, 0.0)
        if speed is None or not np.isfinite(speed).all():
            break
        leg = _Leg(path, grid, speed**2)
        slowed = _allowed(PathTrajectory([leg]), scene)
        if slowed is not None and (best is None or slowed.duration < best[0]):
            best = slowed.duration, leg
        limits.tangent_at(leg.x)
    return best[1] if best else None


def _allowed(trajectory: PathTrajectory, scene: PlanningScene) -> PathTrajectory | None:
    """The trajectory, slowed down uniformly as far as it exceeds a limit; None where that doesn't
    help.
    """
    for _ in range(60):
        excess = _excess(trajectory, scene)
        if excess <= 1.0 + SLACK:
            return trajectory
        trajectory = trajectory.slowed(min(max(1.005, excess**0.5), 1.2))
    return None


def _cheapest(legs: list[_Leg], scene: PlanningScene) -> tuple[PathTrajectory, Cost] | None:
    """The uniform slow-down of least J."""
    fastest = _allowed(PathTrajectory(legs), scene)
    if fastest is None:
        return None
    coarse = [cost_of(fastest.slowed(factor), scene, COARSE_S).J for factor in SLOWER]
    slower = fastest.slowed(float(SLOWER[int(np.argmin(coarse))]))
    return slower, cost_of(slower, scene)


def timed(path: OmplPath, task: Task) -> tuple[PathTrajectory, Cost, str] | None:
    """OMPL's path driven along its B-spline, or with stops at its corners where that hits; and
    which.
    """
    if len(path.corners) > 2 and _spline_free(path.smooth, task):
        leg = _fastest_leg(path.smooth, task.scene)
        slowed = _cheapest([leg], task.scene) if leg else None
        if slowed is not None:
            return (*slowed, "B-spline")
    legs = [_fastest_leg(path.corners[k : k + 2], task.scene) for k in range(len(path.corners) - 1)]
    kept = [leg for leg in legs if leg is not None]
    slowed = _cheapest(kept, task.scene) if len(kept) == len(legs) else None
    return (*slowed, "stops" if len(legs) > 1 else "straight") if slowed is not None else None


def _spline_free(points: FloatArray, task: Task) -> bool:
    """Whether the spline through the points stays free."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    path = SplineInterpolator(length / length[-1], points, "natural")
    count = int(3 * length[-1] / RESOLUTION) + 2
    return Free(task).all(path(np.linspace(0.0, 1.0, count)))
