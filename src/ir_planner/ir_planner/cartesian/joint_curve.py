"""The joint curve along a path: splines of degree five through the configurations of one chain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.chains import JUMP, ConfigurationChain, turned_towards
from ir_planner.cartesian.orientations import RotationRates, about_tool, rates_of
from ir_planner.cartesian.tool_path import PathRefusedError, ToolPath
from ir_planner.checks import FreeSpace
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

# The axes along a path: configurations of one chain at dense samples, joined by a spline of degree
# five.

SPLINE_ERROR = 5e-6  # m by which the spline may leave the path between its samples
_SPLINE_TURN = 1e-5  # rad
_DEGREE = 5
_FEWEST = 12  # intervals of a stroke
_FINER = (1, 2, 4, 8, 16)
_LAST = 4.0  # times as much at the finest: near a singularity the axes bend without end
_SHARP = ", where it bends too sharply"
_WRIST = np.radians(5.0)  # an axis 5 nearer to 0 than this is near the singularity of the wrist


@dataclass(frozen=True, eq=False)
class Angle:
    """The angle about the tool's axis over the arc length, a spline of degree one or three."""

    spline: BSpline

    def __call__(self, s: FloatArray) -> FloatArray:
        """Radians (M,) at s (M,) m."""
        return np.asarray(self.spline(np.clip(s, self.spline.t[0], self.spline.t[-1])))

    @property
    def smooth(self) -> bool:
        """Whether its rate is continuous."""
        return self.spline.k > 1

    @cached_property
    def rates(self) -> RotationRates:
        """How fast it turns the tool."""
        if self.smooth:
            return rates_of(self.spline)
        return RotationRates(float(np.abs(self.spline.derivative(1).c).max()))


@dataclass(frozen=True, eq=False)
class JointCurve:
    """q over the arc length s in [begin, end] m."""

    spline: BSpline
    begin: float
    end: float

    @cached_property
    def _pieces(self) -> tuple[FloatArray, FloatArray]:
        """Where its polynomials begin (K,), and their coefficients (6, K, n), highest power first:
        looked up they are evaluated three times as fast as by basis functions.
        """
        begins = np.unique(self.spline.t)[:-1]
        orders = range(_DEGREE, -1, -1)
        return begins, np.array([self.spline(begins, nu=k) / math.factorial(k) for k in orders])

    @property
    def knots(self) -> FloatArray:
        """Arc lengths (K,) m between which it is one polynomial, both ends among them."""
        return np.unique(self.spline.t)

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """q and its first three derivatives by s, (M, n) each, at s (M,)."""
        begins, coefficients = self._pieces
        k = np.clip(np.searchsorted(begins, s, side="right") - 1, 0, len(begins) - 1)
        h = (s - begins[k])[:, None]
        q, *others = coefficients[:, k]
        first = np.zeros_like(q)
        second = np.zeros_like(q)
        third = np.zeros_like(q)
        for coefficient in others:  # Horner's rule, for the derivatives as well
            third = third * h + second
            second = second * h + first
            first = first * h + q
            q = q * h + coefficient
        return q, first, 2.0 * second, 6.0 * third


def tool_poses(path: ToolPath, angle: Angle | None, s: FloatArray) -> FloatArray:
    """Poses (M, 4, 4) of the tcp at s (M,), turned about the tool's axis."""
    poses = path.poses(s)
    if angle is not None:
        poses[:, :3, :3] = portable.matmul(poses[:, :3, :3], about_tool(angle(s)))
    return poses


def curve_of(
    path: ToolPath,
    chain: ConfigurationChain,
    angle: Angle | None,
    ends: tuple[float, float],
    scene: PlanningScene,
) -> JointCurve:
    """The axes between two arc lengths [m] of a path, near a chain. Raises PathRefusedError."""
    inside = (chain.s > ends[0] + 1e-9) & (chain.s < ends[1] - 1e-9)
    rough = np.concatenate([ends[:1], chain.s[inside], ends[1:]])
    rough = _at_least(rough, _FEWEST)
    worst = np.inf
    place = 0.0
    for finer in _FINER:
        s = _divided(rough, finer)
        q = followed(tool_poses(path, angle, s), s, chain, scene)
        curve = JointCurve(portable.interpolating_spline(s, q, _DEGREE), *ends)
        middle = 0.5 * (s[1:] + s[:-1])
        error = _errors(curve.spline(middle), tool_poses(path, angle, middle), scene)
        worst = float(error.max())
        place = float(middle[int(np.argmax(error))])
        if worst <= (1.0 if finer < _FINER[-1] else _LAST):
            return curve
    why = singularity(curve.spline(place), scene) or _SHARP
    k = int(np.searchsorted(s, place))
    apart = 1e3 * (s[k] - s[k - 1])
    raise PathRefusedError(
        f"the axes can't follow the path at {place:.3f} m{why}: between samples "
        f"{apart:.2g} mm apart they leave it by {worst * SPLINE_ERROR * 1e3:.3g} mm",
        strayed=place,
    )


def followed(
    poses: FloatArray, s: FloatArray, chain: ConfigurationChain, scene: PlanningScene
) -> FloatArray:
    """Configurations (M, n) at poses (M, 4, 4) at s (M,), each the nearest to the chain there.
    Raises PathRefusedError where the path leaves the reach or an axis its range.
    """
    near = np.column_stack([np.interp(s, chain.s, column) for column in chain.q.T])
    found = scene.inverse_kinematics_once.solve(poses)
    every = turned_towards(found.q, near[found.pose_index], scene)
    away = np.abs(every - near[found.pose_index]).max(axis=1)
    order = np.lexsort((away, found.pose_index))
    first = (
        order[np.concatenate([[True], np.diff(found.pose_index[order]) > 0])]
        if len(order)
        else order
    )
    reached = np.zeros(len(s), dtype=bool)
    reached[found.pose_index[first]] = away[first] <= JUMP
    if not reached.all():
        k = int(np.argmin(reached))
        raise PathRefusedError(
            f"the path leaves the reach or an axis limit at {s[k]:.3f} m",
            StatusCode.NO_IK_SOLUTION,
            float(s[k]),
        )
    q = every[first]
    jump = np.abs(np.diff(q, axis=0)).max(axis=1)
    if jump.max() > JUMP:
        k = int(np.argmax(jump))
        j = int(np.argmax(np.abs(q[k + 1] - q[k])))
        name = scene.cell.robot.joint_names[j]
        raise PathRefusedError(
            f"{name} would have to jump by {np.degrees(jump[k]):.0f} deg at {s[k]:.3f} m"
            f"{singularity(q[k], scene)}",
            strayed=float(0.5 * (s[k] + s[k + 1])),
        )
    return q


def singularity(q: FloatArray, scene: PlanningScene) -> str:
    """What to add to a sentence about a configuration (n,) near a singularity, else nothing."""
    jacobian = scene.chain.jacobian(q[None])[0]
    wrist = 4 + scene.cell.robot.base
    if abs(q[wrist]) < _WRIST:
        name = scene.cell.robot.joint_names[wrist]
        return f", near the singularity of the wrist ({name} is {np.degrees(q[wrist]):.1f} deg)"
    least = float(np.linalg.svd(jacobian, compute_uv=False)[-1])
    return ", near a singularity of the arm" if least < _SINGULAR else ""


_SINGULAR = 0.05  # least singular value of the Jacobian in m and rad


def _errors(q: FloatArray, poses: FloatArray, scene: PlanningScene) -> FloatArray:
    """How far configurations (M, n) leave poses (M, 4, 4): 1 is what is allowed."""
    there = scene.chain.tcp_poses(q)
    away = np.linalg.norm(there[:, :3, 3] - poses[:, :3, 3], axis=1)
    turned = np.linalg.norm(there[:, :3, :3] - poses[:, :3, :3], axis=(1, 2)) / np.sqrt(2.0)
    return np.asarray(np.maximum(away / SPLINE_ERROR, turned / _SPLINE_TURN))


def _at_least(s: FloatArray, count: int) -> FloatArray:
    return s if len(s) > count else _divided(s, int(np.ceil(count / (len(s) - 1))))


def _divided(s: FloatArray, parts: int) -> FloatArray:
    """s (M,) with each interval divided into `parts`."""
    share = np.arange(parts) / parts
    return np.append((s[:-1, None] + share * np.diff(s)[:, None]).ravel(), s[-1])


# The angle about the tool's axis along the path, where it is free: from the steps of the search to
# a smooth function.
#
# It is a cubic B-spline whose control points lie within the free angle, so it does too. Gauss-
# Newton steps minimise what the axes move and bend along the path, as shares of their speeds;
# each step must keep the configurations free and joined.

WHOLE = np.pi - 1e-6  # rad: from here on any angle will do
_SPACING = 0.05  # m between control points
_FEWEST_FREE_ANGLE = 4
_MOST = 200
_BENDING = 0.05  # m: what bends more sharply counts more than what moves
_FITS = (1.0, 0.1, 1e-2, 1e-3, 1e-5)  # weights of bending while the search's steps are fitted
_STEPS = 8
_HALVINGS = 3
_FARTHEST = 0.3  # rad of a step
_BETTER = 1e-3  # relative: below, no further step is worth it


class _Problem(NamedTuple):
    """basis (N, C): angles at the chain's samples by control points; free_angle [rad]; fixed: the
    first control point stays.
    """

    path: ToolPath
    chain: ConfigurationChain
    space: FreeSpace
    knots: FloatArray
    basis: FloatArray
    bound: float
    fixed: bool

    def angle(self, control: FloatArray) -> Angle:
        from scipy.interpolate import BSpline

        return Angle(BSpline(self.knots, control, 3))

    def reached(self, control: FloatArray, near: ConfigurationChain) -> ConfigurationChain | None:
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
    path: ToolPath, chain: ConfigurationChain, free_angle: float, space: FreeSpace, fixed: bool
) -> tuple[Angle | None, ConfigurationChain]:
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
    path: ToolPath, chain: ConfigurationChain, free_angle: float, space: FreeSpace, fixed: bool
) -> _Problem:
    from scipy.interpolate import BSpline

    begin = float(chain.s[0])
    end = float(chain.s[-1])
    count = int(np.clip(np.ceil((end - begin) / _SPACING), _FEWEST_FREE_ANGLE, _MOST))
    knots = np.concatenate([[begin] * 3, np.linspace(begin, end, count + 1), [end] * 3])
    basis = BSpline.design_matrix(chain.s, knots, 3).toarray()
    bound = np.inf if free_angle >= WHOLE else free_angle
    return _Problem(path, chain, space, knots, basis, bound, fixed)


def _fitted(problem: _Problem) -> tuple[FloatArray, ConfigurationChain] | None:
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


def _rates(chain: ConfigurationChain, scene: PlanningScene) -> tuple[FloatArray, FloatArray]:
    """How much axes move (N - 1, n) and bend (N - 2, n) along the chain, as shares of their
    speeds.
    """
    h = np.diff(chain.s)[:, None]
    moves = np.diff(chain.q, axis=0) / h / scene.limits.velocity
    bends = _BENDING * np.diff(moves, axis=0) / (0.5 * (h[1:] + h[:-1]))
    return moves * np.sqrt(h), bends * np.sqrt(h[1:])


def _cost(chain: ConfigurationChain, scene: PlanningScene) -> float:
    moves, bends = _rates(chain, scene)
    return float((moves * moves).sum() + (bends * bends).sum())


def _step(problem: _Problem, control: FloatArray, chain: ConfigurationChain) -> FloatArray:
    """The Gauss-Newton step (C,) within the free angle, none farther than _FARTHEST."""
    scene = problem.space.scene
    columns = list(_columns(problem, chain))
    moves, bends = _rates(chain, scene)
    residual = np.concatenate([moves.ravel(), bends.ravel()])
    slopes = np.column_stack(columns)
    low = np.maximum(-problem.bound - control, -_FARTHEST)
    high = np.minimum(problem.bound - control, _FARTHEST)
    if problem.fixed:
        low[0] = 0.0
        high[0] = 0.0
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


def _columns(problem: _Problem, chain: ConfigurationChain) -> Iterator[FloatArray]:
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
