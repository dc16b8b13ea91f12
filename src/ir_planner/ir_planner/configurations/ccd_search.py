"""Cyclic coordinate descent among machines: eqs. (2) and (3) with the metric distances of every
step.

From the tool to the base each joint takes the value within its limits that minimises Psi; where
that step brings a pair nearer than its safety distance, the joint is set back (eq. 5) until it is
far enough, or stays where it was. A start that begins in collision moves on until it is out of it.
Where the descent gets slow, Newton's steps finish it. All starts at once, in arrays.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ir_kernels import CcdSettings, ccd, portable
from ir_kernels.reference.ccd import best_value
from ir_planner.request import Work
from ir_planner.scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.settings import check_settings, setting

# The set-back of a joint that ends in collision, eqs. (4) and (5). As printed a joint goes back by
# d'/d of its step: nothing where bodies touch, and farther in where they overlap. Read as a secant
# it is the share of the step that is lost where the distance, taken as linear, falls to S_m. A
# third reading takes the gain of distance in metres as the factor.

SECANT = "secant"
PRINTED = "printed"
GAIN = "gain"
NONE = "none"
_LEAST_DISTANCE = 1e-9  # m: a step from touch on has no share


def increments(before: FloatArray, after: FloatArray) -> FloatArray:
    """Eq. (4): dd_z (Z,) [m], how much each metric distance (Z,) grew in a step."""
    return np.asarray(after - before)


def shares_back(
    before: FloatArray, after: FloatArray, threshold: FloatArray, reading: str, overshoot: float
) -> FloatArray:
    """Eq. (5): which share (P,) of its last step each start's joint is set back, in [-1, 1].

    `before`, `after` (P, Z) m; `threshold` (Z,) m, S_m or what the station allows. Only pairs that
    were free and no longer are count: setting back can't repair what was in collision before the
    step. Of the worst pair: secant: (S_m - d') / (d - d') (1 + overshoot); printed: d' / d, less
    than zero where bodies overlap; gain: |dd_z| in metres. 0 where no pair counts.
    """
    row, z = np.nonzero((after <= threshold) & (before > threshold))
    start = before[row, z]
    end = after[row, z]
    if reading == SECANT:
        lost = -increments(start, end)
        share = np.maximum((threshold[z] - end) / lost * (1.0 + overshoot), overshoot)
    elif reading == PRINTED:
        share = np.maximum(end / np.maximum(start, _LEAST_DISTANCE), -1.0)
    else:
        share = -increments(start, end)
    result = np.full(len(after), -np.inf)
    np.maximum.at(result, row, np.minimum(share, 1.0))
    return np.where(np.isfinite(result), result, 0.0)


@dataclass(frozen=True)
class InteractionSettings:
    """The search of goal configurations by cyclic coordinate descent with metric distances."""

    distribution: str = setting(
        "truncated_normal",
        "Random starts of eq. 1: truncated_normal (mean mid-range, sigma a sixth of the range) "
        "or uniform.",
        choices=("truncated_normal", "uniform"),
    )
    set_back: str = setting(
        "secant",
        "How eq. 5 sets a joint back: secant (until the distance is S_m), printed (by d'/d of the "
        "step), gain (by the distance lost, in m), or none: collisions are sorted out at the pose.",
        choices=("secant", "printed", "gain", "none"),
    )
    overshoot: float = setting(
        0.05, "eps of eq. 5: how much farther than the secant says.", minimum=0.0, maximum=1.0
    )
    repairs: int = setting(
        2, "Times a step is set back before it is taken back.", minimum=1, maximum=50
    )
    sweeps: int = setting(
        6, "Sweeps over the joints before a start is given up.", minimum=1, maximum=1000
    )
    finish_every: int = setting(
        2, "Sweeps between two tries to finish with Newton's steps.", minimum=1, maximum=1000
    )
    newton_steps: int = setting(
        30,
        "Newton's steps of a finish; 0: cyclic coordinate descent alone.",
        minimum=0,
        maximum=1000,
    )
    xi: float = setting(
        1e-8,
        "A start has arrived when Psi is less (eq. 6).",
        unit="m^2",
        minimum=1e-16,
        maximum=1.0,
    )

    def __post_init__(self) -> None:
        check_settings(self)


INTERACTION = InteractionSettings()
"""The default settings."""

ROTATION_LENGTH = 0.5  # m/rad: lambda of eq. (2)
_STALLED = 0.02  # of Psi that a sweep must gain where it was set back
_PATIENCE = 3  # sweeps without that gain


@dataclass(eq=False)
class Descent:
    """q (K, n) of the accepted starts (eq. 6), the rejected by reason, and the sweeps done.

    reached: how many starts arrived at the pose, free there or not.
    tracks: the configurations (M, n) of each start from sweep to sweep. outcome: of each start, why
    it was rejected, "": accepted.
    """

    q: FloatArray
    sweeps: int
    reached: int = 0
    rejected: Counter[str] = field(default_factory=Counter)
    tracks: list[FloatArray] = field(default_factory=list)
    outcome: list[str] = field(default_factory=list)


def descend(
    pose: FloatArray,
    starts: FloatArray,
    scene: PlanningScene,
    threshold: FloatArray,
    settings: InteractionSettings,
    work: Work,
) -> Descent:
    """Bring the tcp to `pose` (4, 4) from `starts` (P, n), every pair above its threshold (Z,) m.

    Work: one for each sweep of each start over its joints.
    """
    return _Descent(pose, scene, threshold, settings).run(starts, work)


class _Descent:
    def __init__(
        self,
        pose: FloatArray,
        scene: PlanningScene,
        threshold: FloatArray,
        settings: InteractionSettings,
    ) -> None:
        self.pose = np.array(pose)
        self.scene = scene
        self.threshold = threshold
        self.settings = settings
        robot = scene.cell.robot
        self.low = robot.position_min
        self.high = robot.position_max
        self.axis = robot.joint_axis
        self.rejected: Counter[str] = Counter()
        self.outcome: list[str] = []
        self.reached = 0

    def run(self, starts: FloatArray, work: Work) -> Descent:
        """Sweep from all starts (N, n) at once until each has arrived, is given up, or work and
        sweeps are used. Rows that end are taken out of all arrays together.
        """
        q = starts.copy()
        found = [starts[:0]]
        start = np.arange(len(starts))
        self.outcome = [""] * len(starts)
        tracks = [[one] for one in starts]
        distance = self.scene.collision.distances(q)
        psi = self._psi(q)
        stalled = np.zeros(len(q), dtype=int)
        blocked = np.full(len(q), -1)  # the pair that last set a start back
        sweeps = 0
        while len(q) and sweeps < self.settings.sweeps and not work.exhausted:
            affordable = np.arange(len(q)) < work.left
            self._reject(start[~affordable], blocked[~affordable], "not converged, set back")
            q = q[affordable]
            distance = distance[affordable]
            psi = psi[affordable]
            start = start[affordable]
            stalled = stalled[affordable]
            blocked = blocked[affordable]
            work.spend(len(q))
            q, distance, blocked = self._sweep(q, distance, blocked)
            sweeps += 1
            for k, reached in zip(start.tolist(), q, strict=True):
                tracks[k].append(reached)
            now = self._psi(q)
            stalled = np.where((now > (1.0 - _STALLED) * psi) & (blocked >= 0), stalled + 1, 0)
            psi = now
            keep = np.ones(len(q), dtype=bool)
            if sweeps % self.settings.finish_every == 0 or sweeps == self.settings.sweeps:
                arrived, free = self._finish(q, start, tracks)
                found.append(free)
                keep &= ~arrived
            given_up = keep & (stalled >= _PATIENCE)
            self._reject(start[given_up], blocked[given_up], "set back for good")
            keep &= ~given_up
            q = q[keep]
            distance = distance[keep]
            psi = psi[keep]
            start = start[keep]
            stalled = stalled[keep]
            blocked = blocked[keep]
        self._reject(start, blocked, "not converged, set back")
        return Descent(
            np.concatenate(found),
            sweeps,
            self.reached,
            self.rejected,
            [np.array(track) for track in tracks],
            self.outcome,
        )

    def _sweep(
        self, q: FloatArray, distance: FloatArray, blocked: IntArray
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """One pass over the joints, tool to base: a joint does not move the links before it."""
        q = q.copy()
        blocked = blocked.copy()
        links = self.scene.chain.link_poses(q)
        tcp = np.array(self.scene.chain.tcp_poses(q))
        for i in reversed(range(q.shape[1])):
            z = portable.matmul(links[:, i + 1, :3, :3], self.axis[i])
            o = links[:, i + 1, :3, 3]
            value = best_value(
                q[:, i], *self._k(z, o, tcp), float(self.low[i]), float(self.high[i])
            )
            before = q[:, i].copy()
            q, distance, pair = self._stepped(q, i, value, distance)
            blocked = np.where(pair >= 0, pair, blocked)
            turn = _rotations(z, q[:, i] - before)
            tcp[:, :3, 3] = o + (portable.matmul(turn, (tcp[:, :3, 3] - o)[:, :, None]))[:, :, 0]
            tcp[:, :3, :3] = portable.matmul(turn, tcp[:, :3, :3])
        return q, distance, blocked

    def _k(
        self, z: FloatArray, o: FloatArray, tcp: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """k1, k2, k3 (P,) of eq. (3), from the moment M = w_p Pt Pc^T + w_o sum ut_j uc_j^T."""
        current = tcp[:, :3, 3] - o
        target = self.pose[:3, 3] - o
        wo = (ROTATION_LENGTH * ROTATION_LENGTH) / 2.0
        M = target[:, :, None] * current[:, None, :] + wo * (
            portable.matmul(self.pose[:3, :3], tcp[:, :3, :3].transpose(0, 2, 1))
        )
        k1 = ((portable.matmul(M, z[:, :, None]))[:, :, 0] * z).sum(axis=1)
        k2 = np.trace(M, axis1=1, axis2=2)
        curl = np.stack(
            [M[:, 2, 1] - M[:, 1, 2], M[:, 0, 2] - M[:, 2, 0], M[:, 1, 0] - M[:, 0, 1]], axis=1
        )
        return k1, k2, (z * curl).sum(axis=1)

    def _stepped(
        self, q: FloatArray, i: int, value: FloatArray, before: FloatArray
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        """Joint i at `value` (P,), or as far as it may; distances (P, Z) there, unless none set it
        back; the pair that did, or -1.
        """
        old = q[:, i].copy()
        q[:, i] = value
        blocked = np.full(len(q), -1)
        if self.settings.set_back == NONE:
            return q, before, blocked
        after = self.scene.collision.distances(q)
        rows = np.flatnonzero(((after <= self.threshold) & (before > self.threshold)).any(axis=1))
        for attempt in range(self.settings.repairs + 1):
            start = before[rows]
            end = after[rows]
            share = shares_back(
                start, end, self.threshold, self.settings.set_back, self.settings.overshoot
            )
            back = ((end <= self.threshold) & (start > self.threshold)).any(axis=1)
            rows = rows[back]
            share = share[back]
            if len(rows) == 0:
                break
            blocked[rows] = np.argmin(end[back] - self.threshold, axis=1)
            step = q[rows, i] - old[rows]
            last = attempt == self.settings.repairs
            moved = old[rows] if last else q[rows, i] - share * step
            q[rows, i] = np.minimum(np.maximum(moved, self.low[i]), self.high[i])
            after[rows] = start[back] if last else self.scene.collision.distances(q[rows])
        return q, after, blocked

    def _finish(
        self, q: FloatArray, start: IntArray, tracks: list[list[FloatArray]]
    ) -> tuple[BoolArray, FloatArray]:
        """Which of `start` (K,) arrive by Newton's steps, and the configurations among them that
        are free (eq. 6).
        """
        settings = CcdSettings(ROTATION_LENGTH, self.settings.xi, 0, self.settings.newton_steps)
        end = ccd(self.scene.chain, self.pose, q, self.low, self.high, settings)
        arrived = np.asarray(end.psi < self.settings.xi)
        reached = end.q[arrived]
        self.reached += len(reached)
        if len(reached) == 0:
            return arrived, reached
        for k, at_pose in zip(start[arrived].tolist(), reached, strict=True):
            tracks[k].append(at_pose)
        near = self.scene.collision.min_distance(reached, self.threshold)
        free = (near.pair < 0) | (near.distance > self.threshold[near.pair])
        self._reject(start[arrived][~free], near.pair[~free], "at the pose")
        return arrived, reached[free]

    def _psi(self, q: FloatArray) -> FloatArray:
        """Eq. (2), m^2."""
        tcp = self.scene.chain.tcp_poses(q)
        step = tcp[:, :3, 3] - self.pose[:3, 3]
        turn = tcp[:, :3, :3] - self.pose[:3, :3]
        wo = (ROTATION_LENGTH * ROTATION_LENGTH) / 2.0
        return np.asarray((step * step).sum(axis=1) + wo * (turn * turn).sum(axis=(1, 2)))

    def _reject(self, starts: IntArray, pairs: IntArray, what: str) -> None:
        """Count starts (K,) out, each by the pair (K,) that was too near; -1: not converged, by no
        pair.
        """
        for k, z in zip(starts.tolist(), pairs.tolist(), strict=True):
            pair = self.scene.collision.pairs[z] if z >= 0 else None
            named = f"{what}: {pair.body_a} too near {pair.body_b}" if pair else "not converged"
            self.outcome[k] = named
            self.rejected[named] += 1


def _rotations(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """Rotation matrices (P, 3, 3) about unit axes (P, 3)."""
    K = np.zeros((len(axis), 3, 3))
    K[:, 0, 1] = -axis[:, 2]
    K[:, 0, 2] = axis[:, 1]
    K[:, 1, 2] = -axis[:, 0]
    K[:, 1, 0] = axis[:, 2]
    K[:, 2, 0] = -axis[:, 1]
    K[:, 2, 1] = axis[:, 0]
    sine = portable.sin(angle)[:, None, None]
    versine = (1.0 - portable.cos(angle))[:, None, None]
    return np.asarray(np.eye(3) + sine * K + versine * (portable.matmul(K, K)))
