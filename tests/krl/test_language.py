"""Constructs of the language, one program each: what it does, or the sentence that it gets."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np
import pytest

from ir_krl import Followed, KrlError, Motion, follow, parse
from ir_krl.errors import KrlRunError
from ir_krl.run import Effect, SetOutput, SplineBlock, StandStill, WaitForCondition

Follow = Callable[..., Followed]

WAITS = {  # statements that end in WAIT SEC of what they compute
    "integer division is towards zero": ("WAIT SEC 7/2", 3.0),
    "one real operand makes it real": ("WAIT SEC 7.0/2", 3.5),
    "products before sums": ("WAIT SEC 1+2*3", 7.0),
    "brackets": ("WAIT SEC (1+2)*3", 9.0),
    "signs": ("WAIT SEC -(-4)", 4.0),
    "exponents": ("WAIT SEC 2.5E1", 25.0),
    "bits": ("WAIT SEC 'B101'+('H1F' B_AND 6)", 11.0),
    "functions of the controller": ("WAIT SEC SQRT(ABS(-16.0))", 4.0),
    "trigonometry in degrees": ("WAIT SEC SIN(30)*10", 5.0),
    "an INT keeps whole numbers": ("DECL INT I\nI=0\nI=2.6\nWAIT SEC I", 3.0),
    "a REAL stays one": ("DECL REAL R=7\nWAIT SEC R/2", 3.5),
    "case doesn't count": ("decl int i=4\nwait sec I", 4.0),
    "FOR up": ("DECL INT I\nDECL INT N=0\nFOR I=1 TO 4\nN=N+I\nENDFOR\nWAIT SEC N", 10.0),
    "FOR down": (
        "DECL INT I\nDECL INT N=0\nFOR I=4 TO 1 STEP -2\nN=N*10+I\nENDFOR\nWAIT SEC N",
        42.0,
    ),
    "FOR that doesn't run": (
        "DECL INT I\nDECL INT N=5\nFOR I=2 TO 1\nN=0\nENDFOR\nWAIT SEC N",
        5.0,
    ),
    "WHILE": ("DECL INT N=1\nWHILE N<100\nN=N*3\nENDWHILE\nWAIT SEC N", 243.0),
    "REPEAT": ("DECL INT N=0\nREPEAT\nN=N+1\nUNTIL N>=3\nWAIT SEC N", 3.0),
    "LOOP with EXIT": (
        "DECL INT N=0\nLOOP\nN=N+1\nIF N==5 THEN\nEXIT\nENDIF\nENDLOOP\nWAIT SEC N",
        5.0,
    ),
    "EXIT leaves the inner loop": (
        "DECL INT N=0\nDECL INT I\nFOR I=1 TO 3\nLOOP\nEXIT\nENDLOOP\nN=N+1\nENDFOR\nWAIT SEC N",
        3.0,
    ),
    "IF and ELSE": ("IF 1>2 THEN\nWAIT SEC 1\nELSE\nWAIT SEC 2\nENDIF", 2.0),
    "SWITCH": (
        "SWITCH 3\nCASE 1,2\nWAIT SEC 1\nCASE 3\nWAIT SEC 3\nDEFAULT\nWAIT SEC 9\nENDSWITCH",
        3.0,
    ),
    "DEFAULT": ("SWITCH 8\nCASE 1\nWAIT SEC 1\nDEFAULT\nWAIT SEC 9\nENDSWITCH", 9.0),
    "SWITCH of an enumeration": (
        "SWITCH #B\nCASE #A\nWAIT SEC 1\nCASE #B\nWAIT SEC 2\nENDSWITCH",
        2.0,
    ),
    "arrays": ("DECL REAL A[3]\nA[2]=1.5\nWAIT SEC A[2]*2", 3.0),
    "arrays of two indices": ("DECL INT A[2,2]\nA[1,2]=6\nWAIT SEC A[1,2]", 6.0),
    "components": ("DECL FRAME F={X 1,Y 2,Z 3,A 0,B 0,C 0}\nF.Y=5\nWAIT SEC F.X+F.Y", 6.0),
    "a comparison is weaker than AND": ("IF (1<2) AND (3<4) THEN\nWAIT SEC 1\nENDIF", 1.0),
    "NOT": ("IF NOT FALSE THEN\nWAIT SEC 1\nENDIF", 1.0),
    "EXOR": ("IF TRUE EXOR FALSE THEN\nWAIT SEC 1\nENDIF", 1.0),
    "a group of outputs": (
        "SIGNAL G $OUT[3] TO $OUT[6]\nG=5\nIF $OUT[5] AND NOT $OUT[4] THEN\nWAIT SEC G\nENDIF",
        5.0,
    ),
    "an output that was never set": ("IF NOT $OUT[3] THEN\nWAIT SEC 1\nENDIF", 1.0),
    "a wait that may end by a timer": (
        "$TIMER[1]=-5000\n$TIMER_STOP[1]=FALSE\nIF NOT $TIMER_FLAG[1] THEN\nWAIT SEC 2\nENDIF",
        2.0,
    ),
    "VARSTATE": ('DECL INT N\nIF VARSTATE("N")==#DECLARED THEN\nN=1\nENDIF\nWAIT SEC N', 1.0),
    "letters of a text": (
        'DECL CHAR S[4]\nS[]="AB"\nIF (S[2]=="B") AND (S[]=="AB") THEN\nWAIT SEC 1\nENDIF',
        1.0,
    ),
    "messages": ('MsgNotify("Größe")\nWAIT SEC 1', 1.0),
    "loads of the controller": ("$LOAD=LOAD_DATA[2]\n$LOAD.M=10.0\nWAIT SEC 1", 1.0),
    "comments": ("WAIT SEC 1 ; and no more", 1.0),
    "folds": (";FOLD INI;%{PE}\nWAIT SEC 2\n;ENDFOLD (INI)", 2.0),
    "frames compose": (
        "DECL FRAME F\nF={X 10,Y 0,Z 0,A 90,B 0,C 0}:{X 5,Y 0,Z 0,A 0,B 0,C 0}\nWAIT SEC F.X+F.Y",
        15.0,
    ),
    "INV_POS": ("DECL FRAME F\nF=INV_POS({X 0,Y -4,Z 0,A 0,B 0,C 0})\nWAIT SEC F.Y", 4.0),
}


@pytest.mark.parametrize("name", WAITS)
def test_what_a_program_computes(name: str, followed: Follow) -> None:
    lines, seconds = WAITS[name]
    *_, wait = followed(lines).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == pytest.approx(seconds, abs=1e-9)


REFUSED = {
    "a name without a value": ("WAIT SEC NOBODY", "1:10", "NOBODY has no value"),
    "division by zero": ("WAIT SEC 1/0", "1:10", "division by 0"),
    "a text as a number": ('WAIT SEC "A"', "1:10", "the text 'A', not a number"),
    "a number as a condition": ("IF 1 THEN\nENDIF", "1:4", "the number 1, not TRUE or FALSE"),
    "numbers with AND": ("IF 1==1 AND 2==2 THEN\nENDIF", "1:7", "a comparison is weaker"),
    "an index that isn't there": ("DECL INT A[2]\nWAIT SEC A[3]", "2:10", "A[3] isn't in A[2]"),
    "GOTO nowhere": ("GOTO X", "1:1", "there is no label X"),
    "GOTO into a branch": ("GOTO X\nIF TRUE THEN\nX:\nENDIF", "1:1", "there is no label X"),
    "a point that nobody gives": (
        "PTP XP1",
        "1:5",
        "XP1 has no value, and a motion needs one: give",
    ),
    "a loop that counts for ever": (
        "I=1\nWHILE I>0\nI=I+1\nENDWHILE",
        None,
        "does a loop never end?",
    ),
    "an output of number 0": (
        "$OUT[0]=TRUE",
        "1:1",
        "$OUT[0]: outputs have whole numbers from 1 to 8192",
    ),
    "an output beyond the last": ("PULSE($OUT[9000],TRUE,0.5)", None, "$OUT[9000]: outputs have"),
    "a wait without end": ("WAIT SEC 1E30", "1:1", "a wait is read up to 604800 s, a week"),
    "an output that isn't a truth value": ("$OUT[1]=5", "1:1", "$OUT[1] is set to the number 5"),
    "a frame with axis angles": ("PTP {A1 0,X 5}", "1:5", "axis angles or a frame, not both"),
    "a motion to a number": ("PTP 5", "1:5", "a motion can't go to the number 5"),
    "LIN to axis angles": ("LIN {A1 0}", "1:1", "LIN goes to a frame"),
    "a speed of nothing": ("$VEL.CP=0\nLIN {X 1}", "2:1", "$VEL.CP is 0; it must be above 0"),
    "a speed of next to nothing": ("$VEL.CP=1E-30\nLIN {X 1}", "2:1", "at least 1e-06"),
    "a share of next to nothing": ("$VEL_AXIS[1]=1E-30\nPTP {A1 1}", "2:1", "at least 1e-06 %"),
    "a share above all": ("$VEL_AXIS[2]=120\nPTP {A1 0}", "2:1", "$VEL_AXIS is 120 %"),
    "an interpolation of nothing": ("$IPO_MODE=#NOBODY", "1:1", "it is #BASE or #TCP"),
    "EXIT outside of a loop": ("EXIT", None, "EXIT stands outside of a loop"),
    "a REAL beyond its range": ("WAIT SEC 1E400", "1:10", "a REAL is at most"),
    "an INT beyond its range": ("WAIT SEC 99999*99999", "1:10", "from -2147483648 to 2147483647"),
    "an INT of many digits": ("WAIT SEC " + "9" * 6000, "1:10", "6000 digits"),
    "a component that no position has": (
        "PTP {A1 0,A7 5}",
        "1:5",
        "A7 is no component of a position",
    ),
    "a group that can't hold a number": (
        "SIGNAL G $OUT[1] TO $OUT[2]\nG=4",
        "2:1",
        "it can't hold 4",
    ),
    "a group of inputs that is set": ("SIGNAL G $IN[1] TO $IN[2]\nG=1", "2:1", "it can't be set"),
    "a group that ends before it begins": (
        "SIGNAL G $OUT[4] TO $OUT[2]",
        "1:1",
        "must be a group of 1 to 32",
    ),
    "a component twice": ("PTP {A1 0,A1 1}", "1:11", "component A1 is given twice"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_followed_is_named_with_its_place(name: str, followed: Follow) -> None:
    lines, place, words = REFUSED[name]
    with pytest.raises(KrlRunError) as refused:
        followed(lines)
    if place is not None:
        line, column = place.split(":")
        assert str(refused.value).startswith(
            f"test.src:{int(line) + 1}:{column}: "
        )  # DEF is line 1
    assert words is None or words in str(refused.value)


SYNTAX = {
    "a word that is none": ("PTP XP1 C_FOO", 2, 9),
    "IF without THEN": ("IF TRUE\nENDIF", 2, 8),
    "a character": ("X=§", 2, 3),
    "a loop that isn't closed": ("LOOP\nWAIT SEC 1", 4, 1),
    "an aggregate that isn't closed": ("PTP {A1 0", 2, 10),
    "a call without brackets": ("  OPEN_GRIPPER", 2, 3),
    "an ELSEIF": ("IF TRUE THEN\n ELSEIF FALSE THEN\nENDIF", 3, 2),
}


@pytest.mark.parametrize("name", SYNTAX)
def test_what_is_no_krl_is_named_with_line_and_column(name: str) -> None:
    lines, line, column = SYNTAX[name]
    with pytest.raises(KrlError) as refused:
        parse(f"DEF TEST( )\n{lines}\nEND\n", "test.src")
    assert (refused.value.place.line, refused.value.place.column) == (line, column)


@pytest.mark.parametrize(
    "lines",
    [
        "IF TRUE THEN\n" * 2000 + "ENDIF\n" * 2000,
        "WAIT SEC " + "-" * 3000 + "1",
        "WAIT SEC 1" + "+1" * 3000,
    ],
)
def test_what_is_nested_too_deeply_ends_with_a_sentence(lines: str, followed: Follow) -> None:
    with pytest.raises((KrlError, KrlRunError), match="nested too deeply"):
        followed(lines)


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_files_are_read_as_editors_leave_them(ends: str) -> None:
    text = "\ufeffDEF T( )\n; Öffnen\nPTP {A1 1}\nPTP NOBODY\nEND\n".replace("\n", ends)
    with pytest.raises(KrlRunError, match=r"t\.src:4:5: NOBODY has no value"):
        follow([parse(text, "t.src")], np.zeros(6), np.eye(4))


def test_damaged_programs_end_with_a_sentence() -> None:
    """Law: whatever a text holds, it is followed or refused with a KrlError."""
    whole = (
        "DEF T( )\nDECL INT I\nBAS(#INITMOV,0)\nPTP XHOME\nFOR I=1 TO 3\nLIN_REL {Z 10} "
        "C_DIS\nENDFOR\n"
        "IF (I>2) AND NOT $IN[3] THEN\n$OUT[2]=TRUE\nENDIF\n"
        "SPTP {A1 5} WITH $VEL_AXIS[1]=SVEL_JOINT(50)\nEND\n"
    )
    rng = np.random.default_rng(7)
    marks = "()[]{},.:;=#\"'$-+*/ABX019 \n\0é"
    for _ in range(400):
        text = list(whole)
        for at in rng.integers(0, len(text), rng.integers(1, 6)):
            text[at] = marks[rng.integers(len(marks))]
        with contextlib.suppress(KrlError):
            follow([parse("".join(text), "t.src")], np.zeros(6), np.eye(4), inputs={3: True})


def test_subprograms_and_functions() -> None:
    text = (
        "DEF MAIN( )\nDECL INT N=2\nTWICE(N)\nWAIT SEC N+HALF(3)\nEND\n"
        "DEF TWICE(X:OUT)\nX=X*2\nEND\n"
        "DEFFCT REAL HALF(X:IN)\nRETURN X/2.0\nENDFCT\n"
    )
    (wait,) = follow([parse(text, "m.src")], np.zeros(6), np.eye(4)).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == pytest.approx(5.5)


def test_a_program_that_calls_itself_is_a_cycle() -> None:
    text = "DEF MAIN( )\nWAIT SEC 1\nMAIN()\nEND\n"
    program = follow([parse(text, "m.src")], np.zeros(6), np.eye(4), loop_passes=2)
    assert len(program.commands) == 2
    assert "MAIN calls itself: nothing that is known ends it" in str(program.notes[0])


def test_a_function_that_calls_itself_for_ever_ends_with_a_sentence() -> None:
    text = "DEF MAIN( )\nF(1)\nEND\nDEF F(N:IN)\nF(N+1)\nEND\n"
    with pytest.raises(KrlRunError, match="call within calls"):
        follow([parse(text, "m.src")], np.zeros(6), np.eye(4))


def test_inline_forms(followed: Follow) -> None:
    program = followed(
        ";FOLD PTP P1 CONT Vel=50 % PDAT1 Tool[1] Base[2]\n"
        "$BWDSTART=FALSE\nPDAT_ACT=PPDAT1\nFDAT_ACT=FP1\nBAS(#PTP_PARAMS,50)\nPTP XP1 "
        "C_PTP\n;ENDFOLD\n"
        ";FOLD LIN P2 Vel=0.3 m/s CPDAT1 Tool[1] Base[2]\n"
        "$BWDSTART=FALSE\nLDAT_ACT=LCPDAT1\nFDAT_ACT=FP1\nBAS(#CP_PARAMS,0.3)\n"
        "LIN XP2 C_DIS C_DIS\n;ENDFOLD\n"
        "SLIN XP1 WITH $VEL=SVEL_CP(0.2, , LCPDAT1), $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO), "
        "$IPO_MODE=SIPO_MODE(FP1.IPO_FRAME), $ACC=SACC_CP(LCPDAT1), $APO=SAPO(LCPDAT1) C_SPL",
        "DECL E6POS XP1={X 1500,Y 0,Z 1200,A 0,B 90,C 0,S 2,T 10}\n"
        "DECL E6POS XP2={X 1600,Y 0,Z 1200,A 0,B 90,C 0,S 2,T 10}\n"
        'DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " "}\n'
        "DECL PDAT PPDAT1={VEL 100,ACC 80,APO_DIST 60}\n"
        "DECL LDAT LCPDAT1={VEL 2,ACC 50,APO_DIST 30,APO_FAC 50}\n"
        "BASE_DATA[2]={X 100,Y 0,Z 0,A 0,B 0,C 0}",
    )
    first, second, third = program.commands
    assert isinstance(first, Motion)
    assert isinstance(second, Motion)
    assert isinstance(third, Motion)
    assert first.speeds.axis_velocity == (0.5,) * 6
    assert first.speeds.axis_acceleration == (0.8,) * 6
    assert first.blend is not None
    assert first.blend.share == pytest.approx(0.6)
    assert first.target.base[0, 3] == pytest.approx(0.1)
    assert (first.target.status, first.target.turn) == (2, 10)
    assert second.speeds.velocity == pytest.approx(0.3)
    assert second.blend is not None
    assert second.blend.distance == pytest.approx(0.03)
    assert third.speeds.velocity == pytest.approx(0.2)
    assert third.speeds.acceleration == pytest.approx(second.speeds.acceleration)


def test_settings_after_with_hold_for_their_motion_only(followed: Follow) -> None:
    first, second = followed("SPTP {A1 1} WITH $VEL_AXIS[1]=SVEL_JOINT(20)\nSPTP {A1 2}").commands
    assert isinstance(first, Motion)
    assert isinstance(second, Motion)
    assert (first.speeds.axis_velocity[3], second.speeds.axis_velocity[3]) == (0.2, 1.0)


def test_outputs_waits_triggers_and_pulses(followed: Follow) -> None:
    program = followed(
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[7]=TRUE\n"
        "TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[8]=TRUE\n"
        "PTP {A1 1}\nPULSE($OUT[3],TRUE,0.5)\nDOOR=TRUE\nWAIT FOR $IN[2] AND NOT $IN[3]",
        "SIGNAL DOOR $OUT[12]",
    )
    before, motion, after, pulse, door, wait = program.commands
    assert isinstance(motion, Motion)
    assert [(o.number, o.value) for o in (before, after, door) if isinstance(o, SetOutput)] == [
        (7, True),
        (8, True),
        (12, True),
    ]
    assert isinstance(pulse, SetOutput)
    assert pulse.pulse == 0.5
    assert isinstance(wait, WaitForCondition)
    assert wait.condition == "($IN[2] AND NOT $IN[3])"


def test_spline_blocks_and_time_blocks(followed: Follow) -> None:
    (block,) = followed(
        "PTP_SPLINE\nTIME_BLOCK START\nSPTP {A1 1}\nTIME_BLOCK PART=25\nSPTP {A1 2}\nTIME_BLOCK "
        "END=3.5\n"
        "ENDSPLINE C_SPL"
    ).commands
    assert isinstance(block, SplineBlock)
    assert block.axis
    assert len(block.parts) == 2
    (times,) = block.times
    assert (times.first, times.last, times.marks, times.seconds) == (0, 2, ((1, 25.0),), 3.5)


def test_a_group_of_inputs_chooses_the_case(followed: Follow) -> None:
    """SWITCH of a group took the first input alone, and another branch, with a note."""
    cases = "CASE 1,2\nWAIT SEC 1\nCASE 6\nWAIT SEC 6\nDEFAULT\nWAIT SEC 9"
    lines = f"SIGNAL TYPE $IN[11] TO $IN[13]\nSWITCH TYPE\n{cases}\nENDSWITCH"
    for value in range(8):
        inputs = {11 + k: bool(value >> k & 1) for k in range(3)}
        (wait,) = followed(lines, inputs=inputs).commands
        assert isinstance(wait, StandStill)
        assert wait.seconds == {1: 1.0, 2: 1.0, 6: 6.0}.get(value, 9.0)


def test_what_a_spline_does_meanwhile_is_noted(followed: Follow) -> None:
    lines = (
        "SPLINE\nSPL {X 1}\nCONST_VEL START=10 ONSTART\nSTOP WHEN PATH=5 IF $IN[3]\nSPL {X 2}\n"
        "CONST_VEL END=-10\nSPL {X 3}\nENDSPLINE"
    )
    program = followed(f"BAS(#INITMOV,0)\n{lines}")
    (block,) = program.commands
    assert isinstance(block, SplineBlock)
    assert len(block.parts) == 3
    said = {note.text.split(" ")[0] for note in program.notes}
    assert said == {"TOOL_DATA[1]", "CONST_VEL", "STOP", "of"}


@pytest.mark.parametrize("motion", ["CIRC_REL", "SCIRC_REL"])
def test_a_relative_circle_may_be_one_of_the_tool(motion: str, followed: Follow) -> None:
    (circle,) = followed(f"{motion} {{Y 5,Z 5}},{{Y 10}},CA 90 #TOOL").commands
    assert isinstance(circle, Motion)
    assert circle.via is not None
    assert circle.target.in_tool
    assert circle.via.in_tool


def test_triggers_of_a_spline_switch_around_it(followed: Follow) -> None:
    """They switched at the next motion after it, and its process was nobody's."""
    program = followed(
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE\nSPLINE\nSPL {X 1}\n"
        "TRIGGER WHEN PATH=0 DELAY=0 DO $OUT[2]=TRUE\nSPL {X 2}\n"
        "TRIGGER WHEN PATH=0 DELAY=0 DO $OUT[2]=FALSE\n"
        "TRIGGER WHEN PATH=0 DELAY=0 DO $OUT[3]=FALSE\nTRIGGER WHEN PATH=0 DELAY=0 DO "
        "$OUT[3]=TRUE\n"
        "SPL {X 3}\nENDSPLINE\nPTP {A1 0}"
    )
    found = [
        (one.number, one.value) if isinstance(one, SetOutput) else "moves"
        for one in program.commands
    ]
    assert found == [(1, True), (2, True), "moves", (2, False), (3, False), (3, True), "moves"]


def test_an_external_axis_that_stands_is_noted(followed: Follow) -> None:
    stands = followed("PTP {A1 0,E1 0.0,E2 0.0}\nPTP {A1 5}").notes
    assert not [note for note in stands if note.effect is Effect.PLACES]
    program = followed("PTP {A1 0,E1 500}")
    (note,) = (note for note in program.notes if note.effect is Effect.PLACES)
    assert note.text == "E1 stays at 500: external axes are taken as part of the cell"


def test_an_endless_loop_is_followed_once_and_says_so(followed: Follow) -> None:
    program = followed("LOOP\nPTP {A1 1}\nENDLOOP")
    assert len(program.commands) == 1
    assert [note.text for note in program.notes if note.effect is Effect.MOTIONS] == [
        "LOOP: nothing that is known ends it, followed once (--loop-passes)"
    ]
    assert len(followed("LOOP\nPTP {A1 1}\nENDLOOP", loop_passes=3).commands) == 3


def test_signals_decide_as_they_are_given(followed: Follow) -> None:
    lines = "IF $IN[4] THEN\nWAIT SEC 1\nELSE\nWAIT SEC 2\nENDIF"
    for value, seconds in ((True, 1.0), (False, 2.0)):
        (wait,) = followed(lines, inputs={4: value}).commands
        assert isinstance(wait, StandStill)
        assert wait.seconds == seconds


def test_what_is_not_modelled_is_noted(followed: Follow) -> None:
    notes = [
        note.text
        for note in followed("$FRICTION=1\nHALT\nINTERRUPT DECL 5 WHEN TRUE DO STOPIT()").notes
    ]
    assert len(notes) == 3
    assert "$FRICTION isn't modelled" in notes
