"""Changes from one program to another, movement by movement, with their intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description.robot import drawn_robots
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.savings import HopSaving, Saving, Side, StepChange
from ir_planner.checks import JouleInterval, interval, movement_energy, total_report
from ir_planner.program import ProgramRequest, Spreads
from ir_planner.scene import PlanningScene, scene_with
from ir_values.arrays import FloatArray

# Intervals of peak powers: what the drawn robots take in the instants that take most.

ROBOTS = 40  # drawn: each drives the movements, so that fewer than for energies are affordable
_NEAR = 0.7  # of the peak: movements that take less don't come to it with other parameters


def peak_interval(steps: Sequence[PlannedMovement], request: ProgramRequest) -> JouleInterval:
    """The 90 % interval [W] of the largest power of some steps; it holds the nominal one."""
    peak = max((step.report.peak_power for step in steps), default=0.0)
    worst = np.zeros(ROBOTS)
    for step in steps:
        if step.trajectory is None or step.report.peak_power < _NEAR * peak:
            continue
        scene = scene_with(
            request.cell,
            step.load or "none",
            request.power,
            request.settings.drives(request.cell.robot),
        )
        if scene.parameters is None:
            continue
        nominal = movement_energy(step.trajectory, scene).watts.max()
        drawn = [movement_energy(step.trajectory, one).watts.max() for one in _drawn_scenes(scene)]
        worst = np.maximum(
            worst, step.report.peak_power * np.array(drawn) / max(float(nominal), 1e-9)
        )
    if not worst.any():
        return JouleInterval(peak, peak)
    return interval(peak, worst - peak)


def _drawn_scenes(scene: PlanningScene) -> list[PlanningScene]:
    """The same scene with each of the drawn robots."""
    sets = [replace(scene.parameters, mean=row) for row in drawn_robots(scene.parameters)[:ROBOTS]]
    return [
        replace(
            scene, drives=replace(scene.drives, parameters=one), power=one.power_with(scene.power)
        )
        for one in sets
    ]


# Steps with what their uncertainty leaves open, as a side of the comparison: hops, power over
# time.

_STEP = 0.02  # s between the values of a power over time, at least
_MOST = 20_000


@dataclass(frozen=True, eq=False)
class Costed:
    """Steps, and what the drawn robots add (ROBOTS,) J to each."""

    steps: tuple[PlannedMovement, ...]
    added: tuple[FloatArray, ...]

    @property
    def seconds(self) -> float:
        """How long they take."""
        return sum(step.duration for step in self.steps)

    @property
    def joules(self) -> float:
        """Energy at the mains."""
        return sum(step.report.energy for step in self.steps)

    @property
    def robots(self) -> FloatArray:
        """What the drawn robots add (ROBOTS,) J to all of them."""
        return np.asarray(np.sum(self.added, axis=0))

    @property
    def pauses(self) -> int:
        """How many of them are pauses."""
        return sum(step.is_pause for step in self.steps)

    def split(self, pauses: int) -> tuple[Costed, Costed]:
        """All but the first so many pauses, and these."""
        resting = [k for k, step in enumerate(self.steps) if step.is_pause][:pauses]
        moving = [k for k in range(len(self.steps)) if k not in resting]
        parts = [
            Costed(tuple(self.steps[k] for k in own), tuple(self.added[k] for k in own))
            for own in (moving, resting)
        ]
        return parts[0], parts[1]


@dataclass(frozen=True, eq=False)
class CostedHop(Costed):
    """The steps from one stop to the next, or one pause; ends: names of the stops."""

    ends: tuple[str, str]

    @property
    def is_pause(self) -> bool:
        """Whether the robot stands still."""
        return self.steps[0].is_pause

    @property
    def title(self) -> str:
        """What it is called."""
        first, last = (name or "start" for name in self.ends)
        if self.steps[0].kind == MovementKind.CARTESIAN:
            return f"along {last}"
        return f"pause at {last}" if self.is_pause else f"{first} to {last}"


def costed(steps: Sequence[PlannedMovement], spreads: Spreads) -> Costed:
    """Steps with what the drawn robots add to each."""
    return Costed(tuple(steps), tuple(spreads.of(steps)))


def savings(before: Costed, after: Costed) -> tuple[Saving, Saving]:
    """What a program saves of the energy of another one by its movements, and in its pauses, of
    which both have as many; a wait at the end of one counts as movement.
    """
    pauses = min(program.pauses for program in (before, after))
    (moving, resting), (moved, rested) = (program.split(pauses) for program in (before, after))
    return saving(moving, moved), saving(resting, rested)


def saving(before: Costed, after: Costed) -> Saving:
    """What `after` saves of the energy of `before`; its interval is by common draws."""
    within = interval(before.joules - after.joules, before.robots - after.robots)
    return Saving(before.joules, after.joules, after.seconds, within.low, within.high)


def side_of(
    name: str, cycle_time: float, program: Costed, request: ProgramRequest, against: Costed
) -> Side:
    """A side with the intervals of its energies [J], its power over time and what it saves of the
    energy of `against`. cycle_time [s].
    """
    parameters = request.settings.drives(request.cell.robot).parameters
    widened = []
    for step, added in zip(program.steps, program.added, strict=True):
        within = interval(step.report.energy, added)
        report = replace(step.report, energy_low=within.low, energy_high=within.high)
        widened.append(replace(step, report=report))
    steps = tuple(widened)
    ends = np.cumsum([0.0, *(step.duration for step in steps)])
    begins = tuple(ends[:-1].tolist())
    report = total_report(tuple(step.report for step in steps), begins)
    whole = interval(report.energy, program.robots)
    report = replace(report, energy_low=whole.low, energy_high=whole.high)
    if parameters is not None:
        report = replace(report, power_parameters=parameters.name)
    time, watts, high = _power(steps, request)
    by_movements, in_pauses = savings(against, program)
    hops = tuple(_hop(hop) for hop in hops_of(program))
    peak = peak_interval(steps, request)
    return Side(
        name=name,
        cycle_time=cycle_time,
        movements=steps,
        report=report,
        hops=hops,
        time=time,
        watts=watts,
        high=high,
        moving=by_movements,
        resting=in_pauses,
        peak=(peak.low, peak.high),
    )


def hops_of(program: Costed) -> list[CostedHop]:
    """A hop ends at a pause, before a line out of a station, where the stops of a movement change,
    and at both ends of a path, which today's program may drive in several movements.
    """
    hops: list[CostedHop] = []
    for step, added in zip(program.steps, program.added, strict=True):
        ends = (step.from_station, step.to_station)
        if not hops or _begins(step, hops[-1]):
            hops.append(CostedHop((step,), (added,), ends))
            continue
        last = hops[-1]
        named = step.kind == MovementKind.REGIONAL
        ends = ends if named else last.ends
        hops[-1] = CostedHop((*last.steps, step), (*last.added, added), ends)
    return hops


def _begins(step: PlannedMovement, last: CostedHop) -> bool:
    """Whether a step is the first of a hop."""
    before = last.steps[-1]
    alone = (MovementKind.PAUSE, MovementKind.CARTESIAN)
    if step.kind == before.kind == MovementKind.CARTESIAN:
        return last.ends != (step.from_station, step.to_station)
    if step.kind in alone or before.kind in alone or step.kind == MovementKind.SERVICE_EXIT:
        return True
    if step.kind == MovementKind.SERVICE_ENTRY:
        return False
    if before.kind == MovementKind.REGIONAL:
        return last.ends != (step.from_station, step.to_station)
    return before.kind == MovementKind.SERVICE_ENTRY


def _hop(hop: CostedHop) -> HopSaving:
    within = interval(hop.joules, hop.robots)
    mode = hop.steps[0].power_mode
    return HopSaving(
        hop.title, hop.is_pause, hop.seconds, hop.joules, within.low, within.high, mode
    )


def _power(
    steps: Sequence[PlannedMovement], request: ProgramRequest
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times (N,) [s], mean and largest power at the mains (N,) [W] of even steps around them; a
    pause has its mean.
    """
    ends = [0.0]
    spent = [0.0]
    peaks = list[tuple[FloatArray, FloatArray]]()
    for step in steps:
        at = ends[-1]
        joules = spent[-1]
        if step.trajectory is not None:
            scene = scene_with(
                request.cell,
                step.load or "none",
                request.power,
                request.settings.drives(request.cell.robot),
            )
            energy = movement_energy(step.trajectory, scene)
            shares = np.cumsum(energy.watts) * (step.report.energy / max(energy.watts.sum(), 1e-9))
            times = at + energy.times - step.trajectory.times[0]
            largest = step.report.peak_power / max(float(energy.watts.max()), 1e-9)
            peaks.append((times, energy.watts * largest))
            ends += (times[:-1] + 0.5 * energy.dt).tolist()
            spent += (joules + shares[:-1]).tolist()
        ends.append(at + step.duration)
        spent.append(joules + step.report.energy)
    count = int(np.clip(ends[-1] / _STEP, 1, _MOST))
    edges = np.linspace(0.0, ends[-1], count + 1)
    watts = np.diff(np.interp(edges, ends, spent)) / np.maximum(np.diff(edges), 1e-9)
    high = watts.copy()
    for times, powers in peaks:
        np.maximum.at(high, np.clip(np.searchsorted(edges, times) - 1, 0, count - 1), powers)
    return 0.5 * (edges[1:] + edges[:-1]), watts, high


# The changes from one program to another: which movement, which pause, how, and how much that
# saves.

MOST = 5
# the work of a change
MODE = 1
TIMES = 2
PATH = 3
_WORTH_IT = 1.0  # J
_SAME_PATH = 0.05  # rad: within this a joint follows the same path
_SAME_TIME = 0.005  # s
_SAMPLES = 200


def changes(today: Costed, planned: Costed) -> tuple[StepChange, ...]:
    """The changes that save most from today's program to the planned one, those of least work
    first.
    """
    before = dict(_keyed(hops_of(today)))
    after = dict(_keyed(hops_of(planned)))
    found = [_change(before[key], after[key]) for key in before if key in after]
    worth = sorted(
        (one for one in found if one.saving.saved >= _WORTH_IT), key=lambda one: -one.saving.saved
    )
    return tuple(sorted(worth[:MOST], key=lambda one: (one.work, -one.saving.saved)))


def _keyed(hops: Sequence[CostedHop]) -> Iterator[tuple[tuple[str, int], CostedHop]]:
    """By the stops, and how often the same was before."""
    times: dict[str, int] = {}
    for hop in hops:
        times[hop.title] = times.get(hop.title, 0) + 1
        yield (hop.title, times[hop.title]), hop


def _change(before: CostedHop, after: CostedHop) -> StepChange:
    work, words = (
        _pause_change(before, after) if before.is_pause else _movement_change(before, after)
    )
    return StepChange(
        before.title, work, words, (before.seconds, after.seconds), saving(before, after)
    )


def _pause_change(before: CostedHop, after: CostedHop) -> tuple[int, str]:
    modes = [hop.steps[0].power_mode for hop in (before, after)]
    shown = [mode.replace(">", ", then ").replace("_", " ").lower() for mode in modes]
    if modes[0] == modes[1]:
        return TIMES, f"{after.seconds:.2f} s instead of {before.seconds:.2f} s"
    today, then = (f"{hop.joules / hop.seconds:.0f} W on average" for hop in (before, after))
    own = shown[0] or "the controller's own timer, which only closes the brakes"
    return MODE, f"{shown[1] or 'stand on motors'} ({then}) instead of {own} ({today})"


def _movement_change(before: CostedHop, after: CostedHop) -> tuple[int, str]:
    """What changed of a movement, as the kind of work that it takes and a sentence: another
    configuration, another path, other times, or other speeds on the same path.
    """
    times = f"{after.seconds:.2f} s instead of {before.seconds:.2f} s"
    # one movement, at rest at its corners as well
    along = before.steps[0].kind == MovementKind.CARTESIAN
    passed = 0 if along else len(before.steps) - len(after.steps)
    if passed > 0:
        times += f", {passed} stop{'s' if passed > 1 else ''} less on it"
    first = _points_along(before)
    second = _points_along(after)
    if np.abs(first[-1] - second[-1]).max() > _SAME_PATH:
        return PATH, f"another configuration at its end, {times}"
    away = _distance(second, first)
    if away > _SAME_PATH:
        return (
            PATH,
            f"another path (a joint up to {np.degrees(away):.0f} deg from today's), {times}",
        )
    if abs(after.seconds - before.seconds) > _SAME_TIME or passed > 0:
        return TIMES, f"the same path in {times}"
    return TIMES, "the same path in the same time, other speeds along it"


def _points_along(hop: CostedHop) -> FloatArray:
    """Points (M, n) along all movements of a hop."""
    points = [
        step.trajectory.sample(
            np.linspace(step.trajectory.times[0], step.trajectory.duration, _SAMPLES)
        ).q
        for step in hop.steps
        if step.trajectory is not None
    ]
    return np.concatenate(points)


def _distance(points: FloatArray, path: FloatArray) -> float:
    """How far [rad] points (M, n) get from a path (K, n), by their farthest joint."""
    return max(float(np.abs(path - point).max(axis=1).min()) for point in points)
