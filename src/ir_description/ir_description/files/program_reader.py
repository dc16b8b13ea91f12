"""Reads the signals and the program steps of a cell file."""

from __future__ import annotations

from typing import TypedDict

from ir_description.cell import PAUSE_MAX, PAUSE_POWER_MODES, POSTURES, CellSignal, ProgramStep
from ir_description.files.items import Item, Table
from ir_msgs_py.plc import Signal

_COMMON = ("wait_for", "set_signals")
_STEP_KEYS = (
    *("station", "posture", "path", "pause", "dwell", "attach", "detach", "power_mode", "planner"),
    *_COMMON,
)
_KEYS = {
    "station": ("station", "dwell", "attach", "detach", "planner", *_COMMON),
    "posture": ("posture", "dwell", "planner", *_COMMON),
    "path": ("path", "dwell", "planner", *_COMMON),
    "pause": ("pause", "power_mode", *_COMMON),
}


class _Moving(TypedDict):
    """What every step that goes somewhere has."""

    dwell: float
    wait_for: tuple[Signal, ...]
    set_signals: tuple[Signal, ...]
    planner: str


def read_signal(item: Item) -> CellSignal:
    """Return a signal of the cell."""
    table = item.table(("name",), ("initial", "follows", "delay"))
    if "delay" in table and "follows" not in table:
        table["delay"].fail("belongs to a signal that follows another")
    return CellSignal(
        name=table["name"].name(),
        initial=table["initial"].boolean() if "initial" in table else False,
        follows=table["follows"].name() if "follows" in table else "",
        delay=table["delay"].number(0.0, PAUSE_MAX, "s") if "delay" in table else 0.0,
    )


def read_step(item: Item) -> ProgramStep:
    """Return one step; exactly one of station, posture, path and pause says what it is."""
    table = item.table((), _STEP_KEYS)
    kind = table.one_of("station", "posture", "path", "pause")
    for key in _STEP_KEYS:
        if key in table and key not in _KEYS[kind]:
            table[key].fail(
                f"does not belong to a {kind} step; its keys are {', '.join(_KEYS[kind])}"
            )
    wait_for = _signals(table, "wait_for")
    set_signals = _signals(table, "set_signals")
    if kind == "pause":
        mode = (
            table["power_mode"].choice(PAUSE_POWER_MODES)
            if "power_mode" in table
            else PAUSE_POWER_MODES[0]
        )
        return ProgramStep(
            kind="PAUSE",
            dwell=table["pause"].number(0.0, PAUSE_MAX, "s", above=True),
            wait_for=wait_for,
            set_signals=set_signals,
            power_mode=mode,
        )
    moving: _Moving = {
        "dwell": table["dwell"].number(0.0, PAUSE_MAX, "s") if "dwell" in table else 0.0,
        "wait_for": wait_for,
        "set_signals": set_signals,
        "planner": table["planner"].name() if "planner" in table else "",
    }
    if kind == "posture":
        return ProgramStep("POSTURE", table["posture"].choice(POSTURES), **moving)
    if kind == "path":
        return ProgramStep("PATH", table["path"].name(), **moving)
    return ProgramStep(
        kind="STATION",
        target=table["station"].name(),
        attach=table["attach"].name() if "attach" in table else "",
        detach=table["detach"].name() if "detach" in table else "",
        **moving,
    )


def _signals(table: Table, key: str) -> tuple[Signal, ...]:
    if key not in table:
        return ()
    return tuple(_signal(item) for item in table[key].list(0, 100))


def _signal(item: Item) -> Signal:
    text = item.text(80)
    inverted = text.startswith("not ")
    name = text.removeprefix("not ").strip() if inverted else text
    if not name.replace("_", "").replace(".", "").replace("-", "").isalnum():
        item.fail(f"is {name!r}, must be a signal's name, perhaps after 'not '")
    return Signal(name, not inverted)
