"""Steps of a program: doors, what is held and where parts lie before and after each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from ir_description import (
    Cell,
    Equipment,
    InvalidValueError,
    PartPlaces,
    PowerData,
    ProgramStep,
    UnknownNameError,
)
from ir_description.cell import StepKind, ToolTilt, cell_in
from ir_msgs_py.plc import Signal
from ir_msgs_py.status import Status, StatusCode
from ir_planner.errors import RequestError, unknown_name
from ir_planner.request import POSTURES, one_tilt
from ir_planner.scene import Drives, PlanningScene, with_parts

# Which states the machines with a switch are in along a program, as its own signals move them.
#
# They begin as the cell has them, or as a driver says that they are. A machine whose signal is
# set changes from then on, until a step waits for the signal that follows, or dwells as long as
# the change takes: meanwhile it is in both states, and what sweeps between them is there too.
# Movements are planned among what may be there.

Doors = tuple[tuple[str, tuple[str, ...]], ...]
"""Machines that are not as the cell has them, with their state, or the two between which they
change.
"""


def doors_along(
    cell: Cell, steps: Sequence[ProgramStep], begin: Doors = ()
) -> Iterator[tuple[Doors, Doors]]:
    """Before each step moves, and after it. begin: machines that are not as the cell has them
    now.
    """
    states: dict[str, tuple[str, ...]] = {
        machine.name: (machine.state,) for machine in _switched(cell)
    }
    states |= {name: now for name, now in begin if name in states}
    for step in steps:
        for machine in _switched(cell):
            states[machine.name] = _awaited(cell, machine, step, states[machine.name])
        before = _unlike(cell, states)
        for machine in _switched(cell):
            states[machine.name] = _set(machine, step, states[machine.name])
        yield before, _unlike(cell, states)


def doors_text(doors: Doors) -> str:
    """How they stand at the start of a program or a movement, "" where all are as the cell has
    them.
    """
    said = (f"{name} {' changing to '.join(states)}" for name, states in doors)
    return f"at the start, as the driver says: {', '.join(said)}" if doors else ""


def with_doors(status: Status, scene: PlanningScene) -> Status:
    """The status of what was not found or is not free, and doors that are not as the cell has
    them.
    """
    said = doors_advice(scene.cell, "", scene.doors)
    return replace(status, message="; ".join(filter(None, (status.message, said))))


def doors_advice(cell: Cell, target: str, doors: Doors) -> str:
    """What a movement to `target` ("": the one that was asked for) that was not found may want, ""
    where all is as the cell has it.
    """
    return "; ".join(
        _of_machine(cell, cell.machine(name), target, states) for name, states in doors
    )


def _switched(cell: Cell) -> list[Equipment]:
    return [machine for machine in cell.equipment if machine.switch is not None and machine.enabled]


def _answers(cell: Cell, machine: Equipment) -> list[str]:
    """Signals that say where the machine is: they follow its switch, no sooner than it is there."""
    assert machine.switch is not None
    signal = machine.switch.signal
    time = machine.switch.time
    own = [signal] if time == 0.0 else []
    return [
        *own,
        *(each.name for each in cell.signals if each.follows == signal and each.delay >= time),
    ]


def _awaited(
    cell: Cell, machine: Equipment, step: ProgramStep, states: tuple[str, ...]
) -> tuple[str, ...]:
    assert machine.switch is not None
    for signal in step.wait_for:
        if signal.name in _answers(cell, machine):
            states = (machine.switch.on if signal.value else machine.switch.off,)
    return states


def _set(machine: Equipment, step: ProgramStep, states: tuple[str, ...]) -> tuple[str, ...]:
    switch = machine.switch
    assert switch is not None
    for signal in step.set_signals:
        target = switch.on if signal.value else switch.off
        if signal.name == switch.signal and states[-1] != target:
            states = (states[-1], target)
    return states[-1:] if step.dwell >= switch.time else states


def _unlike(cell: Cell, states: Mapping[str, tuple[str, ...]]) -> Doors:
    return tuple((name, now) for name, now in states.items() if now != (cell.machine(name).state,))


def _of_machine(cell: Cell, machine: Equipment, target: str, states: tuple[str, ...]) -> str:
    switch = machine.switch
    assert switch is not None
    there = f"when {target} is next, {machine.name}" if target else machine.name
    if len(states) == 1:
        level = "" if states[0] == switch.off else "=0"
        return (
            f"{there} is {states[0]}, as signal {switch.signal} has it; "
            f"{switch.signal}{level} turns it"
        )
    level = "" if states[1] == switch.on else "=0"
    wait = "".join(f"wait for signal {name}{level}, or " for name in _answers(cell, machine)[:1])
    return f"{there} changes from {states[0]} to {states[1]}: {wait}dwell {switch.time:g} s before"


# A program as its planner sees it: every step with what is held, where the parts lie and how the
# doors stand before and after it.

STEPS_MAX = 500


class PlacedStep(NamedTuple):
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
    _built: dict[tuple[str, str, tuple[tuple[str, str], ...], Doors], PlanningScene] = field(
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
        key = (places.held, places.carrying, tuple(sorted(places.lying.items())), doors)
        if key not in self._built:
            cell = cell_in(with_parts(self.cell, places), dict(doors))
            loads = () if self.bare else cell.loads_at(places)
            self._built[key] = PlanningScene(cell, loads, self.power, self.drives)
        return self._built[key]


def steps_of(cell: Cell, stations: tuple[str, ...]) -> tuple[ProgramStep, ...]:
    """The cell's program, or a visit of each of `stations` (stations, postures, paths) in turn.

    Raises RequestError for an unknown stop, and where there is nothing to plan.
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
            raise unknown_name("station", name, kinds)
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
        except (InvalidValueError, UnknownNameError) as error:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, f"step {k} of the program: {error}"
            ) from error
        result.append(PlacedStep(step, places, after, *doors))
        places = after
    return tuple(result)


def signal_text(signal: Signal) -> str:
    """A signal as messages carry it: "name", or "name=0" where it is awaited or set to false."""
    return signal.name if signal.value else f"{signal.name}=0"


# The stops of a program in order: which steps go somewhere, and what is held where when they
# do.


@dataclass(frozen=True, eq=False)
class Route:
    """All steps, and `stops`: indices of those that go somewhere; a step at the place of the one
    before stays there, but a path is driven again.
    """

    steps: tuple[PlacedStep, ...]
    scenes: Scenes
    stops: tuple[int, ...]

    @staticmethod
    def over(steps: tuple[PlacedStep, ...], scenes: Scenes) -> "Route":
        """The route that visits the targets of the steps."""
        stops = []
        here = ""
        for k, placed in enumerate(steps):
            kind = placed.step.kind
            target = placed.step.target
            if kind == "PATH" or (kind != "PAUSE" and target != here):
                stops.append(k)
                here = target
        return Route(steps, scenes, tuple(stops))

    def __len__(self) -> int:
        return len(self.stops)

    def at(self, place: int) -> PlacedStep:
        """The step of a stop."""
        return self.steps[self.stops[place]]

    def name(self, place: int) -> str:
        """Where a stop is; "": before the first."""
        return self.at(place).step.target if place >= 0 else ""

    def tilt(self, place: int) -> ToolTilt | None:
        """How far the tool may lean on the movement to a stop, by its step, station and the part
        that is held; None: as it likes. Raises RequestError where they bound different axes.
        """
        placed = self.at(place)
        target = placed.step.target
        held = placed.before.held
        asked = {f"step {self.stops[place] + 1}": placed.step.tilt}
        if placed.step.kind == "STATION":
            asked[f"station {target}"] = self.scenes.cell.station(target).tilt
        if held:
            asked[f"part {held}"] = self.scenes.cell.part(held).tilt
        return one_tilt(asked, f"the movement to {target}")

    def arriving(self, place: int) -> PlanningScene:
        """The scene in which a stop is reached."""
        return self.scenes.before(self.at(place))

    def leaving(self, place: int) -> PlanningScene:
        """The scene in which a stop is left; after the last one, the scene at the end."""
        if place + 1 == len(self.stops):
            return self.scenes.after(self.steps[-1])
        return self.scenes.before(self.at(place + 1))
