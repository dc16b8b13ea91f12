"""KRL programs made around motions that are known: what is read of them must be these."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from _results import Claim, at_least, at_most

from ir_krl import KrlError, Motion, follow, parse
from ir_krl.run import Effect, SetOutput, StandStill
from ir_values.arrays import FloatArray

PROGRAMS = 300
QUICK_PROGRAMS = 60
PHRASES = (6, 14)  # of a program, at least and fewer than
_SAME = 1e-6  # mm, deg, shares
_LETTERS = "XYZABC"

Truth = tuple[Any, ...]
"""("axes", six [deg], share of speed), ("place", six [mm, deg], base [mm], m/s, blended [mm]),
("wait", s), ("out", number, value).
"""


@dataclass(frozen=True)
class HiddenRow:
    """One program: its lines, what was known, and what became of it."""

    seed: int
    lines: int
    known: int
    verdict: str
    said: str = ""


class Hidden:
    """A program that grows by phrases, each with what a controller does in it."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng((41, seed))
        self.lines = ["BAS(#INITMOV,0)"]
        self.data: list[str] = []
        self.routines: list[str] = []
        self.truth: list[Truth] = []
        self.speed = 100.0  # %
        self.velocity = 2.0  # m/s
        self.base = (0.0, 0.0, 0.0)
        self.distance = 3.0  # mm
        self._count = 0
        self._ptp(self._axes())
        phrases: list[Callable[[], None]] = [
            self.pallet,
            self.choice,
            self.enumerated,
            self.parameters,
            self.function,
            self.counted,
            self.jump,
            self.signals,
            self.inline_form,
            self.composed,
            self.rounding,
            self.frames,
            self.records,
            self.triggered,
        ]
        for _ in range(int(self.rng.integers(*PHRASES))):
            phrases[int(self.rng.integers(len(phrases)))]()

    @property
    def source(self) -> str:
        """The .src, in cases and with comments as people write them."""
        text = "\n".join(["DEF HIDDEN( )", *self.lines, "END", *self.routines, ""])
        spelled = text.lower() if self.rng.random() < 0.5 else text
        return f"&ACCESS RVP\n&REL 7\n{spelled}"

    @property
    def lists(self) -> str:
        """The .dat."""
        return "\n".join(["DEFDAT HIDDEN PUBLIC", *self.data, "ENDDAT", ""])

    def _name(self, word: str) -> str:
        self._count += 1
        return f"{word}{self._count}"

    def _whole(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, high))

    def _axes(self) -> list[int]:
        return [self._whole(-60, 60), -90, 90, 0, self._whole(10, 40), self._whole(-90, 90)]

    def _point(self) -> tuple[str, list[int]]:
        """A point of the data list, whole numbers without a dot as hands write them."""
        name = self._name("XP")
        values = [self._whole(900, 1500), self._whole(-400, 400), self._whole(600, 1200), 0, 90, 0]
        written = ",".join(f"{n} {v}" for n, v in zip(_LETTERS, values, strict=True))
        self.data.append(f"DECL E6POS {name}={{{written},S 2,T 10,E1 0,E2 0}}")
        return name, values

    def _ptp(self, axes: list[int]) -> None:
        written = ",".join(f"A{k} {v}" for k, v in enumerate(axes, 1))
        self.lines.append(f"PTP {{{written}}}")
        self._known_axes(axes)

    def _known_axes(self, axes: list[int]) -> None:
        self.truth.append(("axes", [float(v) for v in axes], self.speed / 100.0))

    def _known_place(self, values: list[float], blended: float | None = None) -> None:
        self.truth.append(("place", values, self.base, self.velocity, blended))

    def pallet(self) -> None:
        """Rows and columns about a corner, with whole numbers that are divided as REALs."""
        name, at = self._point()
        rows = self._whole(1, 4)
        columns = self._whole(1, 4)
        pitch = self._whole(50, 120)
        lift = self._whole(101, 199)
        p = self._name("P")
        r = self._name("R")
        c = self._name("C")
        self.data += [f"DECL E6POS {p}", f"DECL REAL {p}LIFT={lift}", f"DECL INT {r},{c}"]
        self.lines += [f"FOR {r}=1 TO {rows}", f"FOR {c}={columns} TO 1 STEP -1", f"{p}={name}"]
        self.lines += [f"{p}.X={p}.X+({r}-1)*{pitch}", f"{p}.Y={p}.Y-{pitch}*({c}-1)/4"]
        self.lines += [f"{p}.Z={p}.Z+{p}LIFT/2", f"LIN {p}", f"LIN {name}", "ENDFOR", "ENDFOR"]
        for row in range(rows):
            for column in reversed(range(columns)):
                quarter = (pitch * column) // 4  # INT by INT
                self._known_place([at[0] + row * pitch, at[1] - quarter, at[2] + lift / 2, *at[3:]])
                self._known_place([*map(float, at)])

    def choice(self) -> None:
        """IF and ELSE by numbers that are known, nested."""
        n = self._name("N")
        value = self._whole(-3, 4)
        first, second, third = (self._whole(1, 9) / 10 for _ in range(3))
        self.lines += [f"IF ({value}>0) AND NOT ({value}==2) THEN", f"WAIT SEC {first}", "ELSE"]
        self.lines += [f"IF {value}<=-1 THEN", f"WAIT SEC {second}", "ELSE", f"WAIT SEC {third}"]
        self.lines += ["ENDIF", "ENDIF", f";{n}"]
        positive = value > 0 and value != 2
        self.truth.append(("wait", first if positive else second if value <= -1 else third))

    def enumerated(self) -> None:
        """SWITCH of an enumeration, and of a number with lists of cases."""
        kind = self._name("KIND")
        state = self._name("STATE")
        chosen = self._whole(0, 3)
        word = ("EMPTY", "HALF", "FULL")[chosen]
        self.data += [f"ENUM {kind} EMPTY,HALF,FULL", f"DECL {kind} {state}=#EMPTY"]
        self.lines += [f"{state}=#{word}", f"SWITCH {state}", "CASE #EMPTY", "WAIT SEC 0.5"]
        self.lines += ["CASE #HALF,#FULL", "WAIT SEC 0.75", "ENDSWITCH"]
        self.truth.append(("wait", 0.75 if chosen else 0.5))
        number = self._whole(1, 6)
        self.lines += [f"SWITCH {number}", "CASE 1,3", "WAIT SEC 1", "CASE 2", "WAIT SEC 2"]
        self.lines += ["DEFAULT", "WAIT SEC 3", "ENDSWITCH"]
        self.truth.append(("wait", {1: 1.0, 3: 1.0, 2: 2.0}.get(number, 3.0)))

    def parameters(self) -> None:
        """A routine that gets values and gives one back; its own variables hide others."""
        routine = self._name("GO")
        n = self._name("N")
        k = self._name("K")
        start = self._whole(2, 9)
        self.data += [f"DECL INT {n}", f"DECL REAL {k}=1"]
        self.lines += [f"{n}={start}", f"{routine}({n},{n}/2.0)", f"WAIT SEC {n}+{k}"]
        self.routines += [f"DEF {routine}(A :OUT,B :IN)", "DECL INT A", "DECL REAL B", f"REAL {k}"]
        self.routines += [f"{k}=90", f"A=A*2+B-B+{k}-{k}", "B=0", "WAIT SEC A/4", "END"]
        self.truth += [("wait", float(start * 2 // 4)), ("wait", float(start * 2 + 1))]

    def function(self) -> None:
        """A function that returns a place above another one."""
        name, at = self._point()
        above = self._name("ABOVE")
        high = self._whole(3, 200)
        self.lines += [f"LIN {above}({name},{high})"]
        self.routines += [f"DEFFCT E6POS {above}(P :IN,H :IN)", "DECL E6POS P", "DECL REAL H"]
        self.routines += ["P.Z=P.Z+H/4", "RETURN P", "ENDFCT"]
        self._known_place([*map(float, at[:2]), at[2] + high / 4, *map(float, at[3:])])

    def counted(self) -> None:
        """WHILE, REPEAT and LOOP by a counter."""
        n = self._name("N")
        until = self._whole(1, 5)
        self.data.append(f"DECL INT {n}")
        kind = self._whole(0, 3)
        inside = [f"{n}={n}+1", f"WAIT SEC {n}/10.0"]
        loops = (
            [f"WHILE {n}<{until}", *inside, "ENDWHILE"],
            ["REPEAT", *inside, f"UNTIL {n}>={until}"],
            ["LOOP", *inside, f"IF {n}=={until} THEN", "EXIT", "ENDIF", "ENDLOOP"],
        )
        self.lines += [f"{n}=0", *loops[kind]]
        self.truth += [("wait", k / 10) for k in range(1, until + 1)]

    def jump(self) -> None:
        """GOTO over a motion that is never driven."""
        label = self._name("LABEL")
        self.lines += [f"GOTO {label}", "PTP {A1 179}", f"{label}:"]

    def signals(self) -> None:
        """Outputs by number, by name, and as a group."""
        name = self._name("S")
        group = self._name("G")
        number = self._whole(10, 4000)
        bits = self._whole(0, 8)
        self.data += [f"SIGNAL {name} $OUT[{number}]"]
        self.data += [f"SIGNAL {group} $OUT[{number + 1}] TO $OUT[{number + 3}]"]
        self.lines += [f"{name}=TRUE", f"{group}={bits}", f"$OUT[{number}]=NOT {name}"]
        self.truth.append(("out", number, True))
        self.truth += [("out", number + 1 + k, bool(bits >> k & 1)) for k in range(3)]
        self.truth.append(("out", number, False))

    def inline_form(self) -> None:
        """PTP and LIN as the pendant writes them; their data stay until the next ones."""
        name, at = self._point()
        base = self._whole(1, 17)
        offset = [self._whole(-50, 50) for _ in range(3)]
        self.data += [
            f'DECL FDAT F{name}={{TOOL_NO 3,BASE_NO {base},IPO_FRAME #BASE,POINT2[] " "}}',
            f"DECL LDAT L{name}={{VEL 2,ACC 100,APO_DIST 25,APO_FAC 50,ORI_TYP #VAR}}",
        ]
        written = ",".join(f"{n} {v}" for n, v in zip("XYZ", offset, strict=True))
        self.lines += [f"BASE_DATA[{base}]={{{written},A 0,B 0,C 0}}"]
        velocity = self._whole(1, 20) / 10
        self.lines += ["$BWDSTART=FALSE", f"LDAT_ACT=L{name}", f"FDAT_ACT=F{name}"]
        self.lines += [f"BAS(#CP_PARAMS,{velocity})", f"LIN {name} C_DIS"]
        self.base = (float(offset[0]), float(offset[1]), float(offset[2]))
        self.velocity = velocity
        self.distance = 25.0
        self._known_place([*map(float, at)], 25.0)
        self._ptp(self._axes())

    def composed(self) -> None:
        """A place in the frame of another one, turned by quarters."""
        x = self._whole(900, 1500)
        frame = self._name("FR")
        turn = 90 * self._whole(0, 4)
        self.data.append(f"DECL FRAME {frame}={{X {x},Y 10,Z 5,A {turn},B 0,C 0}}")
        self.lines += [f"LIN {frame}:{{X 100,Y 30,Z 7,A 0,B 0,C 0}}"]
        c = round(math.cos(math.radians(turn)))
        s = round(math.sin(math.radians(turn)))
        angle = float(turn if turn <= 180 else turn - 360)
        place = [x + 100.0 * c - 30.0 * s, 10.0 + 100.0 * s + 30.0 * c, 12.0, angle, 0.0, 0.0]
        self._known_place(place)

    def rounding(self) -> None:
        """What is set of speeds and distances counts from there on."""
        self.speed = float(self._whole(10, 101))
        self.distance = float(self._whole(0, 80))
        self.velocity = self._whole(1, 20) / 10
        i = self._name("I")
        self.data.append(f"DECL INT {i}")
        self.lines += [f"FOR {i}=1 TO 6", f"$VEL_AXIS[{i}]={self.speed:g}", "ENDFOR"]
        self.lines += [f"$APO.CDIS={self.distance:g}", f"$VEL.CP={self.velocity:g}"]
        name, at = self._point()
        self.lines += [f"LIN {name} C_DIS", "WAIT SEC 0.25"]
        self._known_place([*map(float, at)], self.distance)
        self.truth.append(("wait", 0.25))
        self._ptp(self._axes())

    def frames(self) -> None:
        """A base by hand, in components."""
        x = self._whole(-90, 90)
        self.lines += ["$BASE=$NULLFRAME", f"$BASE.X={x}/2", "BAS(#TOOL,2)"]
        self.base = (float(math.trunc(x / 2)), 0.0, 0.0)
        name, at = self._point()
        self.lines += [f"LIN {name}"]
        self._known_place([*map(float, at)])

    def records(self) -> None:
        """An array of records with a place, a time and a mark."""
        kind = self._name("REC")
        list_ = self._name("LIST")
        count = self._whole(1, 4)
        self.data += [f"STRUC {kind} E6POS WHERE,REAL LASTS,BOOL USED", f"DECL {kind} {list_}[5]"]
        k = self._name("K")
        self.data.append(f"DECL INT {k}")
        known = []
        for n in range(1, count + 1):
            name, at = self._point()
            used = bool(self.rng.random() < 0.6)
            lasts = self._whole(1, 9)
            self.lines += [f"{list_}[{n}].WHERE={name}", f"{list_}[{n}].LASTS={lasts}"]
            self.lines += [f"{list_}[{n}].USED={str(used).upper()}"]
            known.append((at, lasts, used))
        self.lines += [f"FOR {k}=1 TO {count}", f"IF {list_}[{k}].USED THEN"]
        self.lines += [f"LIN {list_}[{k}].WHERE", f"WAIT SEC {list_}[{k}].LASTS/4", "ENDIF"]
        self.lines += ["ENDFOR"]
        for at, lasts, used in known:
            if used:
                self._known_place([*map(float, at)])
                self.truth.append(("wait", lasts / 4))

    def triggered(self) -> None:
        """An output on the way."""
        number = self._whole(1, 9)
        self.lines += [f"TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[{number}]=TRUE"]
        self.truth.append(("out", number, True))
        self._ptp(self._axes())


def found_in(hidden: Hidden) -> tuple[list[Truth], bool]:
    """What is read of a program, and whether a note says that it could be otherwise."""
    sources = [parse(hidden.source, "hidden.src"), parse(hidden.lists, "hidden.dat")]
    program = follow(sources, np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]), np.eye(4))
    found: list[Truth] = []
    for command in program.commands:
        if isinstance(command, Motion):
            found.append(_motion(command))
        elif isinstance(command, StandStill):
            found.append(("wait", command.seconds))
        elif isinstance(command, SetOutput):
            found.append(("out", command.number, command.value))
    return found, any(note.effect >= Effect.MOTIONS for note in program.notes)


def _motion(command: Motion) -> Truth:
    target = command.target
    if target.axes is not None:
        degrees = [math.degrees(one) for one in target.axes.values()]
        return ("axes", degrees, command.speeds.axis_velocity[0])
    frame = target.frame or {}
    base: FloatArray = 1e3 * target.base[:3, 3]
    blended = None if command.blend is None else 1e3 * command.blend.distance
    values = [frame[name] for name in _LETTERS]
    return ("place", values, tuple(base.tolist()), command.speeds.velocity, blended)


def same(first: Any, second: Any) -> bool:
    """Whether two entries are the same but for rounding."""
    if isinstance(first, list | tuple):
        return len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, float):
        return isinstance(second, int | float) and abs(first - second) < _SAME
    return bool(first == second)


def row_of(seed: int) -> HiddenRow:
    """A program, and whether what is read of it is what was known."""
    hidden = Hidden(seed)
    lines = len(hidden.lines) + len(hidden.data) + len(hidden.routines)
    try:
        found, said = found_in(hidden)
    except KrlError as error:
        return HiddenRow(seed, lines, len(hidden.truth), "refused", str(error))
    pairs = zip(hidden.truth, found, strict=False)
    wrong = next((f"{known} read as {one}" for known, one in pairs if not same(known, one)), "")
    if not wrong and len(found) != len(hidden.truth):
        wrong = f"{len(hidden.truth)} things are known, {len(found)} are read"
    verdict = "right" if not wrong else "said" if said else "silently wrong"
    return HiddenRow(seed, lines, len(hidden.truth), verdict, wrong)


def hidden_truths(programs: int) -> tuple[list[dict[str, Any]], list[Claim]]:
    """Counts over programs, and what is claimed of them."""
    rows = [row_of(seed) for seed in range(programs)]
    counts = {one: sum(r.verdict == one for r in rows) for one in ("right", "said", "refused")}
    silent = [row for row in rows if row.verdict == "silently wrong"]
    counted = ", ".join(f"{n} {word}" for word, n in counts.items())
    known = sum(row.known for row in rows)
    print(
        f"{programs} programs, {known} motions, waits and outputs: {counted}, {len(silent)} wrong"
    )
    for row in rows:
        if row.verdict != "right":
            print(f"  program {row.seed}: {row.verdict}: {row.said}")
    return [asdict(row) for row in rows], [
        at_least("programs with known motions read right", counts["right"], "of", programs),
        at_most("of them wrong without a word", len(silent), "programs", 0),
    ]
