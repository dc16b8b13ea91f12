"""Excitation programme: movements of a cell from whose watts power parameters are identified.

Excursions are chosen greedily by the determinant of their information (D-optimal design; Fedorov,
1972), written as a folder of trajectories and read back.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from ir_cli.errors import CommandError, InputError
from ir_cli.traces import read_trace, write_trace
from ir_description import (
    Cell,
    DescriptionError,
    DescriptionFileError,
    Load,
    PowerParameters,
    load_cell,
)
from ir_description.files import read_regular_file
from ir_description.robot import IDLE
from ir_msgs_py.modes import drive_bus_up
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, Planner
from ir_recorder.measure import PowerModel, planned_samples
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError
from ir_values.output_files import write_file
from ir_values.yaml_items import Item, read_items

# The pool: certified excursions from several postures, out and back along straight joint
# segments, one axis at a time and several together, each at its fastest and at shares of that
# speed. Two points at rest are a quintic, so a trajectory is as simple as its ends; the planner
# proves limits, torque and clearance.

SPEEDS = (1.0, 0.5, 0.2)  # of the fastest
REACHES = (1.4, 0.8, 0.4)  # rad, the largest that is free
TOGETHER = 4  # excursions of several axes at a posture
_SLOWER = 1.25
_TRIES = 5  # times slower by _SLOWER until torque allows it
_SHORTEST = 0.4  # s: with less the meter sees hardly a sample
_SAMPLES = 200  # random configurations that postures are chosen from
_PEAKS = (1.875, 5.7735, 60.0)  # speed, acceleration, jerk of a quintic over 1 rad in 1 s


@dataclass(frozen=True, eq=False)
class Excursion:
    """Out of posture number `posture` and back with a load text; `name` says which axes and how
    fast.
    """

    name: str
    posture: int
    load: str
    out: JointTrajectory
    back: JointTrajectory

    @property
    def seconds(self) -> float:
        """Out and back [s]."""
        return self.out.duration + self.back.duration


def postures(planner: Planner, load: str, margin: float, count: int, seed: int) -> list[FloatArray]:
    """Free configurations (n,) far from each other, machine home first; fewer where there are not
    so many.
    """
    robot = planner.cell.robot
    generator = np.random.default_rng(seed)
    low = np.maximum(robot.position_min + 0.3, -2.6)
    high = np.minimum(robot.position_max - 0.3, 2.6)
    drawn = generator.uniform(low, high, (_SAMPLES, robot.n))
    free = [q for q, ok in zip(drawn, _valid(planner, drawn, margin, load), strict=True) if ok]
    chosen = [np.array(planner.cell.machine_home)]
    while free and len(chosen) < count:
        nearest = [min(np.linalg.norm(q[:3] - p[:3]) for p in chosen) for q in free]
        chosen.append(free.pop(int(np.argmax(nearest))))
    return chosen


def _valid(planner: Planner, q: FloatArray, margin: float, load: str) -> list[bool]:
    return [bool(each) for each in planner.check_states(q, safety_distance=margin, load=load).valid]


def excursions(
    planner: Planner, places: Sequence[FloatArray], load: str, margin: float, seed: int
) -> Iterator[Excursion]:
    """All of the pool with a load, from places (n,): certified, out and back."""
    generator = np.random.default_rng(seed)
    for number, place in enumerate(places):
        for name, direction in _directions(len(place), generator):
            yield from _in_direction(planner, number, place, name, direction, load, margin)


def _directions(n: int, generator: np.random.Generator) -> Iterator[tuple[str, FloatArray]]:
    """Each axis in both directions, and a few of all axes together."""
    for axis in range(n):
        for sign in (1.0, -1.0):
            yield f"A{axis + 1}{'+' if sign > 0.0 else '-'}", sign * np.eye(n)[axis]
    for k in range(TOGETHER):
        yield f"together {k + 1}", generator.uniform(-1.0, 1.0, n)


def _in_direction(
    planner: Planner,
    number: int,
    place: FloatArray,
    name: str,
    direction: FloatArray,
    load: str,
    margin: float,
) -> Iterator[Excursion]:
    """The largest free excursion in a direction, at every speed."""
    robot = planner.cell.robot
    for reach in REACHES:
        there = np.clip(
            place + reach * direction, robot.position_min + 0.05, robot.position_max - 0.05
        )
        fastest = _certified_pair(
            planner, place, there, _least_seconds(planner, place, there), load, margin
        )
        if fastest is None:
            continue
        for share in SPEEDS:
            pair = fastest
            if share < 1.0:
                slow = fastest[0].duration / share
                slower = _certified_pair(planner, place, there, slow, load, margin)
                if slower is None:
                    continue
                pair = slower
            yield Excursion(f"{name} at {share:.0%}", number, load, *pair)
        return


def _least_seconds(planner: Planner, start: FloatArray, goal: FloatArray) -> float:
    """What speed, acceleration and jerk allow a quintic between two configurations (n,)."""
    robot = planner.cell.robot
    travel = np.abs(goal - start)
    bounds = (robot.velocity_max, robot.acceleration_max, robot.jerk_max)
    least = [
        float(((peak * travel / bound) ** (1.0 / order)).max())
        for order, (peak, bound) in enumerate(zip(_PEAKS, bounds, strict=True), start=1)
    ]
    return max(_SHORTEST, 1.01 * max(least))


def _certified_pair(
    planner: Planner, start: FloatArray, goal: FloatArray, seconds: float, load: str, margin: float
) -> tuple[JointTrajectory, JointTrajectory] | None:
    """Out and back in at least so many seconds, both certified; None where they are not."""
    for _ in range(_TRIES):
        pair = (
            straight(planner.cell.robot.joint_names, start, goal, seconds),
            straight(planner.cell.robot.joint_names, goal, start, seconds),
        )
        found = [
            planner.evaluate(each, safety_distance=margin, load=load).verification for each in pair
        ]
        if all(each.certified for each in found):
            return pair
        if any(
            v is not None and v.what == "clearance" for each in found for v in (each.violation,)
        ):
            return None
        seconds *= _SLOWER
    return None


def straight(
    names: Sequence[str], start: FloatArray, goal: FloatArray, seconds: float
) -> JointTrajectory:
    """From rest to rest between two configurations (n,)."""
    still = np.zeros((2, len(start)))
    return JointTrajectory.from_seconds(
        names, [0.0, seconds], np.stack([start, goal]), still, still
    )


# The choice. The information of an excursion is what its windows of 50 ms, with the noise of a
# meter and a model, say of the parameters beyond their prior.

WINDOW = 0.05  # s
NOISE = 0.12  # of the price of a second [W], 60 W of a KR 210: what fits leave in motion
REST = 0.6  # s beside each movement
IDENTIFIED = 0.8  # of the deviation before: at most so much is left


@dataclass(frozen=True, eq=False)
class Identified:
    """What a programme says of the parameters: names, and the share (P,) of their deviation that is
    left.
    """

    names: tuple[str, ...]
    left: FloatArray

    @property
    def found(self) -> tuple[str, ...]:
        """Those that the programme identifies."""
        return tuple(n for n, left in zip(self.names, self.left, strict=True) if left < IDENTIFIED)

    @property
    def missing(self) -> tuple[str, ...]:
        """Those that it does not."""
        return tuple(n for n, left in zip(self.names, self.left, strict=True) if left >= IDENTIFIED)


class Design:
    """Excursions chosen one after another for a model and a prior."""

    def __init__(self, model: PowerModel, prior: PowerParameters) -> None:
        self._model = model
        self._prior = prior
        self._noise = NOISE * model.robot.time_value
        self._free = prior.deviation > 0.0
        self._scale = np.where(self._free, prior.deviation, 0.0)
        self._information = np.eye(len(self._scale))  # in deviations of the prior

    def of(self, excursion: Excursion, loads: Sequence[Load]) -> FloatArray:
        """Information (P, P) of an excursion, out and back."""
        total = np.zeros_like(self._information)
        for trajectory in (excursion.out, excursion.back):
            samples = planned_samples(trajectory, loads, self._prior.modes)
            _, slopes = self._model.watts_and_slopes(self._prior.mean, self._model.prepare(samples))
            scaled = slopes * self._scale / self._noise
            total += scaled.T @ scaled * (samples.step / WINDOW)
        return np.asarray(total)

    def choose(
        self, pool: Sequence[Excursion], informations: Sequence[FloatArray], seconds: float
    ) -> list[Excursion]:
        """Excursions of the pool, with the information (P, P) of each, at most once each, until
        they take so long together.
        """
        left = list(range(len(pool)))
        chosen = []
        taken = 0.0
        while left and taken < seconds:
            root = np.linalg.cholesky(np.linalg.inv(self._information))
            cost = [pool[k].seconds + 2.0 * REST for k in left]
            gains = [
                np.linalg.slogdet(np.eye(len(root)) + root.T @ informations[k] @ root)[1] / each
                for k, each in zip(left, cost, strict=True)
            ]
            best = int(np.argmax(gains))
            taken += cost[best]
            k = left.pop(best)
            chosen.append(pool[k])
            self._information = self._information + informations[k]
        return chosen

    def rest(self, mode: str, loads: Sequence[Load], seconds: float, q: FloatArray) -> None:
        """Count a stay of so many seconds in a mode at q (n,)."""
        still = np.zeros(len(self._scale))
        still[self._prior.index(f"watts.{mode}")] = 1.0
        still[self._prior.index("tool_watts")] = sum(
            load.watts(drive_bus=drive_bus_up(mode)) for load in loads
        )
        if mode == "STAND_ON_MOTORS":
            still[self._prior.index("drives_watts")] = 1.0
            still[self._prior.index(IDLE)] = 1.0
        scaled = still * self._scale
        self._information = (
            self._information + np.outer(scaled, scaled) * seconds / WINDOW / self._noise**2
        )

    def identified(self) -> Identified:
        """What is known of each parameter after all that was chosen."""
        left = np.sqrt(np.diag(np.linalg.inv(self._information)))
        open_ones = np.flatnonzero(self._free)  # of the others there is nothing to learn
        return Identified(tuple(self._prior.names[k] for k in open_ones), left[open_ones])


# The programme: stays in every mode, excursions by load and posture, movements between postures.

STAY = 6.0  # s in each mode
MODES = ("STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")
DEEP = "HIBERNATION"  # takes minutes; only where it is asked for


@dataclass(frozen=True, eq=False)
class ProgrammeStep:
    """A movement with a load, or (trajectory None) a stay of `seconds` [s] in a power mode."""

    name: str
    load: str
    trajectory: JointTrajectory | None = None
    mode: str = ""
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Programme:
    """Steps in their order, and what they identify of the parameters."""

    steps: tuple[ProgrammeStep, ...]
    identified: Identified

    @property
    def seconds(self) -> float:
        """All movements and stays together [s]."""
        return sum(
            step.seconds if step.trajectory is None else step.trajectory.duration
            for step in self.steps
        )


@dataclass(frozen=True)
class ExcitationRequest:
    """Seconds of excursions, of how many postures, S_m [m], whether to hibernate, and the seed."""

    seconds: float = 180.0
    postures: int = 3
    margin: float = 0.02
    hibernate: bool = False
    seed: int = 0


def plan_programme(planner: Planner, prior: PowerParameters, asked: ExcitationRequest) -> Programme:
    """The programme of a cell: rests in all modes, then the excursions that tell most about the
    parameters. CommandError where nothing in it can move.
    """
    cell = planner.cell
    link = cell.robot.controller.dc_link
    design = Design(PowerModel(cell.robot, link, cell.base_pose, prior), prior)
    loads = load_texts(planner)
    heaviest = loads[-1]
    places = postures(planner, heaviest, asked.margin, asked.postures, asked.seed)
    places = _reachable(planner, places, heaviest, asked)
    pool: list[Excursion] = []
    for load in loads:
        pool += excursions(planner, places, load, asked.margin, asked.seed)
    if not pool:
        raise CommandError(f"no excursion from {len(places)} postures of {cell.name} is certified")
    held = {load: planner.scene(load).loads for load in loads}
    known = [mode for mode in MODES if mode in prior.modes]
    modes = [mode for mode in known if mode != DEEP or asked.hibernate]
    for mode in modes:
        design.rest(mode, held[loads[0]], STAY, places[0])
    candidates = [design.of(each, held[each.load]) for each in pool]
    chosen = design.choose(pool, candidates, asked.seconds)
    steps: list[ProgrammeStep] = []
    for load in loads:
        own = [each for each in chosen if each.load == load]
        steps += _with_load(planner, places, own, load, asked)
    stays = [ProgrammeStep(f"in {mode}", loads[0], mode=mode, seconds=STAY) for mode in modes]
    return Programme((*stays, *steps), design.identified())


def load_texts(planner: Planner) -> tuple[str, ...]:
    """What the robot may hold: the tool (or nothing), and the tool with the heaviest part."""
    cell = planner.cell
    tool = cell.tool.name if cell.tool is not None else NO_LOAD
    if not cell.parts:
        return (tool,)
    part = max(cell.parts, key=lambda each: each.load.mass).name
    return (tool, f"{tool}+{part}" if cell.tool is not None else part)


def _reachable(
    planner: Planner, places: Sequence[FloatArray], load: str, asked: ExcitationRequest
) -> list[FloatArray]:
    """The postures that can be reached from home and left for it."""
    home = places[0]
    return [
        home,
        *(
            place
            for place in places[1:]
            if all(
                _movement_between(planner, *ends, load, asked)
                for ends in ((home, place), (place, home))
            )
        ),
    ]


def _movement_between(
    planner: Planner, start: FloatArray, goal: FloatArray, load: str, asked: ExcitationRequest
) -> JointTrajectory | None:
    """The certified movement between two configurations (n,), None where none is found."""
    options = PlanOptions(seed=asked.seed, safety_distance=asked.margin, load=load)
    return planner.plan_regional(
        start=start, goal=Goal(configuration=goal), options=options
    ).trajectory


def _with_load(
    planner: Planner,
    places: Sequence[FloatArray],
    chosen: Sequence[Excursion],
    load: str,
    asked: ExcitationRequest,
) -> list[ProgrammeStep]:
    """Excursions posture by posture, from home and back to it, with a rest on motors beside
    each.
    """
    steps: list[ProgrammeStep] = []
    for number, place in enumerate(places):
        own = [each for each in chosen if each.posture == number]
        if own and number:
            steps += _transfer(planner, places[0], place, load, f"to posture {number}", asked)
        for each in own:
            for name, trajectory in (("out", each.out), ("back", each.back)):
                steps.append(ProgrammeStep(f"{each.name} {name}", load, trajectory))
                steps.append(ProgrammeStep("at rest", load, mode=MODES[0], seconds=REST))
        if own and number:
            steps += _transfer(planner, place, places[0], load, f"from posture {number}", asked)
    return steps


def _transfer(
    planner: Planner,
    start: FloatArray,
    goal: FloatArray,
    load: str,
    name: str,
    asked: ExcitationRequest,
) -> list[ProgrammeStep]:
    trajectory = _movement_between(planner, start, goal, load, asked)
    if trajectory is None:
        raise CommandError(
            f"the movement {name} with {load} was found with another load and is not any more"
        )
    return [
        ProgrammeStep(name, load, trajectory),
        ProgrammeStep("at rest", load, mode=MODES[0], seconds=REST),
    ]


def advice(missing: Sequence[str]) -> tuple[str, ...]:
    """What would identify the parameters that a programme does not, one sentence for each kind."""
    kinds = {name.partition(".")[0] for name in missing}
    said = [sentence for kind, sentence in _ADVICE.items() if kind in kinds]
    if "watts.HIBERNATION" in missing:
        said.append("watts.HIBERNATION: let it hibernate (--hibernate; it takes minutes)")
    return tuple(said)


_ADVICE = {
    "iron": "iron: longer movements of that axis at full speed, which viscous friction can be "
    "separated from",
    "viscous": "viscous: more speeds of that axis; give it room in the cell, or more --seconds",
    "coulomb": "coulomb: slow movements of that axis in both directions; more --seconds",
    "copper": "copper: hold and move a heavier load, with the arm stretched",
    "inverter": "inverter: postures that hold little beside postures that hold much; more "
    "--postures",
    "gear": "gear: the same movement with and without a load; a cell with a part",
    "load_mass": "load_mass: a part that can be held, or lift the tool over a larger height",
    "tool_watts": "tool_watts: one run without the tool",
    "dc_link": "dc_link: fast movements of a heavy load that brake one axis after the other",
    "rectifier_efficiency": "rectifier_efficiency: a load of known work; else a meter at the DC "
    "link",
}

FORMAT = "ir_programme/1"
FILE = "programme.yaml"
_BYTES_MAX = 10_000_000
_STEPS_MAX = 100_000
_LONGEST = 86400.0  # s: a stay of a day


def write_programme(programme: Programme, folder: Path, cell: str) -> Path:
    """Write all steps into a folder; the path of its `programme.yaml`."""
    rows: list[dict[str, object]] = []
    for number, step in enumerate(programme.steps, start=1):
        row: dict[str, object] = {"name": step.name, "load": step.load}
        if step.trajectory is None:
            row |= {"mode": step.mode, "seconds": step.seconds}
        else:
            row["trajectory"] = f"{number:03d}.csv"
            write_trace(folder / f"{number:03d}.csv", step.trajectory)
        rows.append(row)
    page = {"format": FORMAT, "cell": cell, "seconds": round(programme.seconds, 1), "steps": rows}
    path = folder / "programme.yaml"
    write_file(path, yaml.safe_dump(page, sort_keys=False))
    return path


def read_programme(folder: Path) -> tuple[Cell, tuple[ProgrammeStep, ...]]:
    """The cell and the steps of a folder that `write_programme` wrote. InputError with file and
    line.
    """
    path = folder / FILE
    try:
        text = read_regular_file(path, _BYTES_MAX).decode("utf-8", "replace")
        top = read_items(text, str(path), DescriptionFileError).table(
            ("format", "cell", "steps"), ("seconds",)
        )
        top["format"].choice((FORMAT,))
        cell = load_cell(top["cell"].text())
        return cell, tuple(_step(each, cell, folder) for each in top["steps"].list(1, _STEPS_MAX))
    except (DescriptionError, InvalidValueError) as error:
        raise InputError(str(error)) from error


def _step(item: Item, cell: Cell, folder: Path) -> ProgrammeStep:
    row = item.table(("name", "load"), ("trajectory", "mode", "seconds"))
    name = row["name"].text()
    load = row["load"].text()
    if "trajectory" not in row:
        if "mode" not in row or "seconds" not in row:
            item.fail("must have a trajectory, or a mode and seconds")
        return ProgrammeStep(
            name, load, mode=row["mode"].choice(MODES), seconds=row["seconds"].number(0.0, _LONGEST)
        )
    file = row["trajectory"].text()
    if Path(file).name != file:
        row["trajectory"].fail("must be the name of a file in the same folder")
    return ProgrammeStep(name, load, read_trace(folder / file, cell.robot.joint_names))
