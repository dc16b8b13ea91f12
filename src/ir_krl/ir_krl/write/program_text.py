"""Texts of a program: .src and .dat, as a programmer of the controller writes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ir_description.poses import inverse
from ir_kernels import portable
from ir_krl.errors import KrlError
from ir_krl.run.commands import Payload
from ir_krl.run.system import axis_fields
from ir_krl.run.values import FRAME_NAMES, RAIL_NAME
from ir_krl.write.forms import Forms, decimal, frame_text
from ir_krl.write.identifiers import INPUT, OUTPUT, WIDTHS, Numbers, Wiring, check_name
from ir_krl.write.numbering import BASES_MAX, TOOL_HIGHEST
from ir_krl.write.statements import (
    Attached,
    Style,
    WrittenHandling,
    WrittenMove,
    WrittenPath,
    WrittenPause,
    WrittenSignals,
    WrittenSpline,
    WrittenStatement,
)
from ir_values.arrays import FloatArray

GRIP = "GRIP"
"""The output that closes the gripper."""
PLC_PAUSE = "IR_PAUSE"
"""Outputs that hold the number of the pause that the PLC is to spend in power modes, 0: none."""
PLC_THERE = "IR_PLC"
"""The input that says that the PLC spends pauses, in EXT."""
PLC_DONE = "IR_DONE"
"""The input that says that a pause is over and the drives are ready."""
_OWN_SIGNALS = {
    GRIP: "the gripper's, which closes where a part is attached and opens where it is detached",
    PLC_PAUSE: "the number of the pause",
    PLC_THERE: "the PLC's",
    PLC_DONE: "the PLC's",
}
START_SPEED = 10
"""% of the axes' speed, on the way from wherever the robot stands."""


def check_signal(name: str) -> None:
    """Raise KrlError for a signal that a written program uses by itself."""
    if name.upper() in _OWN_SIGNALS:
        raise KrlError(
            f"a step sets or awaits the signal {name}, which in a written program is "
            f"{_OWN_SIGNALS[name.upper()]}: give the cell's signal another name"
        )


@dataclass(frozen=True)
class Texts:
    """NAME.src and NAME.dat; assumed: signals whose numbers nobody gave; numbers: of the signals
    between program and PLC; tools: numbers of TOOL_DATA that the program sets; bases: of BASE_DATA,
    by machine.
    """

    source: str
    data: str
    assumed: tuple[str, ...]
    numbers: Mapping[str, int]
    tools: tuple[int, ...]
    bases: Mapping[str, int] = field(default_factory=dict)


def written(
    name: str,
    start: FloatArray,
    parts: Sequence[WrittenStatement],
    attached: Attached,
    header: Callable[[Texts], Sequence[str]] | Sequence[str],
    *,
    from_home: bool = False,
    numbers: Numbers | None = None,
    style: Style = "spline",
) -> Texts:
    """Texts of NAME.src and NAME.dat: from `start` (6,) [rad], from_home: which is XHOME, through
    the parts. header: lines of comment, or what makes them of the texts without.

    Tool and loads are variables of the program: a data list may not give values to those of
    $CONFIG.DAT. Raises KrlError for a name that the controller doesn't take.
    """
    check_name(name)
    body = _Body(name, numbers or Numbers(), attached, style)
    for part in parts:
        body.add(part)
    first = "XHOME" if from_home else "XSTART"

    def texts(lines: Sequence[str]) -> Texts:
        source = [*_head(name, lines), *_begin(body, first), *body.lines, "END"]
        data = [*_data_head(name), *body.data(), f"DECL E6AXIS {first}={_axes(start)}"]
        return Texts(
            "\n".join(source) + "\n",
            "\n".join([*data, *body.points, "ENDDAT"]) + "\n",
            tuple(body.wiring.assumed),
            body.plc_numbers(),
            tuple(body.tools()),
            body.bases(),
        )

    return texts(header(texts([])) if callable(header) else header)


def _head(name: str, lines: Sequence[str]) -> list[str]:
    comment = [f"; {line}".rstrip() for line in lines]
    return ["&ACCESS RVP", "&REL 1", "&PARAM EDITMASK = *", f"DEF {name}( )", *comment]


def _begin(body: _Body, first: str) -> list[str]:
    return [
        ";FOLD INI;%{PE}",
        "  ;FOLD BASISTECH INI",
        "    GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
        "    INTERRUPT ON 3",
        "    BAS (#INITMOV,0 )",
        "  ;ENDFOLD (BASISTECH INI)",
        "  ;FOLD USER INI",
        *(f"    {line}" for line in body.initial()),
        "  ;ENDFOLD (USER INI)",
        ";ENDFOLD (INI)",
        f";FOLD start: from wherever the robot stands to {first} at {START_SPEED} % of the axes' "
        "speed: nobody proved this way",
        f"BAS (#VEL_PTP,{START_SPEED} )",
        "BAS (#ACC_PTP,100 )",
        f"PTP {first}",
        "BAS (#VEL_PTP,100 )",
        ";ENDFOLD",
    ]


def _data_head(name: str) -> list[str]:
    return [
        "&ACCESS RVP",
        "&REL 1",
        f"DEFDAT {name} PUBLIC",
        ";FOLD EXTERNAL DECLARATIONS;%{PE}%MKUKATPBASIS,%CEXT,%VCOMMON,%P",
        ";FOLD BASISTECH EXT;%{PE}%MKUKATPBASIS,%CEXT,%VEXT,%P",
        "EXT BAS (BAS_COMMAND :IN,REAL :IN )",
        "DECL INT SUCCESS",
        ";ENDFOLD (BASISTECH EXT)",
        ";ENDFOLD (EXTERNAL DECLARATIONS)",
    ]


class _Body:
    """Lines of the routine, and what the data list must hold for them."""

    def __init__(self, program: str, numbers: Numbers, attached: Attached, style: Style) -> None:
        self.wiring = Wiring(program, numbers)
        self.lines: list[str] = []
        self.points: list[str] = []
        self._attached = attached
        self._forms = None if style == "spline" else Forms(style, self.lines, self.points)
        self._carried = 0
        self._movements = 0
        self._rests = False
        self._grips = False

    def add(self, part: WrittenStatement) -> None:
        """Append the lines of a part."""
        match part:
            case WrittenSpline():
                self._spline(part)
            case WrittenPath():
                self._path(part)
            case WrittenMove():
                assert self._forms is not None  # of another style
                self._forms.move(
                    self._in_base(part),
                    self._tool_number(self._carried),
                    self._base_number(part.base),
                )
            case WrittenPause():
                self._pause(part)
            case WrittenHandling():
                self._grips = True
                self.lines += [f"; {part.comment}", f"{self._grip()}={_truth(part.closes)}"]
                self._carried = part.carried
                self.lines.append(f"$LOAD={_load_name(part.carried)}")
            case WrittenSignals():
                self.lines += [
                    f"WAIT FOR {'' if on else 'NOT '}{self.wiring.input(name)}"
                    for name, on in part.wait_for
                ]
                self.lines += [
                    f"{self.wiring.output(name)}={_truth(on)}" for name, on in part.set_signals
                ]

    def initial(self) -> list[str]:
        """Frames, tool and load at the start, and that no signal of the program's own is left."""
        numbered = [
            line
            for k, tool in enumerate(self.tools())
            for line in (f"TOOL_DATA[{tool}]=IR_TOOL", f"LOAD_DATA[{tool}]={_load_name(k)}")
        ]
        return [
            "$BASE=$NULLFRAME",
            "$TOOL=IR_TOOL",
            "$LOAD=IR_LOAD",
            *numbered,
            *(
                f"BASE_DATA[{self._base_number(k)}]={_base_name(k)}"
                for k in range(1, len(self._attached.bases) + 1)
            ),
            *([f"{PLC_PAUSE}=0"] if self._rests else []),
            *(self._waits_for_open_gripper() if self._grips else []),
        ]

    def _waits_for_open_gripper(self) -> list[str]:
        """The program halts as long as its gripper is closed where it begins."""
        return [
            f"WHILE {self._grip()}",
            f'MsgNotify("{self._grip()} is on: open the gripper, empty, then go on")',
            "HALT",
            "ENDWHILE",
        ]

    def bases(self) -> dict[str, int]:
        """Numbers of BASE_DATA by the machines that they stand for."""
        names = (name for name, _ in self._attached.bases)
        return {name: self._base_number(k) for k, name in enumerate(names, start=1)}

    def _base_number(self, k: int) -> int:
        """Of BASE_DATA, for the k-th base; 0 for the robot's foot."""
        if not k:
            return 0
        asked = self._attached.base_numbers
        return asked[k - 1] if asked else BASES_MAX + 1 - k

    def _tool_number(self, k: int) -> int:
        """Of TOOL_DATA and LOAD_DATA, for the tool with the k-th load."""
        asked = self._attached.tool_numbers
        return asked[k] if asked else TOOL_HIGHEST - k

    def _in_base(self, part: WrittenMove) -> WrittenMove:
        if not part.base:
            return part
        _, frame = self._attached.bases[part.base - 1]
        return replace(part, pose=portable.matmul(inverse(frame), part.pose))

    def tools(self) -> list[int]:
        """Numbers of TOOL_DATA that inline forms name, one for each load."""
        count = 0 if self._forms is None else len(self._attached.loads)
        return [self._tool_number(k) for k in range(count)]

    def data(self) -> list[str]:
        """Declarations: tool, loads, signals."""
        loads = [_load(k, one) for k, one in enumerate(self._attached.loads)]
        bases = [
            f"DECL FRAME {_base_name(k)}={{{frame_text(frame, 6)}}}"
            for k, (_, frame) in enumerate(self._attached.bases, start=1)
        ]
        return [_tool(self._attached.tool), *loads, *bases, *self.wiring.declarations()]

    def plc_numbers(self) -> dict[str, int]:
        """First numbers of the signals between program and PLC; none where it spends no pause."""
        if not self._rests:
            return {}
        kinds = {PLC_PAUSE: OUTPUT, PLC_THERE: INPUT, PLC_DONE: INPUT}
        return {name: self.wiring.number(kind, name) for name, kind in kinds.items()}

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
            f"DECL E6POS {n}={{{frame_text(pose, 7)}{_rail(rail)}}}"
            for n, pose, rail in zip(names, part.poses, part.rails, strict=True)
        ]
        self.lines += [
            f"; {part.comment}",
            "$TOOL=IR_TOOL",
            "$BASE=$NULLFRAME",
            f"$VEL.CP={part.speed:.6f}",
            f"$ACC.CP={part.acceleration:.6f}",
            "SPLINE",
            *(f"SPL {name}" for name in names),
            "ENDSPLINE",
        ]

    def _pause(self, part: WrittenPause) -> None:
        wait = f"WAIT SEC {part.seconds:.4f}"
        if not part.number:
            self.lines += [f"; {part.comment}", wait]
            return
        self._rests = True
        there = self.wiring.own(INPUT, PLC_THERE)
        done = self.wiring.own(INPUT, PLC_DONE)
        asked = self.wiring.own(OUTPUT, PLC_PAUSE, WIDTHS[PLC_PAUSE])
        self.lines += [
            f";FOLD {part.comment}",
            f"IF {there} THEN",
            f"{asked}={part.number}",
            f"WAIT FOR {done}",
            f"{asked}=0",
            f"WAIT FOR NOT {done}",
            "ELSE",
            wait,
            "ENDIF",
            ";ENDFOLD",
        ]

    def _grip(self) -> str:
        return self.wiring.output(GRIP)


def _truth(on: bool) -> str:
    return "TRUE" if on else "FALSE"


def _axes(q: FloatArray) -> str:
    """A configuration (6,) [rad], of a robot on a rail with E1 [m] first, as E6AXIS."""
    fields = axis_fields(q).items()
    return "{" + ",".join(f"{name} {decimal(value, 7)}" for name, value in fields) + "}"


def _rail(rails: FloatArray) -> str:
    """E1 [mm] of a rail (1,) [m] behind a frame; nothing without one (0,)."""
    return "".join(f",{RAIL_NAME} {decimal(1e3 * place, 6)}" for place in map(float, rails))


def _tool(tool: FloatArray) -> str:
    return f"DECL FRAME IR_TOOL={{{frame_text(tool, 4)}}}"


def _base_name(k: int) -> str:
    return f"IR_BASE_{k}"


def _load_name(k: int) -> str:
    return f"IR_LOAD_{k}" if k else "IR_LOAD"


def _load(k: int, load: Payload) -> str:
    places = [1e3 * metres for metres in load.centre]
    centre = zip(FRAME_NAMES, (*places, *load.angles), strict=True)
    about = zip(FRAME_NAMES[:3], load.inertia, strict=True)
    cm = ",".join(f"{name} {decimal(value, 3)}" for name, value in centre)
    j = ",".join(f"{name} {decimal(value, 4)}" for name, value in about)
    return f"DECL LOAD {_load_name(k)}={{M {load.mass:.3f},CM {{{cm}}},J {{{j}}}}}"
