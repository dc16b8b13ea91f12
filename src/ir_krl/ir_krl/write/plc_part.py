"""The PLC's part of a program: a table of its pauses, and structured text that spends them.

In EXT the power modes are the PLC's: DRIVES_OFF closes the brakes, AB switches the drive bus off,
HIB hibernates, and only a Wake-on-LAN packet wakes. A controller whose drives are off doesn't run
its program on, and one that hibernates runs nothing, so the PLC counts the pause. The program
says which pause begins and waits until the PLC says that it is over.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ir_krl.errors import KrlError, SourcePlace
from ir_krl.language import SourceFile, SyntaxTree
from ir_msgs_py.modes import DEEPER, modes_of
from ir_values.errors import InvalidValueError

COLUMNS = ("program", "pause", "place", "seconds", "modes", "asked_at", "wake_at")
PAUSES_MAX = 255
_BITS = {"STAND_ON_BRAKES": "DRIVES_OFF", "BUS_POWER_OFF": "AB", "HIBERNATION": "HIB"}
_WEEK = 604_800.0


@dataclass(frozen=True)
class PlcPause:
    """One pause of a program: its number, where, how long [s], the modes with the times [s] after
    its start at which each is asked for, and when the robot is woken to be ready at its end.
    """

    number: int
    place: str
    seconds: float
    modes: tuple[str, ...]
    asked_at: tuple[float, ...]
    wake_at: float

    @property
    def power_mode(self) -> str:
        """The modes as a planned pause names them."""
        return DEEPER.join(self.modes)

    @property
    def sentence(self) -> str:
        """For people."""
        asked = zip(self.modes, self.asked_at, strict=True)
        steps = ", ".join(f"{mode} at {at:g} s" for mode, at in asked)
        return f"{self.seconds:g} s: {steps}, woken at {self.wake_at:g} s"


def plc_table(program: str, pauses: Sequence[PlcPause]) -> str:
    """The table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in pauses:
        asked = DEEPER.join(f"{at:.9g}" for at in one.asked_at)
        row = (one.number, one.place, f"{one.seconds:.9g}", one.power_mode, asked)
        writer.writerow((program, *row, f"{one.wake_at:.9g}"))
    return text.getvalue()


def read_plc_table(text: str, file: str) -> dict[int, PlcPause]:
    """Pauses by their numbers. Raises KrlError with the line of what is no such table."""
    rows = list(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))
    heads = text.removeprefix("\ufeff").partition("\n")[0].strip().split(",")
    missing = [name for name in COLUMNS if name not in heads]
    if missing:
        raise KrlError(
            f"column {missing[0]} is missing: a PLC table has {', '.join(COLUMNS)}",
            SourcePlace(file, 1, 1),
        )
    found: dict[int, PlcPause] = {}
    for line, row in enumerate(rows, start=2):
        place = SourcePlace(file, line, 1)
        pause = _pause({name: row.get(name) or "" for name in COLUMNS}, place)
        if pause.number in found:
            raise KrlError(f"pause {pause.number} stands twice in the table", place)
        found[pause.number] = pause
    return found


def _pause(row: Mapping[str, str], place: SourcePlace) -> PlcPause:
    number = _number(row, "pause", 1.0, PAUSES_MAX, place)
    seconds = _number(row, "seconds", 0.0, _WEEK, place)
    wake_at = _number(row, "wake_at", 0.0, seconds, place)
    try:
        modes = tuple(mode.name for mode in modes_of(row["modes"]))
    except InvalidValueError as error:
        raise KrlError(str(error), place) from None
    asked = row["asked_at"].split(DEEPER) if row["asked_at"] else []
    times = tuple(_number({"asked_at": one}, "asked_at", 0.0, wake_at, place) for one in asked)
    if not modes or len(times) != len(modes) or list(times) != sorted(times):
        raise KrlError(
            f"modes {row['modes']!r} need one time each in asked_at, in their order; it is "
            f"{row['asked_at']!r}",
            place,
        )
    if number != round(number):
        raise KrlError(f"pause is {number:g}: it must be a whole number", place)
    return PlcPause(round(number), row["place"], seconds, modes, times, wake_at)


def _number(
    row: Mapping[str, str], name: str, low: float, high: float, place: SourcePlace
) -> float:
    try:
        value = float(row[name])
    except ValueError:
        raise KrlError(f"{name} is {row[name][:20]!r}: it must be a number", place) from None
    if not low <= value <= high:
        raise KrlError(f"{name} is {value:g}: it must be in {low:g} .. {high:g}", place)
    return value


def plc_input(sources: Sequence[SourceFile], *, there: bool) -> dict[int, bool]:
    """The input by which an exported program hears whether the PLC spends its pauses, and what it
    reads; empty for a program that asks for none.
    """
    found = {}
    for source in sources:
        bodies = (*source.data, *(routine.body for routine in source.routines))
        for statement in (one for body in bodies for one in body.children):
            if statement.data == "signal" and str(statement.children[0]) == "IR_PLC":
                number = re.fullmatch(r"\$IN\[(\d+)\]", _spelled(statement.children[1]))
                if number is not None:
                    found[int(number[1])] = there
    return found


def _spelled(tree: object) -> str:
    """The words of a tree, one after the other."""
    if isinstance(tree, SyntaxTree):
        inner = "".join(_spelled(child) for child in tree.children)
        return f"[{inner}]" if tree.data == "index" else inner
    return "" if tree is None else str(tree)


# IEC 61131-3: a function block with the handshake, and a CASE with the pauses.

_DECLARATIONS = """\
FUNCTION_BLOCK FB_{name}
VAR_INPUT
  PauseNumber : INT;      (* of the robot: IR_PAUSE, $OUT[{pause}] TO $OUT[{pause_end}] *)
  Ext : BOOL;             (* of the robot: $EXT *)
  Online : BOOL;          (* of the fieldbus: the robot answers *)
  DrivesReady : BOOL;     (* of the robot: $PERI_RDY *)
  StopMessage : BOOL;     (* of the robot: $STOPMESS *)
  ProgramActive : BOOL;   (* of the robot: $PRO_ACT *)
  Enable : BOOL;          (* of the cell: pauses may be spent in power modes *)
END_VAR
VAR_OUTPUT
  PlcThere : BOOL;        (* to the robot: IR_PLC, $IN[{there}] *)
  PauseDone : BOOL;       (* to the robot: IR_DONE, $IN[{done}] *)
  DrivesOff : BOOL;       (* to the robot: NOT of it to $DRIVES_OFF, which is low to switch off *)
  DrivesOn : BOOL;        (* to the robot: $DRIVES_ON *)
  ConfMess : BOOL;        (* to the robot: $CONF_MESS *)
  ExtStart : BOOL;        (* to the robot: $EXT_START *)
  AB : BOOL;              (* to the robot, power management: drive bus off *)
  HIB : BOOL;             (* to the robot, power management: hibernate *)
  SendWakePacket : BOOL;  (* to a block that sends the Wake-on-LAN packet while this is TRUE *)
END_VAR
VAR
  Running : INT;          (* the pause that is being spent, 0: none *)
  Clock : TON;
  Elapsed : LREAL;        (* s since the pause began *)
  Seconds : LREAL;
  WakeAt : LREAL;
  AtBrakes : LREAL;       (* when each mode is asked for; -1: not in this pause *)
  AtBusOff : LREAL;
  AtHibernate : LREAL;
  Waking : BOOL;
  Slept : BOOL;           (* the controller has gone off the network *)
  Pulse : TON;
  Blink : BOOL;
END_VAR
"""

_BODY = """\

PlcThere := Enable AND Ext;

(* a pause begins: its number is kept, for a controller that hibernates shows none; it ends when
   the program takes its number back *)
IF Running = 0 AND PauseNumber > 0 AND PlcThere THEN
  Running := PauseNumber;
  Slept := FALSE;
ELSIF Online AND PauseNumber = 0 THEN
  Running := 0;
END_IF;

CASE Running OF
{cases}ELSE
  Seconds := 0.0; WakeAt := 0.0; AtBrakes := -1.0; AtBusOff := -1.0; AtHibernate := -1.0;
END_CASE;

Clock(IN := Running > 0, PT := T#8d);
Elapsed := TIME_TO_LREAL(Clock.ET) / 1000.0;

IF HIB AND NOT Online THEN
  Slept := TRUE;
END_IF;

(* who leaves EXT or takes Enable back wakes the robot sooner, but for one that sleeps: it shows
   no EXT *)
Waking := Running > 0 AND (Elapsed >= WakeAt OR NOT Enable OR (Online AND NOT Ext));

(* the modes, each until a deeper one is asked for, all until the robot is woken *)
DrivesOff := Running > 0 AND NOT Waking AND AtBrakes >= 0.0 AND Elapsed >= AtBrakes
  AND NOT (AtBusOff >= 0.0 AND Elapsed >= AtBusOff)
  AND NOT (AtHibernate >= 0.0 AND Elapsed >= AtHibernate);
AB := Running > 0 AND NOT Waking AND AtBusOff >= 0.0 AND Elapsed >= AtBusOff
  AND NOT (AtHibernate >= 0.0 AND Elapsed >= AtHibernate);
IF Running > 0 AND AtHibernate >= 0.0 AND Elapsed >= AtHibernate AND NOT Waking THEN
  HIB := TRUE;
ELSIF Online OR Running = 0 THEN
  HIB := FALSE; (* it is back: a packet has woken it *)
END_IF;
SendWakePacket := Waking AND Slept AND NOT Online;

(* drives on again, messages acknowledged, the program goes on at its WAIT FOR *)
Pulse(IN := Waking AND NOT Blink, PT := T#300ms);
Blink := Pulse.Q;
DrivesOn := Waking AND Online AND NOT DrivesReady AND Pulse.ET < T#150ms;
ConfMess := Waking AND Online AND DrivesReady AND StopMessage AND Pulse.ET < T#150ms;
ExtStart := Waking AND DrivesReady AND NOT StopMessage AND NOT ProgramActive
  AND Pulse.ET < T#150ms;

PauseDone := Running > 0 AND (Elapsed >= Seconds OR NOT Enable) AND DrivesReady
  AND ProgramActive;
END_FUNCTION_BLOCK
"""


def structured_text(
    program: str, pauses: Sequence[PlcPause], numbers: Mapping[str, int], header: Sequence[str]
) -> str:
    """The function block; numbers: first ones of the signals between program and PLC."""
    pause = numbers["IR_PAUSE"]
    head = _DECLARATIONS.format(
        name=program,
        pause=pause,
        pause_end=pause + 7,
        there=numbers["IR_PLC"],
        done=numbers["IR_DONE"],
    )
    comments = "".join(f"(* {line.replace('*)', '* )')} *)\n" for line in header)
    return comments + head + _BODY.format(cases="".join(_case(one) for one in pauses))


def _case(pause: PlcPause) -> str:
    """The branch of a pause. Raises KrlError for a mode that the function block doesn't know."""
    at = dict(zip(pause.modes, pause.asked_at, strict=True))
    unknown = [mode for mode in at if mode not in _BITS]
    if unknown:
        raise KrlError(
            f"pause {pause.number}: a PLC's program has no time for {', '.join(unknown)}"
        )
    brakes, bus, hibernate = (at.get(mode, -1.0) for mode in _BITS)
    return (
        f"  {pause.number}: (* at {pause.place or 'where the robot stands'}: {pause.sentence} *)\n"
        f"    Seconds := {pause.seconds:.3f}; WakeAt := {pause.wake_at:.3f};\n"
        f"    AtBrakes := {brakes:.3f}; AtBusOff := {bus:.3f}; AtHibernate := {hibernate:.3f};\n"
    )
