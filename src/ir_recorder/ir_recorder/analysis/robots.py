"""Several robots of one recording: how near they came to each other, and whether they took turns.

The distance is that of their capsules, at the joint states of the one that has more of them, those
of the other in between on a line. Which zones there are follows from the signals: one that two
robots both set and wait for is a zone, and a robot is in it from a movement that waits for the
signal until the one that sets it has ended.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ir_kernels import Chain
from ir_kernels.reference.segments import segment_segment
from ir_msgs_py.plc import Signal
from ir_recorder.analysis.checks import Finding, Tolerances, at_least, at_most, unchecked
from ir_recorder.analysis.loads import held_part
from ir_recorder.analysis.results import Analysis, StepResult
from ir_recorder.analysis.tending import Span
from ir_values.arrays import BoolArray, FloatArray

_ROWS = 2000  # instants that are looked at together
STAMPS = 0.05  # s: readings of two robots that come every 10 ms, and the answers of their nodes


@dataclass(frozen=True)
class RobotDistance:
    """The least distance [m] of two robots, when it was [s], and of which capsules."""

    distance: float
    time: float
    capsules: tuple[str, str]


def nearest(one: Analysis, other: Analysis) -> RobotDistance | None:
    """How near two robots came to each other; None where joint states or a cell are missing, or
    their times do not overlap.
    """
    first = _Arm.of(one)
    second = _Arm.of(other)
    if first is None or second is None:
        return None
    low = max(first.time[0], second.time[0])
    high = min(first.time[-1], second.time[-1])
    times = max(first.time, second.time, key=len)
    times = times[(times >= low) & (times <= high)]
    found = [
        _least_distance(first, second, times[k : k + _ROWS]) for k in range(0, len(times), _ROWS)
    ]
    return min(found, key=lambda each: each.distance, default=None)


@dataclass(frozen=True, eq=False)
class _Arm:
    """time (N,), q (N, n); loads: from when on which part is held."""

    analysis: Analysis
    chain: Chain
    time: FloatArray
    q: FloatArray
    loads: tuple[tuple[float, str], ...]

    @staticmethod
    def of(analysis: Analysis) -> _Arm | None:
        joints = analysis.recording.joints
        cell = analysis.cell
        if joints is None or cell is None or len(joints.time) == 0:
            return None
        if joints.position.shape[1] != cell.robot.n:
            return None
        known = np.isfinite(joints.position).all(axis=1)
        loads = [(-np.inf, "")]
        for result in analysis.steps:
            movement = result.step.movement
            loads.append((result.step.start, held_part(cell, movement.load)))
            if movement.attach or movement.detach:
                loads.append((result.step.end, movement.attach))
        return _Arm(
            analysis,
            Chain(cell.robot, cell.base_pose, cell.tcp),
            joints.time[known],
            joints.position[known],
            tuple(loads),
        )

    def segments(self, times: FloatArray) -> list[tuple[str, float, FloatArray, BoolArray]]:
        """Name and radius of each capsule, (N, 2, 3) its ends, and (N,) whether it is there."""
        cell = self.analysis.cell
        assert cell is not None
        q = np.stack([np.interp(times, self.time, own) for own in self.q.T], axis=1)
        poses = self.chain.link_poses(np.ascontiguousarray(q))
        since = np.array([when for when, _ in self.loads])
        held = np.searchsorted(since, times, side="right") - 1
        found = []
        for part in dict.fromkeys(self.loads[k][1] for k in np.unique(held).tolist()):
            there = np.array([self.loads[k][1] == part for k in held.tolist()])
            for capsule in cell.capsules(part):
                if capsule.link == 0:  # a foot is among the machines of the other robot's cell
                    continue
                frames = poses[:, capsule.link]
                ends = np.stack([capsule.p0, capsule.p1])
                placed = np.einsum("nab,eb->nea", frames[:, :3, :3], ends) + frames[:, None, :3, 3]
                found.append((capsule.name, capsule.radius, placed, there))
        return found


def _least_distance(one: _Arm, other: _Arm, times: FloatArray) -> RobotDistance:
    best = RobotDistance(np.inf, float(times[0]), ("", ""))
    others = other.segments(times)
    for name, radius, ends, there in one.segments(times):
        for its_name, its_radius, its_ends, its_there in others:
            axes = segment_segment(ends[:, 0], ends[:, 1], its_ends[:, 0], its_ends[:, 1]).distance
            distance = np.where(there & its_there, axes - radius - its_radius, np.inf)
            k = int(distance.argmin())
            if distance[k] < best.distance:
                best = RobotDistance(float(distance[k]), float(times[k]), (name, its_name))
    return best


def zone_passes(analyses: Mapping[str, Analysis]) -> dict[str, dict[str, list[Span]]]:
    """By signal of a zone, when each of two robots was in it."""
    found: dict[str, dict[str, list[Span]]] = {}
    for robot, analysis in analyses.items():
        begun: dict[str, float] = {}
        for result in analysis.steps:
            step = result.step
            for name in map(_name, step.movement.wait_for):
                begun.setdefault(name, step.start)
            for name in map(_name, step.movement.set_signals):
                if name in begun:
                    span = Span(begun.pop(name), step.end)
                    found.setdefault(name, {}).setdefault(robot, []).append(span)
    return {name: passes for name, passes in found.items() if len(passes) > 1}


def _name(text: str) -> str:
    return Signal.parse(text).name


def robot_findings(analyses: Mapping[str, Analysis]) -> tuple[Finding, ...]:
    """What holds between the robots of a recording."""
    return (*_distances(analyses, Tolerances()), *_turns(analyses))


def _distances(analyses: Mapping[str, Analysis], bounds: Tolerances) -> Iterator[Finding]:
    for (name, one), (its_name, other) in itertools.combinations(analyses.items(), 2):
        title = f"distance of {name} and {its_name}"
        found = nearest(one, other)
        if found is None:
            yield unchecked(
                title, "joint states or the cell of one are missing, or their times do not overlap"
            )
            continue
        kept = [a.safety_distance for a in (one, other) if np.isfinite(a.safety_distance)]
        margin = max(kept, default=bounds.safety_distance)
        off = sum(_deviation(analysis.steps) for analysis in (one, other))
        why = (
            f"safety distance {margin * 1e3:.0f} mm, less {off * 1e3:.1f} mm that the tools were "
            "off their paths"
        )
        where = f"{found.capsules[0]} - {found.capsules[1]} at {found.time:.2f} s"
        yield at_least(title, found.distance, margin - off - bounds.slack, "m", why, where)


def _deviation(steps: tuple[StepResult, ...]) -> float:
    return float(np.nanmax([0.0, *(result.tool_deviation for result in steps)]))


def _turns(analyses: Mapping[str, Analysis]) -> Iterator[Finding]:
    for signal, passes in zone_passes(analyses).items():
        (one, spans), (other, its_spans) = passes.items()
        together = sum(span.within(its.begin, its.end) for span in spans for its in its_spans)
        why = f"{one} and {other} pass it in turns: {len(spans)} and {len(its_spans)} times"
        yield at_most(f"time of both robots in {signal} at once", together, STAMPS, "s", why)
