"""A program as its planner sees it: every step with what is held, where the parts lie and how the
doors stand before and after it.
"""

from dataclasses import dataclass, field

from ir_description import (
    Cell,
    InvalidValueError,
    PartPlaces,
    PowerData,
    ProgramStep,
    Signal,
    StepKind,
    cell_in,
)
from ir_description import UnknownNameError as DescriptionNameError
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, UnknownNameError
from ir_planner.program.doors import Doors, doors_along
from ir_planner.request import POSTURES
from ir_planner.scene import Drives, PlanningScene, with_parts

STEPS_MAX = 500


@dataclass(frozen=True)
class PlacedStep:
    """A step with the parts and the doors before and after it."""

    step: ProgramStep
    before: PartPlaces
    after: PartPlaces
    doors_before: Doors = ()
    doors_after: Doors = ()


@dataclass
class Scenes:
    """Scenes of one program by where its parts are and how its doors stand; each is built once."""

    cell: Cell
    power: PowerData
    drives: Drives = field(default_factory=Drives)
    bare: bool = False
    _built: dict[tuple[str, tuple[tuple[str, str], ...], Doors], PlanningScene] = field(
        default_factory=dict
    )

    def before(self, placed: PlacedStep) -> PlanningScene:
        """The scene in which a step moves."""
        return self.of(placed.before, placed.doors_before)

    def after(self, placed: PlacedStep) -> PlanningScene:
        """The scene when a step has been done."""
        return self.of(placed.after, placed.doors_after)

    def of(self, places: PartPlaces, doors: Doors = ()) -> PlanningScene:
        """The scene while the parts are at `places`."""
        key = (places.held, tuple(sorted(places.lying.items())), doors)
        if key not in self._built:
            cell = cell_in(with_parts(self.cell, places), dict(doors))
            loads = () if self.bare else cell.loads(places.held)
            self._built[key] = PlanningScene(cell, loads, self.power, self.drives)
        return self._built[key]


def steps_of(cell: Cell, stations: tuple[str, ...]) -> tuple[ProgramStep, ...]:
    """The cell's program, or a visit of each of `stations` (stations, postures, paths) in turn.

    Raises UnknownNameError for a stop nobody has, RequestError where there is nothing to plan.
    """
    if not stations:
        if not cell.program:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"cell {cell.name} has no program: name the stations to visit",
            )
        return cell.program
    if len(stations) > STEPS_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{len(stations)} stations are given: at most {STEPS_MAX} are planned",
        )
    kinds: dict[str, StepKind] = dict.fromkeys(POSTURES, "POSTURE")
    kinds |= dict.fromkeys((path.name for path in cell.paths), "PATH")
    kinds |= dict.fromkeys((station.name for station in cell.stations), "STATION")
    for name in stations:
        if name not in kinds:
            raise UnknownNameError("station", name, kinds)
    return tuple(ProgramStep(kinds[name], name) for name in stations)


def placed_steps(
    cell: Cell, steps: tuple[ProgramStep, ...], places: PartPlaces, begin: Doors = ()
) -> tuple[PlacedStep, ...]:
    """The steps with the parts before and after each; begin: doors that are not as the cell has
    them. Raises RequestError for a step that can't be done.
    """
    result = []
    for k, (step, doors) in enumerate(zip(steps, doors_along(cell, steps, begin), strict=True), 1):
        try:
            after = places.after(step)
        except (InvalidValueError, DescriptionNameError) as error:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, f"step {k} of the program: {error}"
            ) from error
        result.append(PlacedStep(step, places, after, *doors))
        places = after
    return tuple(result)


def signal_text(signal: Signal) -> str:
    """A signal as messages carry it: "name", or "name=0" where it is awaited or set to false."""
    return signal.name if signal.value else f"{signal.name}=0"
