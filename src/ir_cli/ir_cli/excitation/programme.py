"""The programme: excursions by load and posture, the movements between postures, and pauses in
every mode.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_cli.errors import CommandError
from ir_cli.excitation.choice import REST, Design, Identified
from ir_cli.excitation.pool import Excursion, excursions, postures
from ir_description import PowerParameters, load_power_data
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, Planner
from ir_recorder.measure import PowerModel

STAY = 6.0  # s in each mode
MODES = ("STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")
DEEP = "HIBERNATION"  # takes minutes; only where it is asked for


@dataclass(frozen=True, eq=False)
class Step:
    """A movement with a load, or (trajectory None) a stay of `seconds` [s] in a power mode."""

    name: str
    load: str
    trajectory: JointTrajectory | None = None
    mode: str = ""
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Programme:
    """Steps in their order, and what they identify of the parameters."""

    steps: tuple[Step, ...]
    identified: Identified

    @property
    def seconds(self) -> float:
        """All movements and stays together [s]."""
        return sum(
            step.seconds if step.trajectory is None else step.trajectory.duration
            for step in self.steps
        )


@dataclass(frozen=True)
class Asked:
    """Seconds of excursions, of how many postures, S_m [m], whether to hibernate, and the seed."""

    seconds: float = 180.0
    postures: int = 3
    margin: float = 0.02
    hibernate: bool = False
    seed: int = 0


def plan_programme(planner: Planner, prior: PowerParameters, asked: Asked) -> Programme:
    """The programme of a cell; CommandError where nothing in it can move."""
    cell = planner.cell
    link = load_power_data(prior.controller).dc_link
    design = Design(PowerModel(cell.robot, link, cell.base_pose, prior), prior)
    loads = load_texts(planner)
    places = postures(planner, loads[-1], asked.margin, asked.postures, asked.seed)
    places = _reachable(planner, places, loads[-1], asked)
    pool = [
        each
        for load in loads
        for each in excursions(planner, places, load, asked.margin, asked.seed)
    ]
    if not pool:
        raise CommandError(f"no excursion from {len(places)} postures of {cell.name} is certified")
    held = {load: planner.scene(load).loads for load in loads}
    modes = [mode for mode in MODES if mode != DEEP or asked.hibernate]
    for mode in modes:
        design.rest(mode, held[loads[0]], STAY, places[0])
    chosen = design.choose(pool, [design.of(each, held[each.load]) for each in pool], asked.seconds)
    steps: list[Step] = []
    for load in loads:
        steps += _with_load(
            planner, places, [each for each in chosen if each.load == load], load, asked
        )
    stays = [Step(f"in {mode}", loads[0], mode=mode, seconds=STAY) for mode in modes]
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
    planner: Planner, places: Sequence[FloatArray], load: str, asked: Asked
) -> list[FloatArray]:
    """The postures that can be reached from home and left for it."""
    home = places[0]
    return [
        home,
        *(
            place
            for place in places[1:]
            if all(_moved(planner, *ends, load, asked) for ends in ((home, place), (place, home)))
        ),
    ]


def _moved(
    planner: Planner, start: FloatArray, goal: FloatArray, load: str, asked: Asked
) -> JointTrajectory | None:
    """The certified movement between two configurations (n,), None where none is found."""
    options = PlanOptions(seed=asked.seed, safety_distance=asked.margin, load=load)
    return planner.plan_regional(start, Goal(configuration=goal), options).trajectory


def _with_load(
    planner: Planner,
    places: Sequence[FloatArray],
    chosen: Sequence[Excursion],
    load: str,
    asked: Asked,
) -> list[Step]:
    """Excursions posture by posture, from home and back to it, with a rest on motors beside
    each.
    """
    steps: list[Step] = []
    for number, place in enumerate(places):
        own = [each for each in chosen if each.posture == number]
        if own and number:
            steps += _transfer(planner, places[0], place, load, f"to posture {number}", asked)
        for each in own:
            for name, trajectory in (("out", each.out), ("back", each.back)):
                steps.append(Step(f"{each.name} {name}", load, trajectory))
                steps.append(Step("at rest", load, mode=MODES[0], seconds=REST))
        if own and number:
            steps += _transfer(planner, place, places[0], load, f"from posture {number}", asked)
    return steps


def _transfer(
    planner: Planner, start: FloatArray, goal: FloatArray, load: str, name: str, asked: Asked
) -> list[Step]:
    trajectory = _moved(planner, start, goal, load, asked)
    if trajectory is None:
        raise CommandError(
            f"the movement {name} with {load} was found with another load and is not any more"
        )
    return [Step(name, load, trajectory), Step("at rest", load, mode=MODES[0], seconds=REST)]


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
    "rectifier_efficiency": "rectifier_efficiency: a load of known work; else a meter at the DC "
    "link",
}
