"""Types of variables: what an INT, a REAL and a component hold, however they are declared."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ir_krl import Effect, Followed, Motion, Wait, follow, parse

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
    assert isinstance(wait, Wait)
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
    assert isinstance(wait, Wait)
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
    assert [one.seconds for one in program.commands if isinstance(one, Wait)] == [
        *waits,
        10 + behind,
    ]


def test_a_parameter_without_a_direction_goes_back_and_says_so() -> None:
    text = (
        "DEF P( )\nDECL INT n\nn=1\nSAME(n)\nWAIT SEC n\nNEW(n)\nWAIT SEC n\nEND\n"
        "DEF SAME(k)\nDECL INT k\nk=k\nEND\nDEF NEW(k)\nDECL INT k\nk=7\nEND\n"
    )
    program = follow([parse(text, "p.src")], *ROBOT)
    assert [one.seconds for one in program.commands if isinstance(one, Wait)] == [1, 7]
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
    assert isinstance(wait, Wait)
    assert wait.seconds == 2
