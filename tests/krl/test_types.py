"""Types of variables: what an INT, a REAL and a component hold, however they are declared."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from ir_krl import Followed, Motion, follow, parse
from ir_krl.errors import KrlRunError
from ir_krl.run import Effect, StandStill

Follow = Callable[..., Followed]
ROBOT = (np.zeros(6), np.eye(4))  # home and tool

# how a variable of the type {k} gets the value {v}; then it is `x`, of which half is waited for
DECLARED = {
    "at once": ("DECL {k} x={v}", "", "x"),
    "and set later": ("DECL {k} x\nx={v}", "", "x"),
    "in a data list": ("", "DECL {k} x={v}", "x"),
    "in a data list and set later": ("x={v}", "DECL {k} x", "x"),
    "as an element": ("DECL {k} a[3]\na[2]={v}", "", "a[2]"),
    "as an element of a data list": ("", "DECL {k} a[3]\na[2]={v}", "a[2]"),
    "as a component": ("STRUC t BOOL b, {k} p,q\nDECL t s\ns.q={v}", "", "s.q"),
    "in an aggregate": ("STRUC t {k} p,BOOL b\nDECL t s\ns={{b TRUE,p {v}}}", "", "s.p"),
    "in a structure of structures": (
        "STRUC t u inner\nSTRUC u {k} p\nDECL t s[2]\ns[2].inner.p={v}",
        "",
        "s[2].inner.p",
    ),
    "by a setting": ("DECL {k} y\ny=x", "DECL {k} x={v}", "y"),
}
HELD = {  # type, value as written: what the variable holds
    ("REAL", "5"): 5.0,
    ("REAL", "7.5"): 7.5,
    ("INT", "5"): 5,
    ("INT", "2.4"): 2,
    ("INT", "2.5"): 3,
    ("INT", "3.5"): 4,
    ("INT", "2.6"): 3,
}


def half(value: float) -> float:
    """Of an INT without a rest."""
    return value // 2 if isinstance(value, int) else value / 2


@pytest.mark.parametrize("held", HELD, ids=" ".join)
@pytest.mark.parametrize("way", DECLARED)
def test_a_variable_holds_what_its_type_holds(
    way: str, held: tuple[str, str], followed: Follow
) -> None:
    """Law: X/2 follows from the declared type alone, never from how a value was written."""
    kind, written = held
    lines, data, name = (one.format(k=kind, v=written) for one in DECLARED[way])
    *_, wait = followed(f"{lines}\nWAIT SEC {name}/2\nWAIT SEC 99", data).commands[:-1]
    assert isinstance(wait, StandStill)
    assert wait.seconds == half(HELD[held])


@pytest.mark.parametrize("held", HELD, ids=" ".join)
@pytest.mark.parametrize("kept", ["F(x :IN)", "F(x :OUT)", "F(x)"])
def test_parameters_and_results_have_types(held: tuple[str, str], kept: str) -> None:
    kind, written = held
    text = (
        f"DEF P( )\nWAIT SEC {kept.split('(', 1)[0]}({written})/2\nEND\n"
        f"DEFFCT {kind} {kept}\nDECL {kind} x\nDECL REAL y\ny=x\nRETURN y\nENDFCT\n"
    )
    (wait,) = follow([parse(text, "p.src")], *ROBOT).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == half(HELD[held])


POSITIONS = {  # declared as, what it holds of a whole position
    "FRAME": set("XYZABC"),
    "POS": set("XYZABCST"),
    "E6POS": {*"XYZABCST", "E1"},
}


@pytest.mark.parametrize("kind", POSITIONS)
def test_a_position_holds_what_its_type_has(kind: str, followed: Follow) -> None:
    data = "DECL E6POS whole={X 9,Y 2,Z 3,A 4,B 5,C 6,S 2,T 10,E1 0}"
    program = followed(f"DECL {kind} p\np=whole\np.x=p.x/2\nPTP p\nLIN p", data)
    ptp, lin = (one for one in program.commands if isinstance(one, Motion))
    assert ptp.target.frame is not None
    assert ptp.target.frame["X"] == 4.5
    assert (ptp.target.status is None) is ("S" not in POSITIONS[kind])
    assert (ptp.target.turn is None) is ("T" not in POSITIONS[kind])
    assert lin.target.frame == ptp.target.frame


def test_an_axis_is_a_real(followed: Follow) -> None:
    program = followed("q.a1=q.a1/2\nPTP q", "DECL E6AXIS q={A1 5,A2 -90,A3 90,A4 0,A5 0,A6 0}")
    (motion,) = program.commands
    assert isinstance(motion, Motion)
    assert motion.target.axes is not None
    assert motion.target.axes["A1"] == pytest.approx(0.043633, abs=1e-6)


OPERATIONS = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}


@pytest.mark.parametrize("sign", OPERATIONS)
def test_reals_are_of_single_precision(sign: str, followed: Follow) -> None:
    """Law: a sum, a product, a comparison of REALs is that of IEEE 754 single precision."""
    rng = np.random.default_rng(29)
    for _ in range(12):
        a, b = np.round(rng.uniform(0.1, 9.0, 2), 2)
        wanted = OPERATIONS[sign](np.float32(a), np.float32(b))
        lines = f"x={a}{sign}{b}\ny={abs(wanted):.9g}\nIF ABS(x)==y THEN\nWAIT SEC 1\nENDIF"
        program = followed(f"DECL REAL x,y\n{lines}")
        assert [type(one) for one in program.commands] == [StandStill]


KEPT = {  # lines that end in WAIT SEC of one second where they compute as a controller does
    "a tenth, added": "x=0.1\ny=x+0.2\nIF y==0.3 THEN\nWAIT SEC 1\nENDIF",
    "a large INT as a REAL": "n=16777217\nx=16777216\nIF n==x THEN\nWAIT SEC 1\nENDIF",
    "the least INT": "n='H80000000'\nIF n==-2147483647-1 THEN\nWAIT SEC 1\nENDIF",
    "a letter's number": 'c=65\nIF c=="A" THEN\nWAIT SEC 1\nENDIF',
    "a letter as a number": 'c="A"\nIF c==65 THEN\nWAIT SEC 1\nENDIF',
    "a letter in an INT": 'c="7"\nn=c\nWAIT SEC n/55',
    "a letter in an INT of an array": 's[]="7"\nm[2]=s[1]\nWAIT SEC m[2]/55',
    "a digit that a text begins with": 's[]="7"\nn=s[1]-48\nWAIT SEC n/7',
    "the letter behind another": 'c="A"\nc=c+1\nIF c=="B" THEN\nWAIT SEC 1\nENDIF',
    "letters by their order": 'c="b"\nIF (c>"a") AND (c<99) THEN\nWAIT SEC 1\nENDIF',
    "a letter among numbers": 'c="3"\nSWITCH c\nCASE 51\nWAIT SEC 1\nENDSWITCH',
    "a text of letters": 's[1]="O"\ns[2]="K"\nIF s[]=="OK" THEN\nWAIT SEC 1\nENDIF',
    "a text that was never set": 'IF s[]=="" THEN\nWAIT SEC 1\nENDIF',
    "the length of a text": 's[]="four"\nWAIT SEC StrLen(s[])/4',
    "a text in a text": 's[]="kilogram"\nWAIT SEC StrFind(1,s[],"GRAM",#NOT_CASE_SENS)/5',
    "a text behind a place": 's[]="aba"\nWAIT SEC StrFind(2,s[],"a",#CASE_SENS)/3',
    "texts that differ by case": (
        's[]="ok"\nIF StrComp(s[],"OK",#NOT_CASE_SENS) EXOR StrComp(s[],"OK",#CASE_SENS) THEN\n'
        "WAIT SEC 1\nENDIF"
    ),
    "a text copied and added to": (
        'n=StrAdd(s[],"ab")\nb=StrCopy(s[],"xy")\nn=StrAdd(s[],"z")\n'
        'IF s[]=="xyz" THEN\nWAIT SEC n/3\nENDIF'
    ),
    "a text cleared": 's[]="a"\nb=StrClear(s[])\nWAIT SEC 1+StrLen(s[])',
}


@pytest.mark.parametrize("name", KEPT)
def test_numbers_and_texts_decide_as_on_a_controller(name: str, followed: Follow) -> None:
    head = "DECL REAL x,y\nDECL INT n,m[2]\nDECL BOOL b\nDECL CHAR c,s[20]\n"
    (wait,) = followed(head + KEPT[name]).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == 1


STOPPED = {  # what a controller stops at, and what is said
    "n=2147483647+1": "an INT is from -2147483648 to 2147483647",
    "n=-n-2": "an INT is from",
    "n=3.0E9": "an INT is from",
    "x=1.0E38*1.0E3": "a REAL is at most",
    "a[3]=1": "A[3] isn't in A[2]",
    "n=a[0]": "the first element is [1]",
    "m[2,4]=1": "M[2, 4] isn't in M[2, 3]",
    "c=256": "a CHAR is from 0 to 255; this one is 256",
    "n=m[2]": "M[2] isn't in M[2, 3]",
    "FILL(a[])": "W[3] isn't in W[2]",
}


@pytest.mark.parametrize("line", STOPPED)
def test_what_a_variable_cannot_hold_is_refused_at_its_place(line: str) -> None:
    head = "DEF P( )\nDECL INT n,a[2],m[2,3]\nDECL REAL x\nDECL CHAR c\nn=2147483647\n"
    fill = "DEF FILL(w[]:OUT)\nINT w[]\nINT k\nFOR k=1 TO 3\nw[k]=k\nENDFOR\nEND\n"
    with pytest.raises(KrlRunError, match=re.escape(STOPPED[line])) as caught:
        follow([parse(f"{head}{line}\nEND\n{fill}", "p.src")], *ROBOT)
    assert caught.value.place.line == (12 if "FILL" in line else 6)


def test_a_text_that_doubles_itself_is_refused_before_it_fills_the_memory() -> None:
    lines = 'DEF P( )\nDECL INT n,k\nDECL CHAR s[9]\ns[]="ab"\nFOR k=1 TO 90\nn=StrAdd(s[],s[])\n'
    with pytest.raises(KrlRunError, match="16384 letters: at most 10000") as caught:
        follow([parse(lines + "ENDFOR\nEND\n", "p.src")], *ROBOT)
    assert caught.value.place.line == 6


COUNTED = {  # lines of a loop over I: what it waits for, and what I holds behind it
    "FOR i=1 TO 3\nWAIT SEC i\nENDFOR": ([1, 2, 3], 4),
    "FOR i=3 TO 1 STEP -1\nWAIT SEC i\nENDFOR": ([3, 2, 1], 0),
    "FOR i=1 TO 6\nWAIT SEC i\ni=i+1\nENDFOR": ([1, 3, 5], 7),
    "FOR i=1 TO 9\nWAIT SEC i\ni=9\nENDFOR": ([1], 10),
    "FOR i=5 TO 1\nWAIT SEC i\nENDFOR": ([], 5),
    "FOR i=1 TO 9\nIF i==2 THEN\nEXIT\nENDIF\nWAIT SEC i\nENDFOR": ([1], 2),
}


@pytest.mark.parametrize("lines", COUNTED)
def test_for_counts_by_its_variable(lines: str, followed: Follow) -> None:
    waits, behind = COUNTED[lines]
    program = followed(f"DECL INT i\n{lines}\nWAIT SEC 10+i")
    assert [one.seconds for one in program.commands if isinstance(one, StandStill)] == [
        *waits,
        10 + behind,
    ]


def test_a_parameter_without_a_direction_goes_back_and_says_so() -> None:
    text = (
        "DEF P( )\nDECL INT n\nn=1\nSAME(n)\nWAIT SEC n\nNEW(n)\nWAIT SEC n\nEND\n"
        "DEF SAME(k)\nDECL INT k\nk=k\nEND\nDEF NEW(k)\nDECL INT k\nk=7\nEND\n"
    )
    program = follow([parse(text, "p.src")], *ROBOT)
    assert [one.seconds for one in program.commands if isinstance(one, StandStill)] == [1, 7]
    said = "K of NEW has neither :IN nor :OUT: taken as :OUT"
    assert [note.effect for note in program.notes if note.text == said] == [Effect.MOTIONS]
    assert len(program.notes) == 1


def test_two_modules_have_variables_of_one_name() -> None:
    """A variable of a data list without a value is its module's own, too."""
    texts = [
        parse("DEF P( )\nn=2\nOTHER( )\nWAIT SEC n\nEND\n", "p.src"),
        parse("DEFDAT P\nDECL INT n\nENDDAT\n", "p.dat"),
        parse("DEF OTHER( )\nn=9\nEND\n", "other.src"),
        parse("DEFDAT OTHER\nDECL INT n\nENDDAT\n", "other.dat"),
    ]
    (wait,) = follow(texts, *ROBOT).commands
    assert isinstance(wait, StandStill)
    assert wait.seconds == 2


def test_rows_of_texts_are_set_as_every_configuration_sets_them(followed: Follow) -> None:
    """TOOL_NAME[1,]: the text of a row, within the rows that are declared."""
    data = 'DECL CHAR NAMES[3,24]\nNAMES[1,]="gear"\nNAMES[3,]="none"'
    program = followed("WAIT SEC STRLEN(NAMES[1,])", data)
    assert [one.seconds for one in program.commands if isinstance(one, StandStill)] == [4.0]
    with pytest.raises(KrlRunError, match=r"NAMES\[4\] isn't in NAMES\[3, 24\]"):
        followed('NAMES[4,]="gear"', data)
