"""Texts of a program: .src and .dat, with the names that a controller takes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ir_krl.errors import KrlError
from ir_krl.run.values import AXIS_NAMES, frame
from ir_msgs_py.arrays import FloatArray

# Names as the controller takes them: letters, digits and _, at most 24 characters, no word of
# KRL.

NAME_MAX = 24
_NAME = re.compile(rf"[A-Za-z][A-Za-z0-9_]{{0,{NAME_MAX - 1}}}")
_OWN = re.compile(
    r"XHOME|XSTART|XM\d+_\d+|IR_TOOL|IR_LOAD"
)  # what a written program calls its variables
_WORDS = """
ANIN ANOUT AND AXIS BOOL BRAKE B_AND B_EXOR B_NOT B_OR CASE CAST_FROM CAST_TO CHANNEL CHAR CIRC
CIRC_REL CONFIRM CONST CONST_VEL CONTINUE CCLOSE COPEN CREAD CWRITE C_DIS C_ORI C_PTP C_SPL C_VEL
DECL DEF DEFAULT DEFDAT DEFFCT DELAY DISTANCE DO E6AXIS E6POS ELSE END ENDDAT ENDFCT ENDFOR ENDIF
ENDLOOP ENDSPLINE ENDSWITCH ENDWHILE ENUM EXIT EXOR EXT EXTFCT FALSE FOR FRAME GLOBAL GOTO HALT IF
IMPORT INT INTERRUPT IS LIN LIN_REL LOAD LOOP MAXIMUM MINIMUM NOT OFF ON OR PATH POS PRIO PTP
PTP_REL PTP_SPLINE PUBLIC PULSE REAL REPEAT RESUME RETURN SCIRC SEC SIGNAL SLIN SLIN_REL SPL SPLINE
SPTP START STEP STOP STRUC SWITCH THEN TIME_BLOCK TO TRIGGER TRUE UNTIL WAIT WHEN WHILE WITH
"""
KEYWORDS = frozenset(_WORDS.split())


def check_name(name: str) -> None:
    """Raise KrlError for the name of a program that the controller doesn't take."""
    if not _NAME.fullmatch(name):
        raise KrlError(
            f"the program's name is {name[:40]!r}: a letter, then letters, digits and _, "
            f"at most {NAME_MAX} characters"
        )
    if name.upper() in KEYWORDS:
        raise KrlError(f"the program's name is {name!r}, a word of KRL")


class SignalNames:
    """The names of a cell's signals in one program: as they are where the controller takes them."""

    def __init__(self, program: str) -> None:
        self._taken = {program.upper()}
        self._known: dict[str, str] = {}

    def of(self, signal: str) -> str:
        """The same for the same signal, without regard to its case; another one for every other."""
        key = signal.upper()
        if key not in self._known:
            self._known[key] = self._new(re.sub(r"[^A-Z0-9_]", "_", key))
            self._taken.add(self._known[key])
        return self._known[key]

    def _new(self, name: str) -> str:
        if not _NAME.fullmatch(name[:NAME_MAX]) or name in KEYWORDS or _OWN.fullmatch(name):
            name = f"S_{name}"
        found = name[:NAME_MAX]
        k = 1
        while found in self._taken:
            k += 1
            ending = f"_{k}"
            found = name[: NAME_MAX - len(ending)] + ending
        return found


# Texts of a program: .src and .dat, as a programmer of the controller writes them.


@dataclass(frozen=True, eq=False)
class WrittenSpline:
    """A PTP_SPLINE: points (M, 6) [rad] after the start, the share [%] of `seconds` of each
    (M,).
    """

    comment: str
    points: FloatArray
    shares: FloatArray
    seconds: float


@dataclass(frozen=True, eq=False)
class WrittenPath:
    """A SPLINE of the tool: poses (M, 4, 4) [m] in the robot's foot after the start, at a speed
    [m/s] and an acceleration [m/s^2] of the tool.
    """

    comment: str
    poses: FloatArray
    speed: float
    acceleration: float


@dataclass(frozen=True)
class WrittenPause:
    """Standing for `seconds`; `ask`: the signal that asks for a power mode, "" for none."""

    comment: str
    seconds: float
    ask: str = ""


@dataclass(frozen=True)
class WrittenSignals:
    """Signals to wait for, then to set."""

    wait_for: tuple[tuple[str, bool], ...] = ()
    set_signals: tuple[tuple[str, bool], ...] = ()


Part: TypeAlias = WrittenSpline | WrittenPath | WrittenPause | WrittenSignals


@dataclass(frozen=True, eq=False)
class Attached:
    """The tool: its frame (4, 4) in the flange [m], mass [kg], centre of mass (3,) [m] in the
    flange, inertia (3,) about it [kg m^2].
    """

    tool: FloatArray
    mass: float
    centre: FloatArray
    inertia: FloatArray


AWAKE = "AWAKE"
"""The signal by which the PLC says that the controller is back."""


def written(
    name: str,
    start: FloatArray,
    parts: Sequence[Part],
    attached: Attached,
    header: Sequence[str],
    *,
    from_home: bool = False,
) -> tuple[str, str]:
    """Texts of NAME.src and NAME.dat: from `start` (6,) [rad], from_home: which is XHOME, through
    the parts.

    Tool and load are variables of the program: a data list may not give values to those of
    $CONFIG.DAT, and the controller's own tools stay as they are. Raises KrlError for a name that
    the controller doesn't take.
    """
    check_name(name)
    body = _Body(name)
    first = "XHOME" if from_home else "XSTART"
    for part in parts:
        body.add(part)
    src = [
        "&ACCESS RVP",
        "&REL 1",
        f"DEF {name}( )",
        *(f"; {line}" for line in header),
        ";FOLD INI",
        "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM( )",
        "INTERRUPT ON 3",
        "BAS(#INITMOV,0)",
        "BAS(#VEL_PTP,100)",
        "BAS(#ACC_PTP,100)",
        "$BASE=$NULLFRAME",
        "$TOOL=IR_TOOL",
        "$LOAD=IR_LOAD",
        ";ENDFOLD (INI)",
        f"PTP {first}",
        *body.lines,
        "END",
    ]
    dat = [
        "&ACCESS RVP",
        "&REL 1",
        f"DEFDAT {name} PUBLIC",
        "EXT BAS(BAS_COMMAND :IN,REAL :IN)",
        _load(attached),
        _tool(attached),
        *body.signals(),
        f"DECL E6AXIS {first}={_axes(start)}",
        *body.points,
        "ENDDAT",
    ]
    return "\n".join(src) + "\n", "\n".join(dat) + "\n"


class _Body:
    """Lines of the routine, and what the data list must hold for them."""

    def __init__(self, program: str) -> None:
        self._names = SignalNames(program)
        self.lines: list[str] = []
        self.points: list[str] = []
        self._outputs: dict[str, int] = {}
        self._inputs: dict[str, int] = {}
        self._movements = 0

    def add(self, part: Part) -> None:
        """Append the lines of a part."""
        match part:
            case WrittenSpline():
                self._spline(part)
            case WrittenPath():
                self._path(part)
            case WrittenPause():
                self._pause(part)
            case WrittenSignals():
                self.lines += [
                    f"WAIT FOR {'' if on else 'NOT '}{self._input(name)}"
                    for name, on in part.wait_for
                ]
                self.lines += [
                    f"{self._output(name)}={_truth(on)}" for name, on in part.set_signals
                ]

    def signals(self) -> list[str]:
        """SIGNAL declarations: the numbers are to be adapted to the inputs and outputs of the
        cell.
        """
        return [
            *(f"SIGNAL {name} $OUT[{n}]" for name, n in self._outputs.items()),
            *(f"SIGNAL {name} $IN[{n}]" for name, n in self._inputs.items()),
        ]

    def _spline(self, part: WrittenSpline) -> None:
        self._movements += 1
        names = [f"XM{self._movements}_{k + 1}" for k in range(len(part.points))]
        self.points += [
            f"DECL E6AXIS {name}={_axes(q)}" for name, q in zip(names, part.points, strict=True)
        ]
        self.lines += [f"; {part.comment}", "PTP_SPLINE", "TIME_BLOCK START"]
        for name, share in zip(names[:-1], part.shares, strict=False):
            self.lines += [f"SPTP {name}", f"TIME_BLOCK PART={share:.9f}"]
        self.lines += [f"SPTP {names[-1]}", f"TIME_BLOCK END={part.seconds:.6f}", "ENDSPLINE"]

    def _path(self, part: WrittenPath) -> None:
        self._movements += 1
        names = [f"XM{self._movements}_{k + 1}" for k in range(len(part.poses))]
        self.points += [
            f"DECL E6POS {n}={_pose(pose)}" for n, pose in zip(names, part.poses, strict=True)
        ]
        self.lines += [
            f"; {part.comment}",
            f"$VEL.CP={part.speed:.6f}",
            f"$ACC.CP={part.acceleration:.6f}",
            "SPLINE",
            *(f"SPL {name}" for name in names),
            "ENDSPLINE",
        ]

    def _pause(self, part: WrittenPause) -> None:
        self.lines.append(f"; {part.comment}")
        if part.ask:
            self.lines.append(f"{self._output(part.ask)}=TRUE")
        self.lines.append(f"WAIT SEC {part.seconds:.3f}")
        if part.ask:
            self.lines += [f"{self._output(part.ask)}=FALSE", f"WAIT FOR {self._input(AWAKE)}"]

    def _output(self, name: str) -> str:
        called = self._names.of(name)
        self._outputs.setdefault(called, len(self._outputs) + 1)
        return called

    def _input(self, name: str) -> str:
        called = self._names.of(name)
        self._inputs.setdefault(called, len(self._inputs) + 1)
        return called


def _truth(on: bool) -> str:
    return "TRUE" if on else "FALSE"


def _axes(q: FloatArray) -> str:
    return (
        "{"
        + ",".join(
            f"{name} {angle:.7f}" for name, angle in zip(AXIS_NAMES, np.degrees(q), strict=True)
        )
        + "}"
    )


def _pose(pose: FloatArray) -> str:
    fields = frame(pose).fields
    return "{" + ",".join(f"{name} {value:.7f}" for name, value in fields.items()) + "}"


def _tool(attached: Attached) -> str:
    fields = frame(attached.tool).fields
    return (
        "DECL FRAME IR_TOOL={"
        + ",".join(f"{name} {value:.4f}" for name, value in fields.items())
        + "}"
    )


def _load(attached: Attached) -> str:
    x, y, z = 1e3 * attached.centre
    jx, jy, jz = attached.inertia
    return (
        f"DECL LOAD IR_LOAD={{M {attached.mass:.3f},CM {{X {x:.2f},Y {y:.2f},Z {z:.2f},A 0,B 0,C "
        f"0}},J {{X {jx:.3f},Y {jy:.3f},Z {jz:.3f}}}}}"
    )
