"""Statements of a written program: motions, pauses, signals, and what is taken and left."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from ir_krl.errors import KrlError
from ir_krl.run.commands import Payload
from ir_values.arrays import FloatArray

Style = Literal["spline", "kss8", "krc2", "urscript"]
STYLES: tuple[Style, ...] = ("spline", "kss8", "krc2")
"""How motions are written in KRL: PTP_SPLINE blocks, or inline forms of KSS 8.3 or the KR C2."""
URSCRIPT: Style = "urscript"
"""The style of another make: moves of a UR."""


def check_style(style: str) -> Style:
    """The style of that name. Raises KrlError."""
    for known in (*STYLES, URSCRIPT):
        if style == known:
            return known
    raise KrlError(f"style is {style[:20]!r}: known are {', '.join((*STYLES, URSCRIPT))}")


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
    [m/s] and an acceleration [m/s^2] of the tool; rails (M, 1): E1 [m] of a robot on a rail, (M, 0)
    without one.
    """

    comment: str
    poses: FloatArray
    speed: float
    acceleration: float
    rails: FloatArray


@dataclass(frozen=True, eq=False)
class WrittenMove:
    """An inline form to `pose` (4, 4) [m] of the tool in the robot's foot, with its status and
    turn, at `joints` (n,) [rad], of a robot on a rail E1 [m] first.

    straight: a line of the tool, else of the axes; velocity: [m/s], else [%]; acceleration [%];
    rounded: how far around its end it is left for the next motion, [mm] (krc2, not straight: [%]),
    0: exact. base: which of the program's bases its frame is written in, from 1 on; 0: the robot's
    foot.
    """

    comment: str
    pose: FloatArray
    status: int
    turn: int
    straight: bool
    velocity: float
    acceleration: int = 100
    rounded: float = 0.0
    joints: FloatArray = field(default_factory=lambda: np.zeros(0))
    base: int = 0


@dataclass(frozen=True)
class WrittenPause:
    """Standing for `seconds`. number: of the pause that the PLC spends in modes, 0: the program
    waits.
    """

    comment: str
    seconds: float
    number: int = 0


@dataclass(frozen=True)
class WrittenSignals:
    """Signals to wait for, then to set."""

    wait_for: tuple[tuple[str, bool], ...] = ()
    set_signals: tuple[tuple[str, bool], ...] = ()


@dataclass(frozen=True)
class WrittenHandling:
    """The gripper closes around a part or leaves it; carried: which of the program's loads is
    carried from then on.
    """

    comment: str
    closes: bool
    carried: int


WrittenStatement: TypeAlias = (
    WrittenSpline | WrittenPath | WrittenMove | WrittenPause | WrittenSignals | WrittenHandling
)


@dataclass(frozen=True, eq=False)
class Attached:
    """The tool: its frame (4, 4) in the flange [m]; loads: what is carried, first at the start;
    bases: machines with their poses (4, 4) [m] in the robot's foot, for inline forms; tool_numbers,
    base_numbers: of TOOL_DATA for each load and of BASE_DATA for each base, () where the program
    chooses.
    """

    tool: FloatArray
    loads: tuple[Payload, ...]
    bases: tuple[tuple[str, FloatArray], ...] = ()
    tool_numbers: tuple[int, ...] = ()
    base_numbers: tuple[int, ...] = ()
