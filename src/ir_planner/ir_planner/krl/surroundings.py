"""What a program moves among: the parts that it takes and leaves, the doors, the load that it
names.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ir_description import Cell, InvalidValueError, Load, PartPlaces, ProgramStep
from ir_description.poses import abc_from_rotation, rotation_from_abc
from ir_kernels import portable
from ir_krl import KrlMotionError, SourcePlace
from ir_krl.run import Effect, Note, Payload, SignalRange
from ir_krl.write import GRIP
from ir_msgs_py.plc import Signal
from ir_planner.krl.geometry import tool_in_flange
from ir_planner.program import Doors, Scenes, doors_along
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

# Loads as KRL gives them, in KUKA's flange: mass, centre, and the axes of inertia.

_TINY = 1e-6  # kg, kg m^2: what carries nothing still needs a mass
LOAD_NAME = "$LOAD"
"""Of a load that a program gives by $LOAD."""
_SAME = 0.005  # share of the mass, and kg, m: two loads that are the same but for rounding


def payload_of(loads: tuple[Load, ...]) -> Payload:
    """What is attached as one load."""
    mass = sum(load.mass for load in loads)
    if not loads or mass <= 0.0:
        return Payload(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    com = sum((load.mass * load.com for load in loads), np.zeros(3)) / mass
    inertia = sum((load.inertia + _about(load.mass, load.com - com) for load in loads), np.zeros(3))
    turn = tool_in_flange(np.eye(4))[:3, :3]
    moments, axes = principal_axes(portable.matmul(turn, inertia, turn.T))
    centre = portable.matmul(turn, com)
    return Payload(mass, _three(centre), _three(abc_from_rotation(axes)), _three(moments))


def _about(mass: float, away: FloatArray) -> FloatArray:
    """Inertia (3, 3) of a mass point at `away` (3,)."""
    return np.asarray(mass * (np.eye(3) * np.sum(away * away) - away[:, None] * away[None, :]))


def _three(values: FloatArray) -> tuple[float, float, float]:
    a, b, c = (float(value) for value in values)
    return a, b, c


def same_payload(a: Payload, b: Payload) -> bool:
    """Whether two loads are the same but for rounding."""
    apart = max(abs(x - y) for x, y in zip(a.centre, b.centre, strict=True))
    light = max(a.mass, b.mass) <= _SAME
    return abs(a.mass - b.mass) <= _SAME * max(a.mass, b.mass, 1.0) and (light or apart <= _SAME)


def is_named(load: Load) -> bool:
    """Whether a load is what a program's $LOAD says."""
    return load.name == LOAD_NAME


def whole_load(loads: tuple[Load, ...], place: SourcePlace) -> Load:
    """Loads as one, with their shapes and watts."""
    if len(loads) == 1:
        return loads[0]
    (one,) = loads_with(payload_of(loads), loads, place)
    return one


def loads_with(payload: Payload, loads: tuple[Load, ...], place: SourcePlace) -> tuple[Load, ...]:
    """The loads of the cell with the mass, centre and inertia that a program gives them; their
    shapes and watts stay. Raises KrlMotionError for an inertia that no body has.
    """
    back = tool_in_flange(np.eye(4))[:3, :3].T
    if min(payload.inertia) < 0.0:
        j = ", ".join(f"{n} {value:g}" for n, value in zip("XYZ", payload.inertia, strict=True))
        raise KrlMotionError(f"$LOAD: J is {j} kg m^2, none may be below 0", place)
    axes = portable.matmul(back, rotation_from_abc(payload.angles))
    moments = np.maximum(np.array(payload.inertia), _TINY)
    inertia = portable.matmul(axes, np.diag(moments), axes.T)
    try:
        one = Load(
            LOAD_NAME,
            "tool",
            max(payload.mass, _TINY),
            portable.matmul(back, np.array(payload.centre)),
            (inertia + inertia.T) / 2.0,
            tuple(capsule for load in loads for capsule in load.capsules),
            sum(load.watts_always for load in loads),
            sum(load.watts_drive_bus for load in loads),
        )
    except InvalidValueError as error:
        raise KrlMotionError(f"$LOAD: {error}", place) from error
    return (one,)


# Which signals of the cell a program's outputs and inputs are: by the cell's numbers, else by the
# names that the program's SIGNAL declarations give them.

_WAITED = re.compile(r"^(NOT\s+)?\(*(?:\$IN\[\s*(\d+)\s*\]|([A-Z_]\w*))\)*$")


@dataclass(frozen=True)
class Wires:
    """Names of the cell's signals by the numbers of outputs and inputs; grip: the output that
    closes the gripper, 0: none.
    """

    outputs: Mapping[int, str]
    inputs: Mapping[int, str]
    grip: int
    named: Mapping[str, SignalRange]

    def awaited(self, condition: str) -> list[Signal]:
        """Signals of the cell that a condition waits for, those that can be told from its text."""
        found = []
        for text in condition.upper().split(" AND "):
            match = _WAITED.match(text.strip())
            if match is None:
                continue
            known = self.named.get(match[3] or "")
            number = int(match[2]) if match[2] else known.first if known else 0
            if number in self.inputs:
                found.append(Signal(self.inputs[number], not match[1]))
        return found


def wires_of(cell: Cell, named: Mapping[str, SignalRange]) -> Wires:
    """The wires of a program in a cell."""
    outputs: dict[int, str] = {}
    inputs: dict[int, str] = {}
    grip = 0
    for signal in cell.signals:
        for kind, given, found in (("$OUT", signal.output, outputs), ("$IN", signal.input, inputs)):
            number = given or _declared(signal.name, kind, named)
            if number:
                found[number] = signal.name
            if number and kind == "$OUT" and signal.name.upper() == GRIP:
                grip = number
    return Wires(outputs, inputs, grip or _declared(GRIP, "$OUT", named), named)


def _declared(name: str, kind: str, named: Mapping[str, SignalRange]) -> int:
    plain = re.sub(r"[^A-Z0-9_]", "_", name.upper())
    found = next((named[one] for one in (plain, f"S_{plain}") if one in named), None)
    return found.first if found is not None and found.kind == kind else 0


@dataclass
class Surroundings:
    """The scene that a program moves in, as its outputs, waits and $LOAD change it.

    scenes: of the cell's parts and doors; station_at: which station the tool stands at. fixed: a
    scene that holds all along, whatever the gripper does.
    """

    scenes: Scenes
    wires: Wires
    station_at: Callable[[PlanningScene, FloatArray], str]
    places: PartPlaces
    doors: Doors = ()
    fixed: PlanningScene | None = None
    notes: list[Note] = field(default_factory=list)
    _with_load: dict[tuple[int, Payload], PlanningScene] = field(default_factory=dict)

    def scene(self, payload: Payload | None, place: SourcePlace) -> PlanningScene:
        """The scene of a motion with this $LOAD."""
        scene = self.fixed or self.scenes.of(self.places, self.doors)
        if payload is None or payload.mass < 0.0:
            return scene
        if same_payload(payload, payload_of(scene.loads)):
            return scene
        key = (id(scene), payload)
        if key not in self._with_load:
            loads = loads_with(payload, scene.loads, place)
            self._with_load[key] = replace(scene, loads=loads)
            held = f"{scene.load_text} of {sum(load.mass for load in scene.loads):.6g} kg"
            self.notes.append(
                Note(
                    place,
                    f"$LOAD says {payload.mass:.6g} kg, the cell {held}: driven and costed with "
                    "what $LOAD says",
                )
            )
        return self._with_load[key]

    def awaited(self, condition: str) -> tuple[Signal, ...]:
        """The program has waited for a condition; signals of the cell in it."""
        signals = tuple(self.wires.awaited(condition))
        self._next(ProgramStep("POSTURE", "home", wait_for=signals))
        return signals

    def stood(self, seconds: float) -> None:
        """The robot has stood."""
        self._next(ProgramStep("POSTURE", "home", dwell=seconds))

    def signalled(self, number: int, value: bool) -> tuple[Signal, ...]:
        """An output is set; the signal of the cell that it is."""
        if number not in self.wires.outputs:
            return ()
        signals = (Signal(self.wires.outputs[number], value),)
        self._next(ProgramStep("POSTURE", "home", set_signals=signals))
        return signals

    def gripped(self, number: int, value: bool, q: FloatArray, place: SourcePlace) -> str:
        """An output is set where the robot stands at q (n,); the part that the gripper takes or
        leaves, with "+" or "-", "" for none.
        """
        if number != self.wires.grip or self.fixed is not None:
            return ""
        station = self.station_at(self.scenes.of(self.places, self.doors), q)
        return self._taken(station, place) if value else self._left(station, place)

    def grips(self, number: int) -> bool:
        """Whether an output closes the gripper."""
        return number == self.wires.grip and number != 0

    def acts_later(self, number: int, value: bool, q: FloatArray, end: FloatArray) -> bool:
        """Whether the gripper is told at q (n,) to take or to leave a part at the station where the
        motion ends, at `end` (n,).
        """
        if not self.grips(number) or self.fixed is not None:
            return False
        scene = self.scenes.of(self.places, self.doors)
        there = self.station_at(scene, end)
        if not there or self.station_at(scene, q):
            return False
        lies = there in self.places.lying.values()
        return lies and not self.places.held if value else bool(self.places.held)

    def _taken(self, station: str, place: SourcePlace) -> str:
        lying = [part for part, at in self.places.lying.items() if station and at == station]
        if self.places.held or not lying:
            return ""
        self.places = self.places.after(ProgramStep("STATION", station, attach=lying[0]))
        return f"+{lying[0]}"

    def _left(self, station: str, place: SourcePlace) -> str:
        held = self.places.held
        if not held:
            return ""
        if not station:
            self.places = PartPlaces("", {**self.places.lying, held: ""})
            text = f"{held} is left where no station is: taken as gone from the cell"
            self.notes.append(Note(place, text, Effect.PLACES))
            return f"-{held}"
        try:
            self.places = self.places.after(ProgramStep("STATION", station, detach=held))
        except InvalidValueError as error:
            raise KrlMotionError(str(error), place) from error
        return f"-{held}"

    def _next(self, step: ProgramStep) -> None:
        ((_, self.doors),) = doors_along(self.scenes.cell, [step], self.doors)


def nothing_around(scene: PlanningScene) -> Surroundings:
    """A scene that nothing changes."""
    scenes = Scenes(scene.cell, scene.power, scene.drives)
    wires = Wires({}, {}, 0, {})
    return Surroundings(scenes, wires, lambda _scene, _q: "", PartPlaces("", {}), fixed=scene)


# Principal axes of an inertia, the same bits on every machine.

_SWEEPS = 30
_NONE = 1e-9  # of the trace: what is below is no product of inertia


def principal_axes(inertia: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Moments (3,) about the axes [kg m^2], and the axes (3, 3) as columns of a rotation, of a
    symmetric inertia (3, 3), by Jacobi's rotations.
    """
    a = np.array(inertia, dtype=float)
    axes = np.eye(3)
    small = _NONE * abs(float(np.trace(a)))
    pairs = ((0, 1), (0, 2), (1, 2))
    for _ in range(_SWEEPS):
        # the largest entry beside the diagonal is turned to 0
        beside = [abs(a[pair]) for pair in pairs]
        i, j = pairs[int(np.argmax(beside))]
        if abs(a[i, j]) <= small:
            break
        theta = (a[j, j] - a[i, i]) / (2.0 * a[i, j])
        smaller_root = np.copysign(1.0, theta) / (abs(theta) + np.sqrt(theta * theta + 1.0))
        tangent = float(smaller_root)
        cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
        turn = np.eye(3)
        turn[i, i] = cosine
        turn[j, j] = cosine
        turn[i, j] = cosine * tangent
        turn[j, i] = -cosine * tangent
        a = portable.matmul(turn.T, a, turn)
        axes = portable.matmul(axes, turn)
    return np.diag(a).copy(), axes
