"""URScript, a second make: moves, speeds, blends, tool, payload and digital signals, in and out.

What a program of a UR asks for becomes the same commands as KRL's, so that driving, proving and
costing are shared; what a planned program writes are the same parts.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ir_description.poses import abc_from_rotation, pose_of
from ir_krl.errors import KrlError, KrlRunError, SourcePlace
from ir_krl.run.commands import (
    END_OF_LAST,
    Blend,
    Command,
    Kind,
    Motion,
    Payload,
    SetOutput,
    Speeds,
    StandStill,
    Target,
    WaitForCondition,
)
from ir_krl.run.notes import Effect, Note, worst_first
from ir_krl.run.program import Followed
from ir_krl.run.values import AXIS_NAMES, FRAME_NAMES
from ir_krl.write.identifiers import INPUT, OUTPUT, Numbers, Wiring, check_name
from ir_krl.write.program_text import GRIP, Texts
from ir_krl.write.statements import (
    Attached,
    WrittenHandling,
    WrittenMove,
    WrittenPause,
    WrittenSignals,
    WrittenStatement,
)
from ir_values.arrays import FloatArray

# Frames: a UR's flange is KUKA's, turned a quarter about z.

_TURNING = math.pi  # rad/s and rad/s^2 of the tool, that movel doesn't name
_TURNS = "movel doesn't say how fast the tool turns: at most 180 deg/s and 180 deg/s^2"
_OUTPUTS = ("set_standard_digital_out", "set_digital_out")
_SILENT = ("sync", "textmsg")
_NOTED = {
    "popup": ("may wait for the operator: taken as no pause", Effect.TIMES),
    "set_gravity": ("isn't followed: the cell's robot stands upright", Effect.SPEEDS),
}
_WAIT = re.compile(
    r"while\s*\(?\s*(not\s+)?get_(?:standard_)?digital_in\((\d+)\)\s*(?:==\s*(True|False))?\s*\)?:"
)


def _quarter_turned(rows: FloatArray, sign: float) -> FloatArray:
    """A pose (4, 4) or a place (3,) turned a quarter about z, from a UR's flange to KUKA's (1.0) or
    back (-1.0).
    """
    turned = np.array(rows, dtype=float)
    turned[0] = -sign * rows[1]
    turned[1] = sign * rows[0]
    return turned


@dataclass(frozen=True)
class JointLimits:
    """What a movej's speed and acceleration are shares of: (n,) [rad/s], [rad/s^2]."""

    velocity: FloatArray
    acceleration: FloatArray


def rotation_from_vector(vector: FloatArray) -> FloatArray:
    """The rotation (3, 3) about a vector (3,) by its length [rad]."""
    angle = float(np.sqrt(np.sum(vector * vector)))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    axis = np.array([x, y, z])
    squared = axis[:, None] * axis[None, :] - np.eye(3)
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * squared)


def vector_of_rotation(rotation: FloatArray) -> FloatArray:
    """The vector (3,) about which a rotation (3, 3) turns, as long as its angle [rad]."""
    cosine = float(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0))
    angle = math.acos(cosine)
    twice = np.array(
        [
            rotation[2, 1] - rotation[1, 2],
            rotation[0, 2] - rotation[2, 0],
            rotation[1, 0] - rotation[0, 1],
        ]
    )
    if math.sin(angle) > 1e-6:
        return np.asarray(angle / (2.0 * math.sin(angle)) * twice)
    if angle < 1.0:
        return np.asarray(twice / 2.0)
    axis = np.sqrt(np.maximum((np.diag(rotation) + 1.0) / 2.0, 0.0))
    k = int(axis.argmax())
    signs = np.sign(rotation[k] + rotation[:, k])
    signs[k] = 1.0
    return np.asarray(angle * axis * signs)


# Reading: statements one after the other, without branches.


def follow_urscript(text: str, file: str, tool: FloatArray, limits: JointLimits) -> Followed:
    """What a script asks for. tool (4, 4) [m] in KUKA's flange, until the script sets its tcp.
    Raises KrlError with file and line.
    """
    return _Script(text, file, tool, limits).followed()


@dataclass(frozen=True)
class _Pose:
    values: tuple[float, ...]


class _Script:
    def __init__(self, text: str, file: str, tool: FloatArray, limits: JointLimits) -> None:
        self._lines = text.replace("\r\n", "\n").splitlines()
        self._file = file
        self._tool = tool
        self._limits = limits
        self._values: dict[str, object] = {}
        self._payload: Payload | None = None
        self._commands: list[Command] = []
        self._notes: list[Note] = []
        self._has_lines = False
        self._name = "PROGRAM"
        self._calls: Mapping[str, Callable[[ast.Call, SourcePlace], None]] = {
            "movej": self._movej,
            "movel": self._movel,
            "set_tcp": self._set_tcp,
            "set_payload": self._set_payload,
            "set_target_payload": self._set_payload,
            "sleep": self._sleep,
            **dict.fromkeys(_OUTPUTS, self._output),
        }

    def followed(self) -> Followed:
        """All statements in their order."""
        waiting = False
        for number, line in enumerate(self._lines, start=1):
            text = line.split("#", 1)[0].strip()
            place = SourcePlace(self._file, number, 1)
            if not text:
                continue
            if waiting and text != "end":
                if text != "sync()":
                    raise KrlError("a while loop may only sync(): others aren't read", place)
                continue
            if match := _WAIT.fullmatch(text):
                until = bool(match[1]) or match[3] == "False"
                condition = f"{'' if until else 'NOT '}$IN[{int(match[2]) + 1}]"
                self._commands.append(WaitForCondition(condition, place))
                waiting = True
                continue
            if text == "end":
                waiting = False
                continue
            self._statement(text, place)
        return Followed(self._name, tuple(self._commands), worst_first(self._notes))

    def _statement(self, text: str, place: SourcePlace) -> None:
        """Follow one line: the program's name, a variable, or a call. KrlError for control flow,
        and for calls that may move the robot and aren't read.
        """
        if match := re.fullmatch(r"def\s+(\w+)\(\):", text):
            self._name = match[1].upper()
            return
        match = re.fullmatch(r"(?:global\s+|local\s+)?(\w+)\s*=(?!=)\s*(.+)", text)
        if match:
            self._values[match[1]] = self._value(self._parsed(match[2], place), place)
            return
        if re.match(r"(if|elif|else|while|thread|def|return|run|kill)\b", text):
            raise KrlError(
                f"{text.split()[0].rstrip(':')} isn't read: give the straight sequence of moves",
                place,
            )
        call = self._parsed(text, place)
        if not isinstance(call, ast.Call) or not isinstance(call.func, ast.Name):
            raise KrlError(f"{text[:40]!r} is no statement that is read", place)
        name = call.func.id
        if name in self._calls:
            self._calls[name](call, place)
        elif name in _SILENT:
            pass
        elif name in _NOTED:
            text, effect = _NOTED[name]
            self._notes.append(Note(place, f"{name} {text}", effect))
        elif re.match(r"(move|servo|speed|force|path|conveyor)", name):
            raise KrlError(f"{name} may move the robot and isn't read", place)
        else:
            self._notes.append(
                Note(place, f"{name} isn't known: no motion assumed", Effect.MOTIONS)
            )

    def _parsed(self, text: str, place: SourcePlace) -> ast.expr:
        try:
            return ast.parse(text, mode="eval").body
        except (SyntaxError, ValueError, RecursionError):
            raise KrlError(f"{text[:40]!r} isn't URScript", place) from None

    def _value(self, node: ast.expr, place: SourcePlace) -> object:  # noqa: PLR0911
        match node:
            case ast.Constant(value=bool() | int() | float() as value):
                return value
            case ast.Name(id=name) if name in self._values:
                return self._values[name]
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return -self._number(inner, place)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                a = self._number(left, place)
                b = self._number(right, place)
                if isinstance(op, ast.Div) and b == 0.0:
                    raise KrlRunError("division by 0", place)
                return _OPERATORS[type(op)](a, b)
            case ast.List(elts=parts):
                return tuple(self._number(one, place) for one in parts)
            case ast.Subscript(value=ast.Name(id="p"), slice=ast.Tuple(elts=parts)):
                return _Pose(tuple(self._number(one, place) for one in parts))
            case ast.Call(func=ast.Name(id="d2r"), args=[inner]):
                return math.radians(self._number(inner, place))
            case ast.Call(func=ast.Name(id="r2d"), args=[inner]):
                return math.degrees(self._number(inner, place))
        raise KrlRunError(f"{ast.unparse(node)[:40]!r} has no value here", place)

    def _number(self, node: ast.expr, place: SourcePlace) -> float:
        value = self._value(node, place)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise KrlRunError(f"{ast.unparse(node)[:40]!r} must be a number", place)
        if not math.isfinite(value):
            raise KrlRunError(f"{ast.unparse(node)[:40]!r} must be finite", place)
        return float(value)

    def _given(
        self, call: ast.Call, names: Sequence[str], place: SourcePlace
    ) -> dict[str, ast.expr]:
        given = dict(zip(names, call.args, strict=False))
        given |= {str(one.arg): one.value for one in call.keywords}
        unknown = next((name for name in given if name not in names), None)
        if unknown is not None or len(call.args) > len(names):
            raise KrlRunError(f"known arguments are {', '.join(names)}", place)
        return given

    def _move(
        self, call: ast.Call, kind: Kind, usual: tuple[float, float], place: SourcePlace
    ) -> tuple[Target, float, float, Blend | None]:
        given = self._given(call, ("q", "a", "v", "t", "r"), place)
        given |= {"q": given["pose"]} if "pose" in given else {}
        if "q" not in given:
            raise KrlRunError("a move needs its target", place)
        numbers = {
            name: self._number(given[name], place) if name in given else otherwise
            for name, otherwise in (("a", usual[0]), ("v", usual[1]), ("t", 0.0), ("r", 0.0))
        }
        if numbers["t"] != 0.0:
            raise KrlRunError("a move in a given time t isn't read: give a and v", place)
        if min(numbers["a"], numbers["v"]) <= 0.0 or numbers["r"] < 0.0:
            raise KrlRunError("a and v must be above 0, r at least 0", place)
        blend = Blend("r", numbers["r"], 1.0) if numbers["r"] > 0.0 else None
        target = self._target(self._value(given["q"], place), kind, place)
        return target, numbers["a"], numbers["v"], blend

    def _target(self, value: object, kind: Kind, place: SourcePlace) -> Target:
        count = len(AXIS_NAMES)
        common = (None, None, False, False, np.eye(4), self._tool)
        if isinstance(value, tuple) and len(value) == count and kind == "ptp":
            return Target(dict(zip(AXIS_NAMES, value, strict=True)), None, *common)
        if isinstance(value, _Pose) and len(value.values) == count:
            turn = rotation_from_vector(np.array(value.values[3:]))
            numbers = [*(1e3 * np.array(value.values[:3])), *abc_from_rotation(turn)]
            frame = {name: float(one) for name, one in zip(FRAME_NAMES, numbers, strict=True)}
            return Target(None, frame, *common)
        wanted = "six joint values or a pose p[...]" if kind == "ptp" else "a pose p[...]"
        raise KrlRunError(f"a move goes to {wanted}", place)

    def _movej(self, call: ast.Call, place: SourcePlace) -> None:
        target, a, v, blend = self._move(call, "ptp", (1.4, 1.05), place)
        speeds = Speeds(
            tuple(np.minimum(v / self._limits.velocity, 1.0).tolist()),
            tuple(np.minimum(a / self._limits.acceleration, 1.0).tolist()),
            1.0,
            1.0,
            _TURNING,
            _TURNING,
            1.0,
        )
        self._commands.append(Motion("ptp", target, speeds, place, blend, payload=self._payload))

    def _movel(self, call: ast.Call, place: SourcePlace) -> None:
        target, a, v, blend = self._move(call, "lin", (1.2, 0.25), place)
        if not self._has_lines:
            self._notes.append(Note(place, _TURNS, Effect.SPEEDS))
        self._has_lines = True
        full = (1.0,) * len(AXIS_NAMES)
        speeds = Speeds(full, full, v, a, _TURNING, _TURNING, 1.0)
        self._commands.append(Motion("lin", target, speeds, place, blend, payload=self._payload))

    def _set_tcp(self, call: ast.Call, place: SourcePlace) -> None:
        value = self._value(call.args[0], place) if call.args else None
        if not isinstance(value, _Pose) or len(value.values) != 6:
            raise KrlRunError("set_tcp takes a pose p[...]", place)
        turn = rotation_from_vector(np.array(value.values[3:]))
        self._tool = _quarter_turned(pose_of(value.values[:3], turn), 1.0)

    def _set_payload(self, call: ast.Call, place: SourcePlace) -> None:
        """The load that the robot carries from here on: mass [kg], centre [m], moments [kg m^2]."""
        given = self._given(call, ("m", "cog", "inertia"), place)
        if "m" not in given:
            raise KrlRunError("a payload needs its mass", place)
        centre = self._value(given["cog"], place) if "cog" in given else (0.0, 0.0, 0.0)
        moments = self._value(given["inertia"], place) if "inertia" in given else (0.0,) * 6
        if not isinstance(centre, tuple) or not isinstance(moments, tuple):
            raise KrlRunError("cog and inertia are lists of numbers", place)
        if len(centre) != 3 or len(moments) != 6 or any(moments[3:]):
            raise KrlRunError("cog has 3 numbers, inertia 6, of which products must be 0", place)
        # from a UR's flange to KUKA's
        x, y, z = _quarter_turned(np.array(centre), 1.0)
        about = (float(moments[0]), float(moments[1]), float(moments[2]))
        mass = self._number(given["m"], place)
        turned = (90.0, 0.0, 0.0)
        self._payload = Payload(mass, (float(x), float(y), float(z)), turned, about)

    def _sleep(self, call: ast.Call, place: SourcePlace) -> None:
        seconds = self._number(call.args[0], place) if call.args else 0.0
        if not 0.0 <= seconds <= 604_800.0:
            raise KrlRunError(f"sleep({seconds:g}): it must be in 0 .. 604800 s", place)
        if seconds > 0.0:
            self._commands.append(StandStill(seconds, place))

    def _output(self, call: ast.Call, place: SourcePlace) -> None:
        values = [self._value(one, place) for one in call.args]
        if len(values) != 2 or not isinstance(values[1], bool):
            raise KrlRunError("an output takes its number and True or False", place)
        number = self._number(call.args[0], place)
        last = next(
            (one for one in reversed(self._commands) if not isinstance(one, SetOutput)), None
        )
        rounding = isinstance(last, Motion) and last.blend is not None
        switch = END_OF_LAST if rounding else None  # a UR sets it in the blend, without a stop
        output = SetOutput(int(number) + 1, values[1], place, on_path=rounding, switch=switch)
        self._commands.append(output)


_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
}


# Writing: the parts of a planned program.


@dataclass
class _Writer:
    attached: Attached
    limits: JointLimits
    wiring: Wiring
    lines: list[str] = field(default_factory=list)

    def add(self, part: WrittenStatement) -> None:
        """Append the lines of a part. Raises KrlError for one that a UR hasn't."""
        match part:
            case WrittenMove():
                self.lines += [f"# {part.comment}"] if part.comment else []
                self.lines.append(self._move(part))
            case WrittenPause(number=0):
                self.lines += [f"# {part.comment}", f"sleep({part.seconds:.4f})"]
            case WrittenHandling():
                self.wiring.output(GRIP)
                self.lines += [f"# {part.comment}", self._output(GRIP, part.closes)]
                self.lines.append(payload_line(self.attached.loads[part.carried]))
            case WrittenSignals():
                for name, on in part.wait_for:
                    self.wiring.input(name)
                    n = self.wiring.number(INPUT, name) - 1
                    wanted = "False" if on else "True"
                    self.lines += [
                        f"while get_standard_digital_in({n}) == {wanted}:",
                        "  sync()",
                        "end",
                    ]
                for name, on in part.set_signals:
                    self.wiring.output(name)
                    self.lines.append(self._output(name, on))
            case _:
                raise KrlError("URScript has moves and waits only: no splines, no power modes")

    def _output(self, name: str, on: bool) -> str:
        return f"set_standard_digital_out({self.wiring.number(OUTPUT, name) - 1}, {on})"

    def _move(self, part: WrittenMove) -> str:
        blend = f", r={1e-3 * part.rounded:.4f}" if part.rounded else ""
        if part.straight:
            acceleration = 1.2 * part.acceleration / 100.0
            return f"movel({_pose(part.pose)}, a={acceleration:.4f}, v={part.velocity:.4f}{blend})"
        joints = ", ".join(f"{one:.9f}" for one in part.joints)
        top = float(self.limits.velocity.max()) * part.velocity / 100.0
        gain = float(self.limits.acceleration.max()) * part.acceleration / 100.0
        return f"movej([{joints}], a={gain:.4f}, v={top:.4f}{blend})"


def payload_line(load: Payload) -> str:
    """What is carried; its products of inertia are left out."""
    x, y, z = _quarter_turned(np.array(load.centre), -1.0)
    return f"set_payload({load.mass:.4f}, [{x:.6f}, {y:.6f}, {z:.6f}])"


def written_urscript(
    name: str,
    start: FloatArray,
    parts: Sequence[WrittenStatement],
    attached: Attached,
    header: Callable[[Texts], Sequence[str]] | Sequence[str],
    limits: JointLimits,
    numbers: Numbers | None = None,
) -> Texts:
    """The script of a program from `start` (n,) [rad] through the parts; its data list is empty.
    Raises KrlError.
    """
    check_name(name)
    writer = _Writer(attached, limits, Wiring(name, numbers or Numbers()))
    for part in parts:
        writer.add(part)
    first = ", ".join(f"{one:.9f}" for one in start)

    def texts(lines: Sequence[str]) -> Texts:
        tcp = _quarter_turned(attached.tool, -1.0)
        body = [
            f"set_tcp({_pose(tcp)})",
            payload_line(attached.loads[0]),
            "# to the start, slowly: nobody proved this way",
            f"movej([{first}], a=0.5, v=0.2)",
            *writer.lines,
        ]
        source = [*(f"# {line}" for line in lines), f"def {name}():", *(f"  {b}" for b in body)]
        assumed = tuple(_digital(one) for one in writer.wiring.assumed)
        return Texts("\n".join([*source, "end"]) + "\n", "", assumed, {}, ())

    return texts(header(texts([])) if callable(header) else header)


def _digital(assumed: str) -> str:
    """A signal that the program numbers, as a UR counts them: from 0."""
    name, kind, number = re.fullmatch(r"(\w+) \$(\w+)\[(\d+)\]", assumed).groups()  # type: ignore[union-attr]
    return f"{name} standard digital {kind.lower()} {int(number) - 1}"


def _pose(pose: FloatArray) -> str:
    numbers = [*pose[:3, 3], *vector_of_rotation(pose[:3, :3])]
    return f"p[{', '.join(f'{one:.9f}' for one in numbers)}]"
