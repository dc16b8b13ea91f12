"""The program of a cell: stations, postures, paths and pauses in order, with what happens at each;
and the route of its parts.

One step runs in this order: wait for the signals, move, attach or detach, set the signals, dwell. A
pause stays where the step before it ended.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from ir_description.cell.equipment import BLEND_MAX, ToolTilt
from ir_msgs_py.modes import REST_MODES
from ir_msgs_py.plc import Signal
from ir_values.arrays import in_range
from ir_values.errors import InvalidValueError, UnknownNameError

StepKind = Literal["STATION", "POSTURE", "PATH", "PAUSE"]
POSTURES = ("home", "park")
AUTO = "AUTO"
PAUSE_POWER_MODES = (AUTO, *REST_MODES)
NUMBER_MAX = 8192
"""Highest number of an output or input at a KR C4."""
PAUSE_MAX = 604_800.0
"""Longest pause or dwell [s]: a week."""
VIA_MAX = 20
"""Most places that one movement passes."""
VIA_TOLERANCE = 0.05
"""rad: how near each joint passes a place where nobody says."""
VIA_TOLERANCES = 1e-6, math.pi
"""rad"""
VIA_DISTANCE_MAX = 1.0
"""m"""
VISITS = 3, 10
"""Fewest and most stations of a route: infeed, machines, outfeed."""


@dataclass(frozen=True)
class CellSignal:
    """A signal of the cell, its value at the start, and how the machine answers.

    Where `follows` is given the signal takes its value `delay` [s] after that signal was set (the
    soft PLC's rule), e.g. the door is open 1.5 s after it was asked to. process: the machine whose
    part it reports, "" for none: it is cleared when the followed signal changes, and set when the
    process that was started by setting that is over. output, input: its numbers at the controller,
    where the robot sets it and where it reads it, 0: nobody said.
    """

    name: str
    initial: bool = False
    follows: str = ""
    delay: float = 0.0
    output: int = 0
    input: int = 0
    process: str = ""

    def __post_init__(self) -> None:
        for what in ("output", "input"):
            in_range(getattr(self, what), 0, NUMBER_MAX, "", f"{what} of {self.name}")
        in_range(self.delay, 0.0, PAUSE_MAX, "s", f"delay of {self.name}")
        if self.follows == self.name:
            raise InvalidValueError(f"signal {self.name} follows itself")
        if self.process and (not self.follows or self.delay):
            raise InvalidValueError(
                f"signal {self.name} reports the process of {self.process}: it follows the signal "
                "that starts it, and has no delay of its own"
            )


@dataclass(frozen=True)
class StepVia:
    """places: stations and postures that a movement passes in this order, without a stop where that
    is better: every joint within `tolerance` [rad] of a configuration of the place, or with
    `distance` [m] above 0 the tcp within that and its orientation within `tolerance`.
    """

    places: tuple[str, ...]
    tolerance: float = VIA_TOLERANCE
    distance: float = 0.0

    def __post_init__(self) -> None:
        in_range(len(self.places), 1, VIA_MAX, "", "number of via places")
        in_range(self.tolerance, *VIA_TOLERANCES, "rad", "via_tolerance")
        in_range(self.distance, 0.0, VIA_DISTANCE_MAX, "m", "via_distance")


@dataclass(frozen=True)
class ProgramStep:
    """One step. target: a station's name, a posture ("home", "park"), a path's name, or "" for a
    pause.

    dwell [s] after arrival, or the length of a pause. attach and detach name a part ("" for none).
    power_mode is one of PAUSE_POWER_MODES for a pause and "" otherwise; AUTO leaves the choice to
    whoever plans. planner: which search looks for the regional movement to the target, "": as the
    request says. carries: which of the cell's whole loads is carried from then on, "": as before.
    tilt: how far the tool may lean on the movement to the target, None: as it likes.
    via: what the movement to the target passes, None: nothing.
    since: the signal that a pause is for, "": it is as long as it says; else it ends as long after
    that was set as planned, so that a late machine shifts what depends on it alone.
    blend [m]: how near the program passes the target, and the outer end of its line, instead of
    standing still where nothing happens; None: as the station says.
    """

    kind: StepKind
    target: str = ""
    dwell: float = 0.0
    attach: str = ""
    detach: str = ""
    wait_for: tuple[Signal, ...] = ()
    set_signals: tuple[Signal, ...] = ()
    power_mode: str = ""
    planner: str = ""
    carries: str = ""
    tilt: ToolTilt | None = None
    since: str = ""
    via: StepVia | None = None
    blend: float | None = None

    def __post_init__(self) -> None:
        in_range(self.dwell, 0.0, PAUSE_MAX, "s", "dwell")
        if self.kind not in get_args(StepKind):
            raise UnknownNameError("kind of step", self.kind, get_args(StepKind))
        if self.kind == "POSTURE" and self.target not in POSTURES:
            raise UnknownNameError("posture", self.target, POSTURES)
        if self.kind == "PAUSE" and self.power_mode not in PAUSE_POWER_MODES:
            raise UnknownNameError("power mode", self.power_mode, PAUSE_POWER_MODES)
        if self.kind == "PAUSE" and (self.target or self.dwell <= 0.0):
            raise InvalidValueError(
                f"a pause must be longer than 0 s and has no target, it is {self.dwell:g} s long"
            )
        if self.kind != "PAUSE" and (self.power_mode or self.since):
            raise InvalidValueError("only a pause has a power mode, or ends after a signal")
        if self.kind == "PAUSE" and self.planner:
            raise InvalidValueError("a pause has no planner")
        self._check_movement()
        if self.kind != "STATION" and (self.attach or self.detach):
            raise InvalidValueError("parts are attached and detached at stations only")
        if self.attach and self.detach:
            raise InvalidValueError("a step attaches or detaches, not both")

    def _check_movement(self) -> None:
        """What is said of the movement to the target."""
        if self.kind not in ("STATION", "POSTURE") and (self.tilt or self.via):
            raise InvalidValueError("only movements to stations and postures have a tilt or a via")
        if self.blend is None:
            return
        in_range(self.blend, 0.0, BLEND_MAX, "m", "blend")
        if self.kind not in ("STATION", "POSTURE"):
            raise InvalidValueError("only stations and postures are passed with a blend")
        if self.kind == "POSTURE" and self.blend and (self.dwell or self.set_signals):
            happens = f"dwells {self.dwell:g} s" if self.dwell else "sets signals"
            raise InvalidValueError(
                f"blend is {self.blend:g} m at posture {self.target}, where the step {happens}: it "
                "must be 0 m there"
            )


@dataclass(frozen=True)
class PartPlaces:
    """Where the parts are between two steps: the held one and the station each lies at; "" is
    none. carrying: the one of the cell's whole loads that stands for tool and part, "" for none.
    route: of the parts that come and go by themselves, None for none: what is put down at its last
    station is taken away; when a part is put down elsewhere, the next one comes to its first
    station, the first by name order of the file that isn't there. rooms: by station, how many parts
    its machine holds, where those are several: what is put down there is `inside` the machine until
    it is taken, in the order in which it came.
    """

    held: str
    lying: Mapping[str, str]
    carrying: str = ""
    route: PartRoute | None = None
    rooms: Mapping[str, int] = field(default_factory=dict)
    inside: Mapping[str, str] = field(default_factory=dict)

    def at(self, station: str) -> tuple[str, ...]:
        """The parts that lie at a station or are in its machine, who came first before others."""
        waiting = tuple(part for part, where in self.inside.items() if where == station)
        return waiting or tuple(part for part, where in self.lying.items() if where == station)

    def after(self, step: ProgramStep) -> PartPlaces:
        """Return where they are after a step; a step that can't be done is refused."""
        moved = self._handled(step)
        return replace(moved, carrying=step.carries) if step.carries else moved

    def _handled(self, step: ProgramStep) -> PartPlaces:
        if step.attach:
            where = self._station_of(step.attach)
            first = self.at(where)[:1]
            if self.held:
                raise InvalidValueError(f"{step.attach} can't be attached, {self.held} is held")
            if where != step.target:
                raise InvalidValueError(
                    f"{step.attach} can't be attached at {step.target}, it lies at "
                    f"{where or 'no station'}"
                )
            if where and first != (step.attach,):
                raise InvalidValueError(
                    f"{step.attach} can't be attached at {where}: {first[0]} came before it"
                )
            return self.taken(step.attach)
        if step.detach:
            self._station_of(step.detach)
            if self.held != step.detach:
                raise InvalidValueError(
                    f"{step.detach} can't be detached, {self.held or 'no part'} is held"
                )
            there = self.at(step.target)
            if len(there) >= self.rooms.get(step.target, 1):
                names = " and ".join(there)
                raise InvalidValueError(
                    f"{step.detach} can't be detached at {step.target}, {names} "
                    f"{'lies' if len(there) == 1 else 'lie'} there"
                )
            return self.put(step.detach, step.target)
        return self

    def taken(self, part: str) -> PartPlaces:
        """Where they are with this part in the gripper."""
        inside = {name: station for name, station in self.inside.items() if name != part}
        return replace(self, held=part, lying={**self.lying, part: ""}, inside=inside)

    def put(self, part: str, station: str) -> PartPlaces:
        """Where they are when the held part was put down at a station ("": nowhere) and the route
        has taken away and brought what it does.
        """
        roomy = station in self.rooms
        inside = {**self.inside, part: station} if roomy else self.inside
        lying = {**self.lying, part: "" if roomy else station}
        return replace(self, held="", lying=self._supplied(lying, inside), inside=inside)

    def _supplied(self, lying: dict[str, str], inside: Mapping[str, str]) -> dict[str, str]:
        route = self.route
        if route is None:
            return lying
        last = route.visits[-1]
        lying = {part: "" if station == last else station for part, station in lying.items()}
        absent = (part for part, station in lying.items() if not station and part not in inside)
        following = route.following(absent)
        if following and route.visits[0] not in lying.values():
            lying[following] = route.visits[0]
        return lying

    def _station_of(self, part: str) -> str:
        if part not in self.lying:
            raise UnknownNameError("part", part, self.lying)
        return self.inside.get(part, self.lying[part])


@dataclass(frozen=True)
class PartRoute:
    """What every part goes through: `part` is brought from the first of `visits` (stations) to the
    next and so on. A machine works on it at each but the first, where the next one always lies, and
    the last, which takes it away; at a buffer it only lies. handling [s]: of the gripper, at each
    end of each transport. by_states: visits is one of the ways that the states of the part leave.
    """

    part: str
    visits: tuple[str, ...]
    handling: float = 0.0
    by_states: bool = False

    def __post_init__(self) -> None:
        in_range(len(self.visits), *VISITS, "", "number of visits")
        in_range(self.handling, 0.0, PAUSE_MAX, "s", "handling")
        for station in self.visits:
            if self.visits.count(station) > 1:
                raise InvalidValueError(
                    f"the route visits {station} twice, at most once is planned"
                )

    def copy_name(self, number: int) -> str:
        """Name of a part that is like the one of the route: itself, and copies from 1 on."""
        return self.part if number == 0 else f"{self.part}.{number}"

    def following(self, absent: Iterable[str]) -> str:
        """The part that comes to the first station next, of those that aren't in the cell, in their
        order; "" for none.
        """
        return next((p for p in absent if p == self.part or self.is_copy(p)), "")

    def is_copy(self, part: str) -> bool:
        """Whether a part is named as a copy."""
        name, _, number = part.rpartition(".")
        return name == self.part and number.isdigit()
