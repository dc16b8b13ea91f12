"""Motion sample by sample on one grid: positions differentiated, mode, load and meter."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ir_description import Load
from ir_msgs_py.modes import REST_MODES, Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.errors import RecorderError
from ir_recorder.traces.trace import (
    CURRENT,
    EFFORT,
    GAP_FACTOR,
    MODE,
    Trace,
    mean_power,
    resampled,
)
from ir_values.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

# What a robot did, sample by sample on one grid: motion, mode, load and, where there is a meter,
# watts.

UNKNOWN = -1
MOVING = 0.002  # rad/s: less than the slowest planned motion, more than the noise of a held joint


@dataclass(frozen=True, eq=False)
class Samples:
    """M samples of `step` [s]; each value belongs to the whole step.

    time (M,) s: middles of the steps. q, qd, qdd (M, n). mode (M,): place in the names of modes,
    UNKNOWN in transitions and where nobody knows; load (M,): place in `loads`, UNKNOWN as well.
    watts (M,): mean at the mains, NaN where it wasn't measured. motors (M,): whether the drives are
    on. effort (M, n): what the controller says of its motors, Nm at the joints, or A (currents);
    None where it says nothing. readings (K,) s: when a meter read that reads more seldom than at
    every step; None for others.
    """

    step: float
    time: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    mode: IntArray
    load: IntArray
    motors: BoolArray
    watts: FloatArray
    loads: tuple[tuple[Load, ...], ...]
    effort: FloatArray | None = None
    currents: bool = False
    readings: FloatArray | None = None

    @property
    def known(self) -> BoolArray:
        """Samples (M,) in which motion, mode and load are known."""
        return np.asarray(
            np.isfinite(self.q).all(axis=1) & (self.mode != UNKNOWN) & (self.load != UNKNOWN)
        )

    @property
    def moving(self) -> BoolArray:
        """Samples (M,) in which any joint moves."""
        return np.asarray((np.abs(np.nan_to_num(self.qd)) > MOVING).any(axis=1))

    def __len__(self) -> int:
        return len(self.time)

    def part(self, start: float, end: float) -> Samples:
        """The samples whose middles lie between two times [s]."""
        rows = (self.time >= start) & (self.time < end)
        arrays = {
            field.name: getattr(self, field.name)[rows]
            for field in fields(self)
            if isinstance(getattr(self, field.name), np.ndarray) and field.name != "readings"
        }
        return replace(self, **arrays)

    def metered(self, values: FloatArray) -> FloatArray:
        """Values (M, ...) as `watts` would show them: means between two readings of the meter."""
        if self.readings is None or len(self) == 0:
            return values
        within = self._between_readings
        columns = values.reshape(len(self), -1)
        means = (within @ columns) / np.asarray(within.sum(axis=1))
        return np.asarray(within.T @ means).reshape(values.shape)

    @cached_property
    def _between_readings(self) -> csr_matrix:
        """The share of each sample (columns) that lies between two readings (rows)."""
        from scipy.sparse import csr_matrix

        assert self.readings is not None  # asked before
        edges = self.time[0] + self.step * (np.arange(len(self) + 1) - 0.5)
        inside = self.readings[(self.readings > edges[0]) & (self.readings < edges[-1])]
        cuts = np.unique(np.concatenate([edges, inside]))
        rows = np.searchsorted(inside, cuts[:-1], side="right")
        samples = np.searchsorted(edges[1:-1], cuts[:-1], side="right")
        shape = (len(inside) + 1, len(self))
        return csr_matrix((np.diff(cuts) / self.step, (rows, samples)), shape)


def movements(
    samples: Samples, shortest: float = 0.3, pause: float = 0.2
) -> tuple[tuple[int, int], ...]:
    """Rows (first, behind the last) of stretches in which the robot moves for at least `shortest`
    [s]; a stop of less than `pause` [s] belongs to the movement.
    """
    moving = samples.moving & samples.known
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(int)))
    runs: list[list[int]] = []
    for first, behind in edges.reshape(-1, 2).tolist():
        if runs and (first - runs[-1][1]) * samples.step < pause:
            runs[-1][1] = behind
        else:
            runs.append([first, behind])
    return tuple((a, b) for a, b in runs if (b - a) * samples.step >= shortest)


def one_load(loads: Sequence[Load], count: int) -> tuple[tuple[tuple[Load, ...], ...], IntArray]:
    """What `Samples` takes as loads and load (count,) where the same is held all the time."""
    return (tuple(loads),), np.zeros(count, np.int64)


# Speed and acceleration from positions alone: local polynomials (Savitzky and Golay, 1964), zero
# phase.
#
# On a uniform grid a polynomial of degree 4 is fitted to the neighbours of each sample; its value
# and derivatives in the middle are one convolution each. Half the signal passes at the stated
# bandwidth (Schafer, "What is a Savitzky-Golay filter?", 2011, eq. 12, inverted for the half
# width).

BANDWIDTH = 16.0  # Hz: above what a loaded arm does, below the rounding of encoders
_DEGREE = 4


def half_width(rate: float) -> int:
    """Neighbours on each side for a cut-off of BANDWIDTH (3 dB) at `rate` [Hz]; at least 3."""
    return max(3, math.ceil(((_DEGREE + 1) * rate / (2.0 * BANDWIDTH) + 4.6) / 3.2))


def kernels(width: int, step: float) -> FloatArray:
    """Weights (3, 2 width + 1) of the neighbours for value, first and second derivative at step
    [s].
    """
    places = np.arange(-width, width + 1) * step
    scale = width * step  # keeps the powers within 1
    powers = np.vander(places / scale, _DEGREE + 1, increasing=True)
    weights = np.linalg.pinv(powers)[:3]
    return np.asarray(weights * np.array([[1.0], [1.0 / scale], [2.0 / scale**2]]))


def differentiated(values: FloatArray, step: float) -> FloatArray:
    """Value, speed and acceleration (3, N, n) of positions (N, n) on a grid of `step` [s].

    At both ends the robot counts as at rest there.
    """
    width = half_width(1.0 / step)
    padded = np.pad(values, ((width, width), (0, 0)), mode="edge")
    found = np.empty((3, *values.shape))
    for order, weights in enumerate(kernels(width, step)):
        for joint in range(values.shape[1]):
            found[order, :, joint] = np.correlate(padded[:, joint], weights, mode="valid")
    return found


# Traces of joints and meter become samples on one grid, with speed and acceleration from positions
# alone.

STEP = 0.01  # s
MOST_SAMPLES = 720_000  # two hours
_SELDOM = 1.5  # steps between two readings of a meter that averages over more than a sample
_SAME_PLACE = 0.001  # rad: a robot that is there again after a gap was at rest in it
_FASTEST = 0.001  # s: finer positions are thinned
_MOTORS = "STAND_ON_MOTORS"
LoadRuns = Iterable[tuple[float, float, tuple[Load, ...]]]
"""Stretches (from, to) [s] with what is held in them."""


def samples_of(
    joints: Trace,
    meter: Trace | None,
    joint_names: Sequence[str],
    modes: Sequence[str],
    loads: LoadRuns,
) -> Samples:
    """Samples over the time of both traces, STEP s apart. `modes`: names in their order; without a
    column of modes the motors count as on. RecorderError where there is nothing to sample.
    """
    positions = joints.joints(joint_names)
    if positions is None:
        raise RecorderError(
            f"{joints.source}: there is no column {joint_names[0]}: positions are needed"
        )
    first = joints.time[0]
    last = joints.time[-1]
    if meter is not None:
        first = max(first, meter.time[0])
        last = min(last, meter.time[-1])
    count = int((last - first) / STEP)
    if not 2 <= count <= MOST_SAMPLES:
        raise RecorderError(
            f"{joints.source}: {max(last - first, 0.0):g} s of positions and power together, "
            f"must be {2 * STEP:g} to {MOST_SAMPLES * STEP:g} s"
        )
    edges = first + STEP * np.arange(count + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    q, qd, qdd = _motion(joints, positions, middles)
    with_modes = meter if meter is not None and MODE in meter.texts else joints
    mode, motors = _modes(with_modes, modes, middles)
    for start, length in joints.gaps():  # what stands without drives is not recorded everywhere
        inside = (middles > start) & (middles < start + length) & motors
        for each in (q, qd, qdd):
            each[inside] = np.nan
    held, load = _loads(loads, middles)
    watts = np.full(count, np.nan)
    readings = None
    energy = None if meter is None else meter.joules()
    if meter is not None and energy is not None:
        watts = mean_power(meter.time, energy, edges)
        for start, length in meter.gaps():
            watts[(edges[1:] > start) & (edges[:-1] < start + length)] = np.nan
        if np.median(np.diff(meter.time)) > _SELDOM * STEP:
            readings = meter.time
    effort, currents = _effort(joints, joint_names, edges)
    return Samples(
        step=STEP,
        time=middles,
        q=q,
        qd=qd,
        qdd=qdd,
        mode=mode,
        load=load,
        motors=motors,
        watts=watts,
        loads=held,
        effort=effort,
        currents=currents,
        readings=readings,
    )


def _effort(
    joints: Trace, names: Sequence[str], edges: FloatArray
) -> tuple[FloatArray | None, bool]:
    """Means (M, n) between edges (M + 1,) of the torques of the motors, else of their currents
    (True); None where neither was recorded. NaN in gaps.
    """
    torque = joints.joints(names, EFFORT)
    current = joints.joints(names, CURRENT) if torque is None else None
    values = torque if current is None else current
    if values is None:
        return None, False
    known = np.where(np.isfinite(values), values, 0.0)
    steps = np.diff(joints.time)[:, None]
    count = np.concatenate(
        [np.zeros((1, len(names))), np.cumsum(0.5 * (known[1:] + known[:-1]) * steps, axis=0)]
    )
    sums = np.column_stack([np.interp(edges, joints.time, each) for each in count.T])
    means = np.diff(sums, axis=0) / np.diff(edges)[:, None]
    for start, length in joints.gaps():
        means[(edges[1:] > start) & (edges[:-1] < start + length)] = np.nan
    lost = ~np.isfinite(values).all(axis=1)
    if lost.any():
        means[np.interp(0.5 * (edges[1:] + edges[:-1]), joints.time, lost) > 0.0] = np.nan
    return means, current is not None


def planned_samples(
    trajectory: JointTrajectory, loads: Sequence[Load], modes: Sequence[str]
) -> Samples:
    """What a trajectory asks for with motors on, without a meter; the last step may reach beyond
    its end.
    """
    count = max(int(np.ceil((trajectory.duration - trajectory.times[0]) / STEP - 1e-9)), 1)
    step = float((trajectory.duration - trajectory.times[0]) / count)
    middles = trajectory.times[0] + (np.arange(count) + 0.5) * step
    at = trajectory.sample(middles)
    held, load = one_load(loads, count)
    mode = np.full(count, list(modes).index(_MOTORS))
    on = np.ones(count, bool)
    none = np.full(count, np.nan)
    return Samples(step, middles, at.q, at.qd, at.qdd, mode, load, on, none, held)


def standing_sample(
    q: FloatArray, loads: Sequence[Load], modes: Sequence[str], mode: str = _MOTORS
) -> Samples:
    """One second of standing at q (n,) in a mode, without a meter."""
    still = np.zeros((1, len(q)))
    (held, load) = one_load(loads, 1)
    number = np.full(1, list(modes).index(mode))
    on = np.full(1, mode == _MOTORS)
    return Samples(
        1.0, np.full(1, 0.5), q[None], still, still, number, load, on, np.full(1, np.nan), held
    )


def _motion(joints: Trace, positions: FloatArray, middles: FloatArray) -> FloatArray:
    """Position, speed and acceleration (3, M, n) at the middles; NaN in gaps and next to them."""
    step = max(joints.period, _FASTEST)
    grid = np.arange(joints.time[0], joints.time[-1], step)
    if len(grid) > 5 * MOST_SAMPLES:
        raise RecorderError(
            f"{joints.source}: {len(grid)} positions, at most {5 * MOST_SAMPLES} are used"
        )
    found = resampled(joints.time, positions, grid, GAP_FACTOR * joints.period)
    lost = np.asarray(~np.isfinite(found).all(axis=1))
    held = _held(found, lost)
    moved = differentiated(held, step)
    unknown = _wide(lost & ~_at_rest(held, lost), half_width(1.0 / step))
    at = np.stack(
        [np.column_stack([np.interp(middles, grid, c) for c in each.T]) for each in moved]
    )
    at[:, np.interp(middles, grid, unknown.astype(float)) > 0.0] = np.nan
    return np.asarray(at)


def _held(values: FloatArray, lost: BoolArray) -> FloatArray:
    """What is lost replaced by the row before; by the first known one at the start."""
    if lost.all():
        raise RecorderError("no position is known")
    rows = np.maximum.accumulate(np.where(lost, 0, np.arange(len(values))))
    return np.asarray(values[np.where(lost[rows], int(np.argmax(~lost)), rows)])


def _at_rest(held: FloatArray, lost: BoolArray) -> BoolArray:
    """Rows of gaps behind which the robot is where it was: it did not move (hibernation has no
    states).
    """
    still = np.zeros(len(lost), bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(int)))
    for first, behind in edges.reshape(-1, 2).tolist():
        if behind < len(held) and np.abs(held[behind] - held[first]).max() < _SAME_PLACE:
            still[first:behind] = True
    return still


def _wide(rows: BoolArray, width: int) -> BoolArray:
    """These rows and `width` neighbours on each side."""
    sums = np.convolve(rows, np.ones(2 * width + 1))
    return np.asarray(sums[width : width + len(rows)] > 0.5)


def _modes(trace: Trace, modes: Sequence[str], middles: FloatArray) -> tuple[IntArray, BoolArray]:
    """Places of the modes (M,), and whether the motors are on; UNKNOWN between readings that
    differ.
    """
    words = trace.texts.get(MODE)
    if words is None:
        on = np.full(len(middles), list(modes).index(_MOTORS))
        return on, np.ones(len(middles), bool)
    places = {name: k for k, name in enumerate(modes)} | {
        Mode.MOVING.name: list(modes).index(_MOTORS)
    }
    known = {*places, *REST_MODES, *(mode.name for mode in Mode)}
    strange = next(
        (word for word in words if word not in known and not word.startswith("mode ")), ""
    )
    if strange:
        raise RecorderError(
            f"{trace.source}: mode {strange[:40]!r} is unknown, known are {', '.join(modes)}"
        )
    number = np.array([places.get(word, UNKNOWN) for word in words])
    after = np.clip(np.searchsorted(trace.time, middles), 1, len(number) - 1)
    mode = np.where(number[after] == number[after - 1], number[after], UNKNOWN)
    return mode, np.asarray(mode == list(modes).index(_MOTORS))


def _loads(runs: LoadRuns, middles: FloatArray) -> tuple[tuple[tuple[Load, ...], ...], IntArray]:
    """The different loads, and which is held at each of the middles (M,)."""
    held: list[tuple[Load, ...]] = []
    load = np.full(len(middles), UNKNOWN)
    for start, end, loads in runs:
        if loads not in held:
            held.append(loads)
        first = int(np.searchsorted(middles, start, "left"))
        behind = int(np.searchsorted(middles, end, "right"))
        load[first:behind] = held.index(loads)
    return tuple(held), load
