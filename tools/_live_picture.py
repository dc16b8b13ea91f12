"""A live view of what a recording says, as it stood at one instant: for its picture, without nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

import numpy as np

from ir_recorder import Analysis
from ir_recorder.analysis.loads import load_timeline
from ir_recorder.analysis.shares import mode_name
from ir_recorder.analysis.steps import step_label
from ir_recorder.live import LiveServer, Stream
from ir_recorder.live.cell_view import CellView, Heard
from ir_recorder.live.server import Answer
from ir_recorder.read.recording import BitSeries

RATE = 20.0  # Hz, as the node
WINDOW = 60.0  # s


@contextmanager
def live_view(analysis: Analysis, until: float) -> Iterator[LiveServer]:
    """Serves the minute before `until` [s of the recording]; the buttons do nothing."""
    recording, now, view = analysis.recording, [0.0], CellView()
    stream = Stream(clock=lambda: now[0])
    assert recording.joints is not None
    assert recording.power is not None
    loads = load_timeline(recording).observations
    for t in np.arange(max(until - WINDOW, 0.0), until, 1.0 / RATE):
        now[0] = float(t)
        step = next((s for s in reversed(analysis.steps) if s.step.start <= t < s.step.end), None)
        load = next((name for time, name in reversed(loads) if time <= t), "none")
        joint = recording.joints.position[np.searchsorted(recording.joints.time, t)]
        power = recording.power.power[np.searchsorted(recording.power.time, t - 1.0 / RATE) :][:5]
        names = analysis.cell.robot.joint_names if analysis.cell is not None else ()
        movement = step.step.movement if step is not None else None
        heard = Heard(recording.cell_yaml, joints=names, q=joint, load=load, movement=movement)
        at = np.searchsorted(recording.power.time, t)
        mode = mode_name(int(recording.power.mode[at]))
        values: dict[str, Any] = {
            **view.look(heard),
            **{"w": [float(power.min()), float(power.max())], "energy": float(recording.power.energy[at])},
            **{"mode": mode, "target": mode, "plant": recording.plant, "load": load, "bound": 0.02},
            **{
                "q": [round(float(x), 4) for x in joint],
                "heard": dict.fromkeys(("driver", "planner", "runner"), True),
            },
            **{"in": _levels(recording.plc_inputs, t), "out": _levels(recording.plc_outputs, t)},
        }
        if step is not None and movement is not None:
            place = [step.step.index + 1, step.step.total]
            kind = "pause" if movement.is_pause else movement.kind
            values["step"] = {
                "label": step_label(movement),
                "kind": kind,
                "event": "started",
                "at": place,
                "note": "",
            }
        stream.add(values, always=("w",))
    server, ended = LiveServer(stream, lambda name, value: Answer(False, ""), lambda: view.scene), Event()

    def beat() -> None:
        while not ended.wait(0.5):
            stream.add({})

    heart = Thread(target=beat)
    heart.start()
    yield server
    ended.set()
    heart.join()
    server.close()


def _levels(series: BitSeries | None, t: float) -> dict[str, bool]:
    """Bits of a series at a time [s]."""
    if series is None or not len(series.time):
        return {}
    row = series.levels[max(int(np.searchsorted(series.time, t, side="right")) - 1, 0)]
    names: Sequence[str] = series.names
    return {name: bool(level) for name, level in zip(names, row, strict=True)}
