"""A live view of what a recording says, as it stood at one instant: for its picture, without
nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

import numpy as np

from ir_recorder import Analysis
from ir_recorder.analysis.results import mode_name
from ir_recorder.live import LiveServer, Stream
from ir_recorder.live.cell_view import CellView, ReceivedCell
from ir_recorder.live.server import ButtonAnswer
from ir_recorder.reading.recording import BitSeries

RATE = 20.0  # Hz, as the node
WINDOW = 60.0  # s


@contextmanager
def live_view(analysis: Analysis, until: float) -> Iterator[LiveServer]:
    """Serves the minute before `until` [s of the recording]; the buttons do nothing."""
    now = [0.0]
    view = CellView()
    stream = Stream(clock=lambda: now[0])
    for t in np.arange(max(until - WINDOW, 0.0), until, 1.0 / RATE):
        now[0] = float(t)
        stream.add(_heard_at(analysis, view, now[0]), always=("w",))
    server = LiveServer(stream, lambda name, value: ButtonAnswer(False, ""), lambda: view.scene)
    ended = Event()

    def beat() -> None:
        while not ended.wait(0.5):
            stream.add({})

    heart = Thread(target=beat)
    heart.start()
    try:
        yield server
    finally:
        ended.set()
        heart.join()
        server.close()


def _heard_at(analysis: Analysis, view: CellView, t: float) -> dict[str, Any]:
    """Values of the stream at a time [s]; the recording has joint states, power and a cell."""
    recording = analysis.recording
    joints = recording.joints
    power = recording.power
    cell = analysis.cell
    assert joints is not None
    assert power is not None
    assert cell is not None
    ended = [s.step.movement for s in analysis.steps if t - 1.0 / RATE <= s.step.end < t]
    step = next((s.step for s in reversed(analysis.steps) if s.step.start <= t < s.step.end), None)
    heard_of = [s.step.movement for s in analysis.steps if s.step.start <= t]  # as the node does
    movement = heard_of[-1] if heard_of else None
    load = next((name for time, name in reversed(analysis.loads.observations) if time <= t), "none")
    q = joints.position[np.searchsorted(joints.time, t)]
    heard = ReceivedCell(
        recording.cell_yaml,
        joints=cell.robot.joint_names,
        q=q,
        load=load,
        movement=movement,
        ended=ended,
    )
    at = np.searchsorted(power.time, t)
    since = np.searchsorted(power.time, t - 1.0 / RATE)
    watts = power.power[since : at + 1]
    mode = mode_name(int(power.mode[at]))
    values: dict[str, Any] = {
        **view.look(heard),
        **{"w": [float(watts.min()), float(watts.max())], "energy": float(power.energy[at])},
        **{"mode": mode, "target": mode, "plant": recording.plant, "load": load, "bound": 0.02},
        **{
            "q": [round(float(x), 4) for x in q],
            "heard": dict.fromkeys(("driver", "planner", "runner"), True),
        },
        **{"in": _levels(recording.plc_inputs, t), "out": _levels(recording.plc_outputs, t)},
    }
    if step is not None:
        kind = "pause" if step.movement.is_pause else step.movement.kind
        place = [step.index + 1, step.total]
        values["step"] = {
            "label": step.label,
            "kind": kind,
            "event": "started",
            "at": place,
            "note": "",
        }
    return values


def _levels(series: BitSeries | None, t: float) -> dict[str, bool]:
    """Bits of a series at a time [s]."""
    if series is None or not len(series.time):
        return {}
    row = series.levels[max(int(np.searchsorted(series.time, t, side="right")) - 1, 0)]
    names: Sequence[str] = series.names
    return {name: bool(level) for name, level in zip(names, row, strict=True)}
