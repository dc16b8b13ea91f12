"""Is a pause planned as cheaply as it can be, and does the controller draw what was predicted?

    python benchmarks/standby.py [--cell FILE]... [--seeds N] [--quick] [--json FILE]

Pauses of 1 s to 2 h at random postures, with and without part, the controller's times as in the
data and drawn. Known lengths and timeout policies over eight equally likely lengths are held
against exhaustive search over sequences of modes with timers on a grid, in code of its own, and
against the simulated controller, which is stepped without real time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from _results import at_most, command_line, finish, line_of

from ir_description import load_cell, load_power_data
from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.names import NO_LOAD
from ir_planner.checks.free_space import state_check
from ir_planner.program import lengths_of
from ir_planner.program.pauses import Rests, rests_at
from ir_planner.program.standby import advice
from ir_planner.scene import PlanningScene, load_text, scene_with
from ir_sim_driver.controller import SimulationSettings, make_simulation
from ir_sim_driver.power import IdleTimes
from ir_values.arrays import FloatArray

# Exhaustive search over sequences of power modes with timers, each simulated event by event;
# shares no code with the planner.

Plan = tuple[tuple[int, float], ...]  # mode and when it is asked for [s]


@dataclass(frozen=True)
class Controller:
    """watts: on motors and in each mode. enter, stay, leave [s] of each mode. timer [s]: brakes by
    itself. bus_off: the modes in which the DC link empties, to e^(-rate t) of its voltage, which
    takes `charge` [J] from the mains to fill from empty.
    """

    watts: tuple[float, ...]
    enter: tuple[float, ...]
    stay: tuple[float, ...]
    leave: tuple[float, ...]
    timer: float
    bus_off: tuple[bool, ...] = (False, False, False)
    charge: float = 0.0
    rate: float = 0.0

    def run(self, plan: Plan, wake: float, end: float) -> tuple[float, float]:
        """Energy [J] until the robot is ready and needed, at `end` at the earliest, and when that
        is [s]; motors are asked for at `wake`.
        """
        orders = [(at, k) for k, at in plan if at < wake]
        if not orders and wake <= self.timer:
            wake = end  # asked for on motors, motors change nothing, and the timer goes on
        if (not orders or orders[0][0] > self.timer) and wake > self.timer:
            orders = [(self.timer, 0), *((at, k) for at, k in orders if k != 0)]
        now = 0.0
        energy = 0.0
        mode = -1
        cut = float("nan")
        for at, k in orders:
            start = max(at, now)
            if mode >= 0 and start >= wake:
                break
            power = self.watts[mode + 1]
            energy += (
                power * (start - now) + power * self.enter[k] + self.watts[k + 1] * self.stay[k]
            )
            now = start + self.enter[k] + self.stay[k]
            if self.bus_off[k] and math.isnan(cut):
                cut = start + self.enter[k]
            mode = k
        if not math.isnan(cut):
            energy += self.charge * (1.0 - math.exp(-self.rate * (max(wake, now) - cut)))
        if mode >= 0:
            energy += self.watts[mode + 1] * max(wake - now, 0.0) + self.watts[0] * self.leave[mode]
            now = max(wake, now) + self.leave[mode]
        return energy + self.watts[0] * max(end - now, 0.0), max(now, end)

    def plans(self, grid: Sequence[float]) -> Iterator[Plan]:
        """All sequences that go deeper, at the times of a grid or as soon as the mode before can be
        left.
        """
        modes = range(len(self.enter))
        for count in range(len(self.enter) + 1):
            for chosen in itertools.combinations(modes, count):
                yield from self._timed(chosen, grid, ())

    def _timed(
        self, chosen: tuple[int, ...], grid: Sequence[float], before: Plan
    ) -> Iterator[Plan]:
        if len(before) == len(chosen):
            yield before
            return
        first = (
            sum((before[-1][1], self.enter[before[-1][0]], self.stay[before[-1][0]]))
            if before
            else 0.0
        )
        for at in [first, *(time for time in grid if time > first)]:
            yield from self._timed(chosen, grid, (*before, (chosen[len(before)], at)))

    def least_known(self, pause: float, grid: Sequence[float]) -> float:
        """Least energy [J] of a pause of known length [s], ready at its end; inf: nothing is ready
        then.
        """
        found = []
        for plan in self.plans(grid):
            for wake in (pause, *(pause - leave for leave in self.leave)):
                if wake > 0.0:
                    energy, ready = self.run(plan, wake, pause)
                    if ready <= pause + 1e-9:
                        found.append(energy)
        return min(found, default=float("inf"))

    def least_expected(self, lengths: Sequence[float], grid: Sequence[float]) -> float:
        """Least mean energy [J] of pauses whose end wakes the robot."""
        return min(
            sum(self.run(plan, pause, pause)[0] for pause in lengths) / len(lengths)
            for plan in self.plans(grid)
        )


CELL = "demo"
SEEDS = 60
QUICK_SEEDS = 12
LENGTHS = 8
JOULES = 20.0  # that a prediction may be off whatever the pause
APART = 0.01  # m between the robot and what stands around it
STEP = 0.01  # s: nothing moves, and no time of the controller is shorter


@dataclass(frozen=True)
class Row:
    """One controller: pause [s], planned, least on the grid and measured energy [J]; the same of a
    policy.
    """

    cell: str
    seed: int
    pause: float
    planned: float
    searched: float
    measured: float
    policy: float
    policy_searched: float
    clairvoyant: float
    worst: float


def times_of(rng: np.random.Generator, drawn: bool) -> tuple[TransitionTimes, float]:
    """Transition times and the controller's own timer [s]: of the data, or drawn."""
    times = TransitionTimes()
    if not drawn:
        return times, load_power_data().motors_to_brakes_in_program
    values = {name: float(round(rng.uniform(0.05, 40.0), 2)) for name in vars(times)}
    return TransitionTimes(**values), float(round(rng.uniform(1.0, 40.0), 2))


def free_posture(rng: np.random.Generator, scene: PlanningScene) -> FloatArray:
    """A configuration (n,) in which nothing touches: the simulated robot stops at a contact."""
    robot = scene.cell.robot
    while True:
        q = robot.position_min + rng.uniform(0.2, 0.8, robot.n) * (
            robot.position_max - robot.position_min
        )
        if state_check(q, scene, APART, 1).valid:
            return q


def controller_of(rests: Rests) -> Controller:
    """The figures alone."""
    modes = rests.modes
    return Controller(
        (rests.motors, *(mode.watts for mode in modes)),
        tuple(mode.enter for mode in modes),
        tuple(mode.stay for mode in modes),
        tuple(mode.leave for mode in modes),
        rests.timer,
        tuple(mode.bus_off for mode in modes),
        rests.recharge.whole,
        rests.recharge.rate,
    )


def measured(rests_cell: str, load: str, q: FloatArray, times: TransitionTimes, timer: float, pause: float,  # noqa: E501
             wake_at: float) -> float:  # fmt: skip
    """Energy [J] that the simulated controller draws over a pause [s] that it is woken from in
    time.
    """
    idle = IdleTimes(motors_to_brakes_in_program=timer)
    settings = SimulationSettings(dt=STEP, transitions=times, idle=idle)
    plant = make_simulation(load_cell(rests_cell), load, "ideal", settings)
    plant.backend.reset(q)
    plant.executor.hold(q)
    begun = plant.mains.energy()
    plant.pauses.start(pause, executing=False)
    plant.run(wake_at)
    plant.wake() if plant.modes.mode is Mode.HIBERNATION else plant.pauses.end()
    while not plant.modes.motors_on or plant.time < pause:
        plant.step()
        if plant.stopped:
            raise RuntimeError(f"the controller stopped the robot in a pause: {plant.fault}")
    return plant.mains.energy() - begun


def row_of(name: str, seed: int) -> Row:
    """Plan, search and drive the pauses of a seed."""
    rng = np.random.default_rng([seed, *name.encode()])
    cell = load_cell(name)
    times, timer = times_of(rng, drawn=seed % 2 == 1)
    tool = load_text(cell)
    load = (NO_LOAD, tool, f"{tool}+{cell.parts[0].name}" if cell.parts else tool)[seed % 3]
    scene = scene_with(cell, load, replace(load_power_data(), motors_to_brakes_in_program=timer))
    q = free_posture(rng, scene)
    searched = controller_of(rests_at(q, scene, times))
    pause = float(round(10.0 ** rng.uniform(0.0, 3.857), 2))
    known = advice(lengths_of(pause), q, scene, times)
    lengths = np.round(10.0 ** rng.uniform(0.0, 3.857, LENGTHS), 2)
    policy = advice(lengths_of(0.0, lengths), q, scene, times)
    grid = np.linspace(0.0, min(pause, 300.0), 6).tolist()
    return Row(
        name,
        seed,
        pause,
        known.energy,
        min(searched.least_known(pause, grid), searched.run((), pause, pause)[0]),
        measured(name, load, q, times, timer, pause, known.wake_at),
        policy.expected,
        searched.least_expected(lengths.tolist(), sorted({0.0, *lengths.tolist()})),
        policy.clairvoyant,
        policy.worst,
    )


def off(row: Row) -> float:
    """How far the measured energy is from the planned one, as a share of what is allowed: 3 % or 20
    J.
    """
    return abs(row.measured - row.planned) / max(JOULES, 0.03 * row.planned)


def main() -> None:
    """Print one line per controller, then the claims."""
    parser = command_line(__doc__, (CELL,), SEEDS, f"{QUICK_SEEDS} seeds")
    options = parser.parse_args()
    seeds = QUICK_SEEDS if options.quick else options.seeds
    rows = []
    for cell in options.cell or (CELL,):
        for seed in range(seeds):
            rows.append(row_of(cell, seed))
            print(line_of(asdict(rows[-1])), flush=True)
    above = max(row.planned / row.searched - 1.0 for row in rows)
    policy = max(row.policy / row.policy_searched - 1.0 for row in rows)
    order = max(max(row.clairvoyant - row.policy, row.policy - row.worst) for row in rows)
    claims = [
        at_most("known pause above exhaustive search", 100.0 * above, "%", 1e-6),
        at_most("timeout policy above exhaustive search", 100.0 * policy, "%", 1e-6),
        at_most("clairvoyant above expected, or expected above worst", order, "J", 1e-6),
        at_most("driven off predicted, share of 3 % or 20 J", max(map(off, rows)), "", 1.0),
    ]
    finish(options.json, [asdict(row) for row in rows], claims)


if __name__ == "__main__":
    main()
