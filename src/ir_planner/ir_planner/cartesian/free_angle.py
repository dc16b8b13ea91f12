"""The angle about the tool's axis along the path, where it is free: from the steps of the search to
a smooth function.

It is a cubic B-spline whose control points lie within the free angle, so it does too. Gauss-Newton
steps minimise what the axes move and bend along the path, as shares of their speeds; each step must
keep the configurations free and joined.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_planner.cartesian.chains import Chain
from ir_planner.cartesian.joint_curve import Angle, followed, tool_poses
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.checks import FreeSpace
from ir_planner.scene import PlanningScene

WHOLE = np.pi - 1e-6  # rad: from here on any angle will do
_SPACING = 0.05  # m between control points
_FEWEST = 4
_MOST = 200
_BENDING = 0.05  # m: what bends more sharply counts more than what moves
_FITS = (1.0, 0.1, 1e-2, 1e-3, 1e-5)  # weights of bending while the search's steps are fitted
_STEPS = 8
_HALVINGS = 3
_FARTHEST = 0.3  # rad of a step
_BETTER = 1e-3  # relative: below, no further step is worth it


@dataclass(frozen=True, eq=False)
class _Problem:
    """basis (N, C): angles at the chain's samples by control points; free_angle [rad]; fixed: the
    first control point stays.
    """

    path: ToolPath
    chain: Chain
    space: FreeSpace
    knots: FloatArray
    basis: FloatArray
    bound: float
    fixed: bool

    def angle(self, control: FloatArray) -> Angle:
        return Angle(BSpline(self.knots, control, 3))

    def reached(self, control: FloatArray, near: Chain) -> Chain | None:
        """The chain with other angles; None where it isn't free or jumps."""
        angle = self.angle(control)
        s = self.chain.s
        try:
            q = followed(tool_poses(self.path, angle, s), s, near, self.space.scene)
        except PathRefusedError:
            return None
        if not self.space.states_free(q).all():
            return None
        return replace(near, q=q, angles=portable.matmul(self.basis, control))


def angle_along(
    path: ToolPath, chain: Chain, free_angle: float, space: FreeSpace, fixed: bool
) -> tuple[Angle | None, Chain]:
    """The angle over the arc length, None: not free, and the chain with it. fixed: it begins as it
    does.
    """
    if free_angle == 0.0:
        return None, chain
    chain = replace(chain, angles=np.unwrap(chain.angles))
    problem = _problem(path, chain, free_angle, space, fixed)
    begun = _fitted(problem)
    if begun is None:
        return Angle(portable.interpolating_spline(chain.s, chain.angles, 1)), chain
    control, smooth = begun
    cost = _cost(smooth, space.scene)
    for _ in range(_STEPS):
        step = _step(problem, control, smooth)
        for _ in range(_HALVINGS):
            trial = problem.reached(control + step, smooth)
            if trial is not None and _cost(trial, space.scene) < cost:
                break
            step = 0.5 * step
            trial = None
        if trial is None:
            break
        before = cost
        cost = _cost(trial, space.scene)
        control = control + step
        smooth = trial
        if cost > before * (1.0 - _BETTER):
            break
    return problem.angle(control), smooth


def _problem(
    path: ToolPath, chain: Chain, free_angle: float, space: FreeSpace, fixed: bool
) -> _Problem:
    begin = float(chain.s[0])
    end = float(chain.s[-1])
    count = int(np.clip(np.ceil((end - begin) / _SPACING), _FEWEST, _MOST))
    knots = np.concatenate([[begin] * 3, np.linspace(begin, end, count + 1), [end] * 3])
    basis = BSpline.design_matrix(chain.s, knots, 3).toarray()
    bound = np.inf if free_angle >= WHOLE else free_angle
    return _Problem(path, chain, space, knots, basis, bound, fixed)


def _fitted(problem: _Problem) -> tuple[FloatArray, Chain] | None:
    """Control points near the search's steps, as smooth as configurations allow."""
    basis = problem.basis
    wanted = problem.chain.angles
    bend = np.diff(np.eye(basis.shape[1]), n=2, axis=0)
    for weight in _FITS:
        normal = portable.matmul(basis.T, basis) + portable.matmul(
            weight * len(wanted) * bend.T, bend
        )
        control = portable.solve(
            normal + 1e-9 * np.eye(len(normal)), portable.matmul(basis.T, wanted)
        )
        control = np.clip(control, -problem.bound, problem.bound)
        if problem.fixed:
            control[0] = wanted[0]
        chain = problem.reached(control, problem.chain)
        if chain is not None:
            return control, chain
    return None


def _rates(chain: Chain, scene: PlanningScene) -> tuple[FloatArray, FloatArray]:
    """How much axes move (N - 1, n) and bend (N - 2, n) along the chain, as shares of their
    speeds.
    """
    h = np.diff(chain.s)[:, None]
    moves = np.diff(chain.q, axis=0) / h / scene.limits.velocity
    bends = _BENDING * np.diff(moves, axis=0) / (0.5 * (h[1:] + h[:-1]))
    return moves * np.sqrt(h), bends * np.sqrt(h[1:])


def _cost(chain: Chain, scene: PlanningScene) -> float:
    moves, bends = _rates(chain, scene)
    return float((moves * moves).sum() + (bends * bends).sum())


def _step(problem: _Problem, control: FloatArray, chain: Chain) -> FloatArray:
    """The Gauss-Newton step (C,) within the free angle, none farther than _FARTHEST."""
    scene = problem.space.scene
    columns = list(_columns(problem, chain))
    moves, bends = _rates(chain, scene)
    residual = np.concatenate([moves.ravel(), bends.ravel()])
    slopes = np.column_stack(columns)
    low = np.maximum(-problem.bound - control, -_FARTHEST)
    high = np.minimum(problem.bound - control, _FARTHEST)
    if problem.fixed:
        low[0] = high[0] = 0.0
    normal = portable.matmul(slopes.T, slopes)
    right = portable.matmul(-slopes.T, residual)
    normal += 1e-9 * np.trace(normal) / len(normal) * np.eye(len(normal))
    step = np.zeros(len(control))
    open_ = np.ones(len(control), dtype=bool)
    for _ in range(4):  # what meets a bound stays there
        rest = right - portable.matmul(normal[:, ~open_], step[~open_])
        step[open_] = portable.solve(normal[np.ix_(open_, open_)], rest[open_])
        beyond = open_ & ((step < low) | (step > high))
        step = np.clip(step, low, high)
        if not beyond.any():
            break
        open_ &= ~beyond
        if not open_.any():
            break
    return step


def _columns(problem: _Problem, chain: Chain) -> Iterator[FloatArray]:
    """Derivatives of what the axes move and bend by each control point."""
    scene = problem.space.scene
    jacobian = scene.chain.jacobian(chain.q)
    axis = scene.chain.tcp_poses(chain.q)[:, :3, 0]
    turning = np.concatenate([np.zeros_like(axis), axis], axis=1)
    damped = portable.matmul(jacobian.transpose(0, 2, 1), jacobian) + 1e-6 * np.eye(
        jacobian.shape[2]
    )
    right = np.einsum("mji,mj->mi", jacobian, turning)
    turned = portable.solve(damped, right[:, :, None])[:, :, 0]
    for column in problem.basis.T:
        moves, bends = _rates(replace(chain, q=column[:, None] * turned), scene)
        yield np.concatenate([moves.ravel(), bends.ravel()])
