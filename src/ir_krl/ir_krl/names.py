"""Names as the controller takes them: letters, digits and _, at most 24 characters, no word of
KRL.
"""

from __future__ import annotations

import re

from ir_krl.errors import KrlError

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
