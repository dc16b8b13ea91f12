"""What a program doesn't bring is assumed, said with what it could change, and can be set."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ir_cli.main import main
from ir_krl import Followed, KrlError, Motion, follow, parse, read_project
from ir_krl.run import Effect, SetOutput, StandStill
from ir_krl.settings import settings_of, stubs
from ir_planner import Planner
from ir_planner.krl import follow_krl

Follow = Callable[..., Followed]


def angles(program: Followed) -> list[float]:
    """A1 [deg] of the motions."""
    motions = [one for one in program.commands if isinstance(one, Motion)]
    return [round(float(np.degrees((one.target.axes or {}).get("A1", 0.0))), 6) for one in motions]


def texts(program: Followed) -> list[str]:
    return [note.text for note in program.notes if note.effect > Effect.NONE]


ASSUMED = {
    "a routine of a technology package": (
        "USERSPOT(#INIT)",
        "USERSPOT isn't in the files: no motion and a stop of the advance run assumed (--stub)",
        Effect.MOTIONS,
    ),
    "the operating mode": (
        "IF $T1 THEN\nENDIF",
        "$T1 is taken as FALSE: --set '$T1=…'",
        Effect.MOTIONS,
    ),
    "an input": (
        "IF $IN[4] THEN\nENDIF",
        "$IN[4] isn't given: taken as FALSE; --input 4=true",
        Effect.MOTIONS,
    ),
    "an output": (
        "IF $OUT[4] THEN\nENDIF",
        "$OUT[4] was never set: taken as FALSE",
        Effect.MOTIONS,
    ),
    "a variable that decides": (
        "IF READY THEN\nENDIF",
        "READY has no value: taken as FALSE; --set 'READY=…'",
        Effect.MOTIONS,
    ),
    "a variable that chooses a case": (
        "SWITCH STEP_NO\nCASE 1\nENDSWITCH",
        "STEP_NO has no value: taken as 0; --set 'STEP_NO=…'",
        Effect.MOTIONS,
    ),
    "a tool": (
        "FDAT_ACT={TOOL_NO 14,BASE_NO 0}\nBAS(#FRAMES)\nPTP {X 1,Y 2,Z 3,A 0,B 90,C 0}",
        "TOOL_DATA[14] isn't in the files: the cell's tool",
        Effect.PLACES,
    ),
    "a base": (
        "FDAT_ACT={TOOL_NO 0,BASE_NO 5}\nBAS(#FRAMES)\nPTP {X 1,Y 2,Z 3,A 0,B 90,C 0}",
        "BASE_DATA[5] isn't in the files: the robot's foot",
        Effect.PLACES,
    ),
    "a base by hand": (
        "$BASE=BASE_DATA[5]",
        "BASE_DATA[5] isn't in the files: the robot's foot",
        Effect.PLACES,
    ),
    "home": ("PTP XHOME", "XHOME isn't in the files: the cell's home", Effect.PLACES),
    "the data of the home form": (
        "PDAT_ACT=PDEFAULT\nFDAT_ACT=FHOME\nBAS(#PTP_PARAMS,100)\nPTP XHOME C_DIS",
        "PDEFAULT isn't in the files: APO_DIST of 100 mm, as from KSS 8.3 on; older ones have "
        "100 %; --set 'PDEFAULT={…}'",
        Effect.SPEEDS,
    ),
    "an external axis": (
        "PTP {A1 0,E1 500}\nPTP {A1 10,E1 600}",
        "E1 moves from 500 to 600: external axes aren't modelled, the arm alone is driven",
        Effect.PLACES,
    ),
    "an interrupt": (
        "INTERRUPT DECL 3 WHEN $IN[1] DO FAULT( )",
        "the interrupt that calls FAULT isn't followed",
        Effect.MOTIONS,
    ),
    "a system variable that is set": ("$SEN_PINT[1]=2", "$SEN_PINT isn't modelled", Effect.PLACES),
    "a name that is waited for": (
        "WAIT FOR PART_THERE",
        "PART_THERE isn't declared in the files: the wait is taken as one that ends",
        Effect.TIMES,
    ),
    "an unknown command of BAS": (
        "BAS(#NOBODY,1)",
        "BAS(#NOBODY) isn't known: no effect assumed",
        Effect.SPEEDS,
    ),
    "how far corners are rounded": (
        "PTP {A1 1} C_PTP\nPTP {A1 2}",
        "$APO.CPTP isn't set: as BAS(#INITMOV) sets it, 50 %",
        Effect.SPEEDS,
    ),
    "how far the speed is kept in corners": (
        "LIN_REL {X 1} C_VEL\nLIN_REL {X 2}",
        "$APO.CVEL isn't set: as BAS(#INITMOV) sets it, 100 %",
        Effect.SPEEDS,
    ),
    "where the first motion begins": (
        "PTP $AXIS_ACT\nPTP {A1 30}",
        "$AXIS_ACT is the first motion: the robot stands in the cell's home",
        Effect.PLACES,
    ),
    "where it stands at first": (
        "SPTP $AXIS_ACT\nIF $AXIS_ACT.A1>5 THEN\nENDIF",
        "$AXIS_ACT is read before the first motion: the robot stands in the cell's home",
        Effect.PLACES,
    ),
    "how the tool turns": (
        "LDAT_ACT={VEL 1,ACC 100,APO_DIST 0,ORI_TYP #JOINT}\nBAS(#CP_DAT)\nLIN_REL {X 1}",
        "$ORI_TYPE #JOINT: the tool is turned evenly instead",
        Effect.PLACES,
    ),
    "how the tool turns on a circle": (
        "$CIRC_TYPE=#PATH\nCIRC_REL {X 1,Y 1},{X 2}",
        "$CIRC_TYPE #PATH: the tool is turned evenly in the base instead",
        Effect.PLACES,
    ),
    "a motion beside a motion": (
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO BLOW( )\nPTP {A1 1}\nEND\nDEF BLOW( )\nPTP {A1 9}",
        "a motion in what a TRIGGER calls: a controller refuses it, it isn't driven",
        Effect.MOTIONS,
    ),
    "a stop beside a motion": (
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO BLOW( )\nPTP {A1 1}\nEND\nDEF BLOW( )\nBRAKE",
        "BRAKE in what a TRIGGER calls stops the robot: not followed",
        Effect.MOTIONS,
    ),
    "a wait for nothing": (
        "WAIT FOR FALSE",
        "this wait never ends by what the program itself sets: taken as ended",
        Effect.MOTIONS,
    ),
    "what a channel sends": (
        'CREAD(H,S,M,1,0.0,O,"%d",N)',
        "CREAD isn't followed: what it would fill in is taken as it stands",
        Effect.MOTIONS,
    ),
    "a text that is put together": (
        'SWRITE(A[],S,O,"%d",N)',
        "SWRITE isn't followed: what it would fill in is taken as it stands",
        Effect.MOTIONS,
    ),
    "a base that moves": (
        "BAS(#EX_BASE,3)",
        "BAS(#EX_BASE): a base that external axes move isn't followed",
        Effect.PLACES,
    ),
    "a palletising robot": ("$PAL_MODE=TRUE", "$PAL_MODE isn't modelled", Effect.PLACES),
    "a flag that follows an expression": (
        "DECL BOOL B\nB=TRUE\n$CYCFLAG[2]=$IN[1] AND B\nIF $CYCFLAG[2] THEN\nENDIF",
        "$CYCFLAG[2] is taken as it was when it was set, not evaluated anew",
        Effect.MOTIONS,
    ),
    "a timer": (
        "$TIMER[2]=0\n$TIMER_STOP[2]=FALSE\nIF $TIMER[2]>=5000 THEN\nENDIF",
        "$TIMER[2] stands still: no time passes for a timer",
        Effect.MOTIONS,
    ),
    "a timer that ends a loop": (
        "$TIMER[2]=0\nLOOP\nIF ($TIMER[2]>=5000) OR $IN[4] THEN\nEXIT\nENDIF\nENDLOOP",
        "$TIMER[2] stands still: no time passes for a timer",
        Effect.MOTIONS,
    ),
    "figures of $config.dat": (
        "BAS(#INITMOV,0)\nPTP {A1 1}\nLIN_REL {X 1} C_DIS\nLIN_REL {X 1}",
        "of $config.dat, not in the files, as delivered: DEF_VEL_PTP 100 %, DEF_APO_CDIS 3 mm, "
        "DEF_VEL_CP 2 m/s, DEF_VEL_ORI1 200 deg/s, DEF_ACC_CP 2.3 m/s^2, DEF_ACC_ORI1 100 deg/s^2; "
        "--set 'NAME=…'",
        Effect.SPEEDS,
    ),
    "figures of $config.dat in forms of the spline kind": (
        "SLIN_REL {X 1} WITH $VEL_AXIS[1]=SVEL_JOINT(9), $VEL=SVEL_CP(1.0), $ACC=SACC_CP({ACC 50})",
        "of $config.dat, not in the files, as delivered: DEF_VEL_ORIS 200 deg/s, "
        "DEF_ACC_CP 2.3 m/s^2, DEF_ACC_ORIS 200 deg/s^2; --set 'NAME=…'",
        Effect.SPEEDS,
    ),
    "the speed of a path": (
        "$VEL.CP=0.5\nLIN_REL {X 1}",
        "$VEL or $ACC isn't set whole: what lacks is as BAS(#INITMOV) sets it, 2 m/s, 200 deg/s, "
        "2.3 m/s^2, 100 deg/s^2",
        Effect.SPEEDS,
    ),
    "how fast the tool turns about its own axis": (
        "BAS(#INITMOV,0)\n$VEL.ORI2=1\nLIN_REL {A 10}",
        "$VEL.ORI2 isn't $VEL.ORI1: the tool turns by ORI1 all ways",
        Effect.SPEEDS,
    ),
    "the speed of an axis": (
        "$VEL_AXIS[1]=50\nPTP {A1 1}",
        "$VEL_AXIS or $ACC_AXIS isn't set for every axis: what lacks is 100 %",
        Effect.SPEEDS,
    ),
    "where the motion before began": (
        "PTP {A1 1}\nPTP $AXIS_BACK",
        "$AXIS_BACK is known on the controller only: taken as where the robot stands",
        Effect.PLACES,
    ),
    "how a circle turns the tool": (
        "SCIRC {X 1,Y 1},{X 2} WITH $CIRC_MODE={TARGET_PT {ORI #INTERPOLATE}}",
        "$CIRC_MODE isn't modelled",
        Effect.PLACES,
    ),
    "a halt": ("HALT", "HALT waits for the operator: taken as no pause", Effect.TIMES),
}


@pytest.mark.parametrize("name", ASSUMED)
def test_an_assumption_is_said_with_what_it_could_change(name: str, followed: Follow) -> None:
    lines, text, effect = ASSUMED[name]
    found = [note for note in followed(lines).notes if note.text == text]
    assert [note.effect for note in found] == [effect]
    assert found[0].place.line >= 2
    assert "could change" in str(found[0])


LEADS_TO_TEN = {
    "a pulse lasts": "PULSE($OUT[1],TRUE,2.0)\nIF $OUT[1] THEN\nPTP {A1 10}\nENDIF",
    "a pulse is over": (
        "PULSE($OUT[1],TRUE,2.0)\nWAIT SEC 1.5\nWAIT SEC 1\nIF NOT $OUT[1] THEN\nPTP {A1 10}\nENDIF"
    ),
    "a pulse to FALSE goes back": (
        "$OUT[1]=TRUE\nPULSE($OUT[1],FALSE,1.0)\nWAIT SEC 2\nIF $OUT[1] THEN\nPTP {A1 10}\nENDIF"
    ),
    "a group has the number that was waited for": (
        "SIGNAL NR $IN[3] TO $IN[6]\nWAIT FOR NR==5\nSWITCH NR\nCASE 5\nPTP {A1 10}\nENDSWITCH"
    ),
    "a cyclical flag follows its inputs": (
        "$CYCFLAG[1]=$IN[1] AND NOT $IN[2]\nWAIT FOR $CYCFLAG[1]\nIF $CYCFLAG[1] THEN\n"
        "PTP {A1 10}\nENDIF"
    ),
    "a letter of a text": (
        'DECL CHAR S[10]\nS[]="AB"\nS[2]="Z"\nIF S[2]=="Z" THEN\nPTP {A1 10}\nENDIF'
    ),
}


@pytest.mark.parametrize("name", LEADS_TO_TEN)
def test_what_follows_from_the_program_is_no_assumption(name: str, followed: Follow) -> None:
    program = followed(LEADS_TO_TEN[name])
    assert angles(program) == [10.0]
    assert not [note for note in program.notes if note.effect is Effect.MOTIONS]


@pytest.mark.parametrize("begun", [-300, 0, 200])
def test_a_timer_that_was_started_just_before_is_waited_for(begun: int, followed: Follow) -> None:
    started = f"$TIMER[1]={begun}\n$TIMER_STOP[1]=FALSE\nWAIT SEC 0.1\nWAIT FOR $TIMER[1]>500"
    waits = [one.seconds for one in followed(started).commands if isinstance(one, StandStill)]
    assert sum(waits) == pytest.approx((500 - begun) / 1e3)
    unknown = followed("$TIMER_STOP[1]=FALSE\nWAIT FOR $TIMER[1]>500")
    assert any("nobody knows how long" in text for text in texts(unknown))


@pytest.mark.parametrize("name", ["$FILTER", "$SINGUL_POS[1]", "$NEVER_HEARD_OF"])
def test_a_system_variable_that_is_not_modelled_is_listed(name: str, followed: Follow) -> None:
    assert any("isn't modelled" in text for text in texts(followed(f"{name}=1")))


def test_what_a_controller_computes_needs_no_file(followed: Follow) -> None:
    program = followed("DECL INT E\nDECL E6AXIS X\nX=INVERSE($POS_ACT,$AXIS_ACT,E)")
    assert any("INVERSE needs a robot" in text for text in texts(program))
    assert not any("--stub" in text for text in texts(program))


def test_the_worst_assumption_comes_first_and_is_said_once(followed: Follow) -> None:
    lines = "PTP XHOME\nHALT\nDECL INT I\nFOR I=1 TO 3\nH50(I)\nENDFOR\nH50(9)\nHALT\n$SINT_X=1"
    notes = followed(lines).notes
    assert [note.effect for note in notes] == sorted((n.effect for n in notes), reverse=True)
    assert [note.places for note in notes if note.text.startswith("H50")] == [2]
    assert "at 2 places" in str(notes[0])


def test_nothing_is_assumed_of_what_a_program_brings(followed: Follow) -> None:
    lines = (
        "XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\nTOOL_DATA[1]={X 0,Y 0,Z 10,A 0,B 0,C 0}\n"
        "BASE_DATA[2]={X 5,Y 0,Z 0,A 0,B 0,C 0}\nLOAD_DATA[1]={M 9.0}\n$OUT[3]=FALSE\n"
        "READY=TRUE\n$MODE_OP=#EX\n"
        "DEF_VEL_PTP=100\nDEF_VEL_CP=1.0\n"
        "BAS(#INITMOV,0)\nPTP XHOME\nFDAT_ACT={TOOL_NO 1,BASE_NO 2}\nBAS(#FRAMES)\n"
        "IF READY AND NOT $OUT[3] AND ($MODE_OP==#EX) AND $EXT THEN\n"
        "PTP {X 1,Y 2,Z 3,A 0,B 90,C 0}\nENDIF"
    )
    assert texts(followed(lines)) == []


@pytest.mark.parametrize(
    ("stamps", "mm", "said"),
    [
        ("%R 5.4.27,%MKUKATPBASIS", False, "100 %, as before KSS 8.3, whose"),
        ("%V3.2.0,%MKUKATPBASIS", False, "100 %, as before KSS 8.3, whose"),
        ("%R 8.3.38,%MKUKATPBASIS", True, "100 mm, as from KSS 8.3 on, whose"),
        ("%R 5.4.27,%MKUKATPBASIS %R 8.6.1,%MKUKATPBASIS", True, "100 mm, as from KSS 8.3 on;"),
    ],
)
def test_the_home_form_is_that_of_the_version_that_wrote_the_forms(
    stamps: str, mm: bool, said: str, followed: Follow
) -> None:
    lines = (
        f";FOLD PTP HOME Vel=100 % DEFAULT;%{{PE}}{stamps},%CMOVE,%VPTP\n"
        "PDAT_ACT=PDEFAULT\nFDAT_ACT=FHOME\nBAS(#PTP_PARAMS,100)\nPTP XHOME C_DIS\n;ENDFOLD"
    )
    program = followed(f"BAS(#INITMOV,0)\n{lines}")
    (motion,) = program.commands
    assert isinstance(motion, Motion)
    assert motion.blend is not None
    assert motion.blend.distance == pytest.approx(0.1 if mm else 3e-3)
    assert any(f"APO_DIST of {said}" in text for text in texts(program))


@pytest.mark.parametrize(
    ("setting", "moves"), [("$MODE_OP=#EX", [2.0]), ("$T1=TRUE", [1.0]), ("$T2=FALSE", [])]
)
def test_settings_decide(setting: str, moves: list[float]) -> None:
    text = (
        "DEF K( )\nIF $T1 OR $T2 THEN\nPTP {A1 1}\nENDIF\n"
        "IF $MODE_OP==#EX THEN\nPTP {A1 2}\nENDIF\nEND\n"
    )
    program = follow(
        [parse(text, "k.src")], np.zeros(6), np.eye(4), settings=[settings_of([setting])]
    )
    assert angles(program) == moves


def test_a_setting_counts_more_than_a_data_list(followed: Follow) -> None:
    chosen = [settings_of(["; half", "", "N=2", "$IN[3]=TRUE"], "half.txt")]
    lines = "IF $IN[3] THEN\nWAIT SEC N\nENDIF"
    (wait,) = followed(lines, "DECL INT N=8", settings=chosen).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == 2.0
    with pytest.raises(KrlError, match=r"half.txt: 'N 2' is no NAME=VALUE"):
        settings_of(["N 2"], "half.txt")


def test_the_value_of_an_unknown_routine_can_be_set(followed: Follow) -> None:
    lines = "IF KIND( )==3 THEN\nWAIT SEC 3\nENDIF"
    assert followed(lines).commands == ()
    (wait,) = followed(lines, settings=[settings_of(["KIND=3"])]).commands
    assert isinstance(wait, StandStill)


def test_what_an_unknown_routine_was_given_may_have_changed(followed: Follow) -> None:
    """Law: a variable that a routine without a file got is assumed where it is used, until the
    program sets it again.
    """
    lines = "DECL INT n,m\nn=2\nm=3\nASK_PLC(n,m)\nm=4\nWAIT SEC n\nWAIT SEC m"
    program = followed(lines)
    said = [one for one in program.notes if "may get another value" in one.text]
    assert [(one.place.line, one.effect) for one in said] == [(7, Effect.MOTIONS)]
    assert "N may get another value from ASK_PLC: taken as it stands" in said[0].text


@pytest.mark.parametrize("name", ["x", "s.q", "a[2]"])
def test_a_setting_reaches_variables_of_a_routine(name: str, followed: Follow) -> None:
    lines = f"STRUC t INT p,q\nDECL t s\nDECL INT x,a[3]\nWAIT SEC {name}"
    (wait,) = followed(lines, settings=[settings_of([f"{name}=5"])]).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == 5


def test_stubs_are_written_for_what_nobody_gave(followed: Follow) -> None:
    lines = "H50(1,2)\nH50(1)\nIF KIND(4)==3 THEN\nENDIF"
    written = stubs(followed(lines).unknown)
    again = follow(
        [parse(f"DEF T( )\n{lines}\nEND\n", "t.src"), parse(written, "stubs.src")],
        np.zeros(6),
        np.eye(4),
    )
    assert again.unknown == ()
    assert texts(again) == []


ENDED = {  # a wait, what is given: inputs 1 to 3 behind it
    "$IN[1] OR $IN[2]": ({}, "100"),
    "($IN[1]==TRUE) OR $IN[2] OR $IN[3]": ({}, "100"),
    "$IN[1] OR ($IN[2] AND $IN[3])": ({1: False}, "011"),
    "$IN[1] OR $IN[2] OR $IN[3] ": ({3: True}, "001"),
    "NOT ($IN[1] AND $IN[2])": ({1: True}, "100"),
    "NOT $IN[1] OR $IN[2]": ({1: True}, "110"),
}


@pytest.mark.parametrize("condition", ENDED)
def test_a_wait_for_one_of_several_ends_by_one_of_them(condition: str, followed: Follow) -> None:
    """Law: behind a wait its condition holds: by what is given where that does, else its first."""
    inputs, wanted = ENDED[condition]
    read = "\n".join(f"IF $IN[{n}] THEN\nWAIT SEC {n}\nENDIF" for n in (1, 2, 3))
    program = followed(f"WAIT FOR {condition}\n{read}", inputs=inputs)
    waited = {one.seconds for one in program.commands if isinstance(one, StandStill)}
    assert "".join("1" if n in waited else "0" for n in (1, 2, 3)) == wanted


@pytest.mark.parametrize("action", ["n=5", "SETS( )"])
def test_what_a_trigger_sets_is_read_in_advance_and_said(action: str, followed: Follow) -> None:
    """On a controller the advance run may read a variable before the TRIGGER acts."""
    head = (
        f"PTP {{A1 1}}\nn=0\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO {action} PRIO=-1\nPTP {{A1 10}}\n"
    )
    sets = "\nEND\nDEF SETS( )\nn=5"
    read = followed(f"{head}IF n==5 THEN\nPTP {{A1 20}}\nENDIF{sets}", "DECL INT n")
    others = [
        followed(f"{head}{between}\nIF n==5 THEN\nPTP {{A1 20}}\nENDIF{sets}", "DECL INT n")
        for between in ("n=5", "WAIT SEC 0", "WAIT FOR $IN[1]", "$OUT[1]=TRUE", "HALT")
    ]
    said = ["N is set by a TRIGGER" in " ".join(texts(one)) for one in (read, *others)]
    assert said == [True, *[False] * 5]
    assert all(angles(one) == [1.0, 10.0, 20.0] for one in others)


WAITED = {  # a wait, what is set before, and whether the program itself keeps it from ending
    "$FLAG[1]": ("$FLAG[1]=FALSE", True),
    "$FLAG[1]==TRUE": ("$FLAG[1]=FALSE", True),
    "NOT $FLAG[1]": ("$FLAG[1]=TRUE", True),
    "ready AND NOT busy": ("ready=FALSE\nbusy=TRUE", True),
    "ready OR busy": ("ready=FALSE\nbusy=TRUE", False),
    "ready AND NOT $IN[4]": ("ready=FALSE", True),
    "busy AND NOT $IN[4]": ("busy=TRUE", False),
}


@pytest.mark.parametrize("condition", WAITED)
def test_a_flag_that_was_waited_for_is_as_it_was_waited_for(
    condition: str, followed: Follow
) -> None:
    """Law: a wait that nothing in the program ends is taken as ended, and said; what follows sees
    it as it then is.
    """
    before, endless = WAITED[condition]
    lines = f"DECL BOOL ready,busy\n{before}\nWAIT FOR {condition}\nIF {condition} THEN\n"
    program = followed(f"{lines}PTP {{A1 10}}\nENDIF", inputs={4: False})
    assert ("this wait never ends" in " ".join(texts(program))) is endless
    assert angles(program) == [10.0]


def test_an_input_that_was_waited_for_is_as_it_was_waited_for(followed: Follow) -> None:
    waited = "WAIT FOR $IN[1] AND NOT ($IN[2] OR ($IN[3]==TRUE)) AND ($IN[4]<>FALSE)"
    lines = f"{waited}\nIF $IN[1] AND NOT $IN[2] AND NOT $IN[3] AND $IN[4] THEN\nWAIT SEC 1\nENDIF"
    program = followed(lines)
    assert isinstance(program.commands[-1], StandStill)
    assert texts(program) == []


LOOPS = {  # what is followed of loops: motions by A1
    "an input ends it": ("WHILE NOT $IN[1]\nPTP {A1 1}\nENDWHILE", [1.0]),
    "an input that isn't there": ("REPEAT\nPTP {A1 1}\nUNTIL $IN[1]", [1.0]),
    "the operator ends it": ("LOOP\nPTP {A1 1}\nENDLOOP", [1.0]),
    "WHILE TRUE": ("WHILE TRUE\nPTP {A1 1}\nENDWHILE", [1.0]),
    "an exit by an input": ("LOOP\nPTP {A1 1}\nIF $IN[1] THEN\nEXIT\nENDIF\nENDLOOP", [1.0]),
    "a count ends it": (
        "N=0\nWHILE TRUE\nN=N+1\nPTP {A1 N}\nIF N==3 THEN\nEXIT\nENDIF\nENDWHILE",
        [1.0, 2.0, 3.0],
    ),
    "a count, beside an input": (
        "N=0\nWHILE N<3\nN=N+1\nIF $IN[1] THEN\nRETURN\nENDIF\nPTP {A1 N}\nENDWHILE",
        [1.0, 2.0, 3.0],
    ),
    "nothing changes": ("N=1\nREPEAT\nPTP {A1 N}\nUNTIL N>1", [1.0]),
    "a jump back for ever": ("TOP:\nPTP {A1 1}\nGOTO TOP", [1.0]),
    "a jump back by an input": ("TOP:\nPTP {A1 1}\nIF NOT $IN[1] THEN\nGOTO TOP\nENDIF", [1.0]),
    "a jump back that counts": (
        "N=0\nTOP:\nN=N+1\nPTP {A1 N}\nIF N<3 THEN\nGOTO TOP\nENDIF\nPTP {A1 9}",
        [1.0, 2.0, 3.0, 9.0],
    ),
    "a jump back that counts, beside an input": (
        "N=0\nTOP:\nN=N+1\nIF $IN[1] THEN\nGOTO ENDS\nENDIF\nPTP {A1 N}\nIF N<3 THEN\nGOTO TOP\n"
        "ENDIF\nENDS:",
        [1.0, 2.0, 3.0],
    ),
    "nothing stands behind a loop that nothing leaves": (
        "LOOP\nPTP {A1 1}\nENDLOOP\nPTP {A1 2}",
        [1.0],
    ),
    "nor behind a jump back": ("TOP:\nPTP {A1 1}\nGOTO TOP\nPTP {A1 2}", [1.0]),
    "what stands behind a loop that an input ends": (
        "LOOP\nPTP {A1 1}\nIF $IN[1] THEN\nEXIT\nENDIF\nENDLOOP\nPTP {A1 2}",
        [1.0, 2.0],
    ),
    "jumps forward": ("PTP {A1 1}\nGOTO DONE\nPTP {A1 2}\nDONE:\nPTP {A1 3}", [1.0, 3.0]),
    "a jump out of branches": (
        "FOR I=1 TO 5\nPTP {A1 I}\nIF I==2 THEN\nGOTO DONE\nENDIF\nENDFOR\nDONE:\nPTP {A1 9}",
        [1.0, 2.0, 9.0],
    ),
}


@pytest.mark.parametrize("name", LOOPS)
def test_loops_and_jumps_are_followed_as_far_as_they_are_known(name: str, followed: Follow) -> None:
    lines, expected = LOOPS[name]
    assert angles(followed(lines)) == expected


def test_a_program_initialises_itself_where_it_isnt_on_its_path_yet(followed: Follow) -> None:
    lines = "CONTINUE\nIF NOT $ON_PATH THEN\nBAS(#INITMOV,0)\nENDIF\nPTP {A1 1} C_PTP\nPTP {A1 2}"
    first, _ = followed(lines).commands
    assert isinstance(first, Motion)
    assert first.blend is not None
    assert first.blend.share == 0.5


def test_arrays_arrive_as_parameters(followed: Follow) -> None:
    text = (
        "DEF T( )\nE6AXIS WAY[2]\nWAY[1]={A1 10}\nWAY[2]={A1 20}\nDRIVE(WAY[],2)\nEND\n"
        "DEF DRIVE(P[]:OUT,N:IN)\nE6AXIS P[]\nINT N,I\nFOR I=1 TO N\nPTP P[I]\nENDFOR\nEND\n"
    )
    assert angles(follow([parse(text, "t.src")], np.zeros(6), np.eye(4))) == [10.0, 20.0]


def test_kinematics_are_computed_both_ways(planner: Planner) -> None:
    """Law: INVERSE of FORWARD is where it began, and the error is 0; what is out of reach is 1."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        taught = np.array([10, -80, 80, 30, 40, 50])
        wanted = np.round(taught + rng.uniform(-15, 15, 6), 2)
        written = ",".join(f"A{k + 1} {one}" for k, one in enumerate(wanted))
        lines = (
            f"DECL E6AXIS q,back\nDECL INT e,far\nDECL E6POS p\n$TOOL=$NULLFRAME\n"
            f"$TOOL.Z=120\n$BASE.X=300\nq={{{written}}}\np=FORWARD(q,e)\n"
            "back=INVERSE(p,q,e)\nPTP back\nWAIT SEC 1+e\np.X=99000\nback=INVERSE(p,q,far)\n"
            "WAIT SEC far"
        )
        program = follow_krl(planner, [parse(f"DEF P( )\n{lines}\nEND\n", "p.src")])
        motion, *waits = program.commands
        assert isinstance(motion, Motion)
        assert motion.target.axes is not None
        found = np.degrees([motion.target.axes[f"A{k}"] for k in range(1, 7)])
        assert found == pytest.approx(wanted, abs=1e-3)
        assert [one.seconds for one in waits if isinstance(one, StandStill)] == [1, 1]


def test_where_the_robot_stands_is_known(planner: Planner) -> None:
    """$POS_ACT and $AXIS_ACT are where the last motion has led, in $BASE and $TOOL."""
    lines = (
        "PTP {A1 20,A2 -80,A3 90,A4 0,A5 40,A6 0}\nP=$POS_ACT\nQ=$AXIS_ACT\n"
        "P.Z=P.Z+100\nQ.A1=Q.A1+5\nLIN P\nPTP Q\n"
    )
    program = follow_krl(planner, [parse(f"DEF T( )\n{lines}END\n", "t.src")])
    first, line, back = (one for one in program.commands if isinstance(one, Motion))
    assert first.target.axes is not None
    assert back.target.axes is not None
    assert back.target.axes["A1"] == pytest.approx(np.radians(25.0))
    assert line.target.frame is not None
    chain = planner.scene("none").chain
    q = np.array([first.target.axes[f"A{k}"] for k in range(1, 7)])
    tcp = chain.tcp_poses(q[None])[0, :3, 3]
    foot = chain.base_pose
    there = foot[:3, :3].T @ (tcp - foot[:3, 3])
    found = [line.target.frame[name] for name in "XYZ"]
    assert found == pytest.approx([*(1e3 * there[:2]), 1e3 * there[2] + 100.0], abs=1e-3)


def project(folder: Path) -> Path:
    """A robot's folder as a controller keeps it, with a copy of a module that isn't meant."""
    files = {
        "KRC/R1/Program/cell1/main.src": "DEF MAIN( )\nPTP XP1\nPICK( )\nDONE=TRUE\nEND\n",
        "KRC/R1/Program/cell1/main.dat": "DEFDAT MAIN\nE6AXIS XP1={A1 7}\nENDDAT\n",
        "KRC/R1/Program/cell1/pick.src": "DEF PICK( )\nPTP {A1 8}\nWAIT SEC GAP\nEND\n",
        "KRC/R1/Program/old/pick.src": "DEF PICK( )\nPTP {A1 80}\nEND\n",
        "KRC/R1/Program/old/broken.src": "DEF BROKEN( )\nPTP {A1\nEND\n",
        "KRC/R1/System/$config.dat": "DEFDAT $CONFIG\nDECL REAL GAP=0.5\nENDDAT\n",
        "KRC/R1/System/bas.src": "DEF BAS(C:IN,V:IN)\nPTP {A1 99}\nEND\n",
        "KRC/R1/Mada/$machine.dat": "DEFDAT $MACHINE\nWHAT EVER THIS IS\nENDDAT\n",
    }
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("archived", [False, True])
def test_the_modules_of_a_project_are_one_program(tmp_path: Path, archived: bool) -> None:
    path = project(tmp_path / "robot")
    if archived:
        path = tmp_path / "robot.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for one in sorted((tmp_path / "robot").rglob("*.*")):
                archive.write(one, one.relative_to(tmp_path / "robot"))
    found = read_project(path)
    sources, left_out = found.sources(found.main("MAIN"))
    program = follow(sources, np.zeros(6), np.eye(4))
    assert angles(program) == [7.0, 8.0]
    assert [one.seconds for one in program.commands if isinstance(one, StandStill)] == [0.5]
    assert sum("broken.src:2:" in str(note) for note in left_out) == 1
    others = [str(note) for note in left_out if "has the same name and is nearer" in str(note)]
    assert len(others) == len(left_out) - 1 == 1, left_out


def test_a_folder_names_its_programs_and_its_robots(tmp_path: Path) -> None:
    path = project(tmp_path / "robot")
    with pytest.raises(KrlError, match=r"2 programs: give --routine or one of .*broken.src"):
        read_project(path).main()
    (path / "KRC/R1/Program/old/broken.src").unlink()
    assert read_project(path).main().module == "MAIN"
    (path / "KRC/R2/Program").mkdir(parents=True)
    (path / "KRC/R2/Program/other.src").write_text("DEF OTHER( )\nEND\n", encoding="utf-8")
    with pytest.raises(KrlError, match="programs of 2 robots: R1, R2; give the folder of one"):
        read_project(path)


def test_import_takes_a_folder_and_says_what_it_assumed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = project(tmp_path / "robot")
    source = path / "KRC/R1/Program/cell1/pick.src"
    source.write_text("DEF PICK( )\nPTP {A1 8}\nIF WARM THEN\nGLUE(1)\nENDIF\nEND\n", "utf-8")
    stub = tmp_path / "stub.src"
    command = ["krl", "import", str(path), "--cell", "open", "--routine", "main"]
    assert main([*command, "--set", "WARM=TRUE", "--stub", str(stub)]) == 0
    said = capsys.readouterr().out
    assert "GLUE isn't in the files: no motion" in said
    assert "broken.src:2:" in said
    assert "GLOBAL DEF GLUE(A1:IN)" in stub.read_text("utf-8")
    assert main(command) == 0
    assert "WARM has no value: taken as FALSE" in capsys.readouterr().out


def test_a_module_brings_the_data_that_lie_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = project(tmp_path / "robot") / "KRC/R1/Program/cell1"
    assert main(["krl", "import", str(path / "main.src"), "--cell", "open"]) == 0
    assert "MAIN: " in capsys.readouterr().out


def test_outputs_of_an_unknown_routine_are_none(followed: Follow) -> None:
    assert not any(isinstance(one, SetOutput) for one in followed("GRIP(TRUE)").commands)


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_archive_is_read_or_is_one_sentence(tmp_path: Path, seed: int) -> None:
    """Cut off, with other bytes, or no archive at all: never another exception."""
    draw = np.random.default_rng(seed)
    path = tmp_path / "robot.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("main.src", "other.src", "main.dat"):
            archive.writestr(f"KRC/R1/Program/{name}", f"DEF {name[:4]}()\n" + "; x\n" * 200)
    content = bytearray(path.read_bytes())
    for place in draw.integers(0, len(content), 1 + seed % 8):
        content[place] = draw.integers(0, 256)
    path.write_bytes(content[: draw.integers(0, len(content))] if seed % 3 == 0 else content)
    said = ""
    try:
        read_project(path)
    except KrlError as error:
        said = str(error)
    assert "\n" not in said


def test_the_data_list_beside_a_file_has_its_name_in_any_case(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "prog.src").write_text("DEF PROG( )\nPTP XHOME\nPTP P1\nEND\n")
    there = "{A1 5,A2 -90,A3 90,A4 0,A5 10,A6 0}"
    (tmp_path / "PROG.DAT").write_text(f"DEFDAT PROG\nDECL E6AXIS P1={there}\nENDDAT\n")
    assert main(["krl", "import", str(tmp_path / "prog.src"), "--cell", "open"]) == 0
    assert "P1" not in capsys.readouterr().err


def test_a_project_says_why_no_program_is_found(tmp_path: Path) -> None:
    database = tmp_path / "cell.wvs"
    database.write_bytes(bytes(16) + bytes.fromhex("9d7b3500") + bytes(4096))
    with pytest.raises(KrlError, match="WorkVisual's database, no archive: give the folder"):
        read_project(database)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "p.src").write_text("DEF P( )\nPTP XHOME\nEND\n")
    with pytest.raises(KrlError, match=r"p is in 2 files, give one: a/p\.src, b/p\.src"):
        read_project(tmp_path).main("p")
    with pytest.raises(KrlError, match=r"no file has a routine q: a/p\.src, b/p\.src"):
        read_project(tmp_path).main("q")
    (tmp_path / "b" / "p.src").write_text("DEF P( )\nLOOP\nEND\n")
    with pytest.raises(KrlError, match=r"no file has a routine q: b/p\.src:3:1: "):
        read_project(tmp_path).main("q")


def test_a_loop_is_followed_once_at_least(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.src").write_text("DEF P( )\nPTP XHOME\nEND\n")
    words = ["krl", "import", str(tmp_path / "p.src"), "--cell", "open", "--loop-passes", "0"]
    assert main(words) == 2
    assert "--loop-passes 0: a loop is followed once at least" in capsys.readouterr().err


BESIDE = {  # lines of the program: A1 of its motions, whether the submit program is named
    "IF ready THEN\nPTP {A1 10}\nENDIF\nPTP {A1 20}": ([20], True),
    "ready=TRUE\nIF ready THEN\nPTP {A1 10}\nENDIF": ([10], False),
    "LOOP\nIF ready THEN\nEXIT\nENDIF\nPTP {A1 5}\nENDLOOP\nPTP {A1 20}": ([5, 20], True),
    "DECL BOOL ready\nready=TRUE\nIF ready THEN\nPTP {A1 10}\nENDIF": ([10], False),
    "PTP {A1 count}": ([7], False),
}


@pytest.mark.parametrize("lines", BESIDE)
def test_what_the_submit_program_sets_is_assumed(lines: str) -> None:
    sources = [
        parse(f"DEF P( )\n{lines}\nEND\n", "p.src"),
        parse("DEFDAT $CONFIG\nDECL BOOL ready=FALSE\nDECL INT count=7\nENDDAT\n", "$config.dat"),
        parse("DEF SPS( )\nLOOP\nready=$IN[7]\n$OUT[1]=TRUE\nENDLOOP\nEND\n", "sps.sub"),
    ]
    program = follow(sources, np.zeros(6), np.eye(4))
    moves, named = BESIDE[lines]
    assert angles(program) == moves
    said = "READY is set by sps.sub: taken as it is at the start"
    assert (said in texts(program)) is named


@pytest.mark.parametrize(
    "form",
    [
        "SPTP XP1 WITH $TOOL=STOOL2(FP1),$BASE=SBASE(FP1.BASE_NO)",
        "PTP XHOME\nSLIN XP1 WITH $BASE=SBASE(FP1.BASE_NO),$TOOL=STOOL2(FP1)",
        "$TOOL=STOOL(14)\n$BASE=SBASE(5)\nPTP XP1",
        "$TOOL=TOOL_DATA[14]\n$BASE=BASE_DATA[5]\nPTP XP1",
        "FDAT_ACT=FP1\nBAS(#FRAMES)\nPTP XP1",
        "BAS(#TOOL,14)\nBAS(#BASE,5)\nPTP XP1",
    ],
)
def test_frames_without_data_are_assumed_in_every_form(form: str, followed: Follow) -> None:
    """Inline forms of KSS 8.3 took the cell's tool and the robot's foot without a word."""
    data = (
        "DECL E6POS XP1={X 1500,Y 0,Z 1200,A 0,B 90,C 0,S 2,T 10}\n"
        "DECL FDAT FP1={TOOL_NO 14,BASE_NO 5,IPO_FRAME #BASE}"
    )
    said = {note.text for note in followed(form, data).notes if note.effect == Effect.PLACES}
    missing = {
        "TOOL_DATA[14] isn't in the files: the cell's tool",
        "BASE_DATA[5] isn't in the files: the robot's foot",
    }
    assert said >= missing
    assert not any("chosen" in text for text in said)
    given = f"TOOL_DATA[14]={{X 0,Y 0,Z 90}}\nBASE_DATA[5]={{X 10,Y 0,Z 0}}\n{data}"
    assert not missing & {note.text for note in followed(form, given).notes}
