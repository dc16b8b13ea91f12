"""Inline forms: folds that WorkVisual and the pendant show, change and touch up."""

from __future__ import annotations

import math

import numpy as np

from ir_krl.errors import SourcePlace
from ir_krl.run.system import AXES
from ir_krl.run.values import (
    AXIS_NAMES,
    EXTERNAL_NAMES,
    FRAME_NAMES,
    components,
    frame,
)
from ir_krl.write.statements import Style, WrittenMove
from ir_values.arrays import FloatArray

# The texts after ";%{" tell the editor which form it is; the lines below them are what the form
# makes of its data, so that both say the same.

_SPLINE_FORMS = "kukaroboter.basistech.inlineforms.movement.spline"
_CHECK = "$COLLMON_TOL_PRO[1] = USE_CM_PRO_VALUES(0)"
_TOP = 2.0  # m/s, of an LDAT
_WRIST = 4  # A5
_STRETCHED = math.radians(0.05)  # of A5: nearer to 0 the wrist is written by its axes


class Forms:
    """Appends inline forms to the lines of a routine and of its data list."""

    def __init__(self, style: Style, lines: list[str], data: list[str]) -> None:
        self._style = style
        self._lines = lines
        self._data = data
        self._count = 0

    def move(self, part: WrittenMove, tool: int, base: int) -> None:
        """A motion with these numbers of tool and base, its pose in that base."""
        self._count += 1
        n = self._count
        self._data += _declared(part, n, (tool, base), self._style)
        if part.comment:
            self._lines.append(f"; {part.comment}")
        if self._style == "krc2":
            made = _line_of_krc2 if part.straight else _ptp
        else:
            made = _slin if part.straight else _sptp
        self._lines += made(part, n, (tool, base))
        self._lines.append(";ENDFOLD")


_Numbers = tuple[int, int]
"""Of tool and base."""


def _declared(part: WrittenMove, n: int, numbers: _Numbers, style: Style) -> list[str]:
    if part.straight:
        shape = ",ORI_TYP #VAR" if style == "krc2" else ",ORI_TYP #VAR,CIRC_TYP #BASE,JERK_FAC 50.0"
        motion = (
            f"DECL LDAT LCPDAT{n}={{VEL {_TOP:.1f},ACC {part.acceleration}.0,"
            f"APO_DIST {part.rounded:.1f},APO_FAC 50.0{shape}}}"
        )
    else:
        mode = "" if style == "krc2" else ",APO_MODE #CDIS,GEAR_JERK 50.0"
        motion = (
            f"DECL PDAT PPDAT{n}={{VEL 100.0,ACC {part.acceleration}.0,"
            f"APO_DIST {part.rounded:.1f}{mode}}}"
        )
    rails = part.joints[:-AXES]
    arm = part.joints[-AXES:]
    values = [*(decimal(1e3 * place, 6) for place in map(float, rails)), *["0.0"] * 6]
    named = zip(EXTERNAL_NAMES, values, strict=False)
    external = ",".join(f"{name} {value}" for name, value in named)
    if _is_posture(part):
        angles = zip(AXIS_NAMES, np.degrees(arm), strict=True)
        fields = ",".join(f"{name} {decimal(angle, 7)}" for name, angle in angles)
        point = f"DECL E6AXIS XP{n}={{{fields},{external}}}"
    else:
        marks = f"S {part.status},T {part.turn}"
        point = f"DECL E6POS XP{n}={{{frame_text(part.pose, 6)},{marks},{external}}}"
    tool, base = numbers
    form = f'{{TOOL_NO {tool},BASE_NO {base},IPO_FRAME #BASE,POINT2[] " "}}'
    return [point, f"DECL FDAT FP{n}={form}", motion]


def _is_posture(part: WrittenMove) -> bool:
    """Whether the axes say where a PTP in the robot's foot leads: near A5 = 0 a pose leaves A4 and
    A6 to rounding.
    """
    arm = part.joints[-AXES:]
    singular = len(arm) > _WRIST and abs(arm[_WRIST]) < _STRETCHED
    return bool(singular) and not part.straight and part.base == 0


def _title(word: str, part: WrittenMove, n: int, numbers: _Numbers, unit: str, data: str) -> str:
    cont = " CONT" if part.rounded else ""
    tool, base = numbers
    return f";FOLD {word} P{n}{cont} Vel={part.velocity:g} {unit} {data} Tool[{tool}] Base[{base}]"


def _spline_form(
    command: str, part: WrittenMove, n: int, numbers: _Numbers, unit: str, data: str
) -> list[str]:
    names = (
        ("MoveDataName", "VelocityPath") if part.straight else ("MoveDataPtpName", "VelocityPtp")
    )
    values = {
        "IlfProvider": _SPLINE_FORMS,
        "Kuka.IsGlobalPoint": False,
        "Kuka.PointName": f"P{n}",
        "Kuka.BlendingEnabled": bool(part.rounded),
        f"Kuka.{names[0]}": data,
        f"Kuka.{names[1]}": f"{part.velocity:g}",
        "IlfCommand": command,
    }
    return [
        f"{_title(command, part, n, numbers, unit, data)} ;%{{PE}}",
        ";FOLD Parameters ;%{h}",
        f";Params {'; '.join(f'{name}={value}' for name, value in values.items())}",
        ";ENDFOLD",
    ]


def _frames(n: int) -> str:
    return (
        f"$TOOL = STOOL2(FP{n}), $BASE = SBASE(FP{n}.BASE_NO), "
        f"$IPO_MODE = SIPO_MODE(FP{n}.IPO_FRAME), $LOAD = SLOAD(FP{n}.TOOL_NO)"
    )


def _sptp(part: WrittenMove, n: int, numbers: _Numbers) -> list[str]:
    return [
        *_spline_form("SPTP", part, n, numbers, "%", f"PDAT{n}"),
        f"SPTP XP{n} WITH $VEL_AXIS[1] = SVEL_JOINT({part.velocity:.1f}), {_frames(n)}, "
        f"$ACC_AXIS[1] = SACC_JOINT(PPDAT{n}), $APO = SAPO_PTP(PPDAT{n}), "
        f"$GEAR_JERK[1] = SGEAR_JERK(PPDAT{n}), {_CHECK}{' C_SPL' if part.rounded else ''}",
    ]


def _slin(part: WrittenMove, n: int, numbers: _Numbers) -> list[str]:
    return [
        *_spline_form("SLIN", part, n, numbers, "m/s", f"CPDAT{n}"),
        f"SLIN XP{n} WITH $VEL = SVEL_CP({part.velocity:g}, , LCPDAT{n}), {_frames(n)}, "
        f"$ACC = SACC_CP(LCPDAT{n}), $ORI_TYPE = SORI_TYP(LCPDAT{n}), $APO = SAPO(LCPDAT{n}), "
        f"$JERK = SJERK(LCPDAT{n}), {_CHECK}{' C_SPL' if part.rounded else ''}",
    ]


def _ptp(part: WrittenMove, n: int, numbers: _Numbers) -> list[str]:
    word = "C_PTP" if part.rounded else ""
    title = _title("PTP", part, n, numbers, "%", f"PDAT{n}")
    return [
        f"{title};%{{PE}}%R 5.4.27,%MKUKATPBASIS,%CMOVE,%VPTP,%P 1:PTP, 2:P{n}, 3:{word}, "
        f"5:{part.velocity:g}, 7:PDAT{n}",
        "$BWDSTART=FALSE",
        f"PDAT_ACT=PPDAT{n}",
        f"FDAT_ACT=FP{n}",
        f"BAS(#PTP_PARAMS,{part.velocity:g})",
        f"PTP XP{n} {word}".rstrip(),
    ]


def _line_of_krc2(part: WrittenMove, n: int, numbers: _Numbers) -> list[str]:
    word = "C_DIS" if part.rounded else ""
    title = _title("LIN", part, n, numbers, "m/s", f"CPDAT{n}")
    return [
        f"{title};%{{PE}}%R 5.4.27,%MKUKATPBASIS,%CMOVE,%VLIN,%P 1:LIN, 2:P{n}, 3:{word}, "
        f"5:{part.velocity:g}, 7:CPDAT{n}",
        "$BWDSTART=FALSE",
        f"LDAT_ACT=LCPDAT{n}",
        f"FDAT_ACT=FP{n}",
        f"BAS(#CP_PARAMS,{part.velocity:g})",
        f"LIN XP{n} {word}".rstrip(),
    ]


# Numbers and frames as text.


def decimal(value: float, digits: int) -> str:
    """A number without the sign of a zero."""
    text = f"{value:.{digits}f}"
    return text if text.strip("-0.") else text.removeprefix("-")


def frame_text(transform: FloatArray, digits: int) -> str:
    """X to C [mm, deg] of a pose (4, 4) [m], without brackets."""
    fields = components(frame(transform), FRAME_NAMES, SourcePlace())
    return ",".join(f"{name} {decimal(value, digits)}" for name, value in fields.items())
