"""One look at a cell: what is shown, what was dragged, what is planned. One thread runs all of
it.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from ir_description import Cell, DescriptionError, cell_to_yaml
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

from .camera import look_at
from .dragging import Dragging
from .inbox import Inbox
from .judged import Judged
from .moved import Target, cell_with, snippet, targets
from .panel import NOBODY, SPEEDS, Actions, Panel, bad, box, legend_html, plain, stations_html
from .planned import QUIET, Asked, Listener, Planned, Worker
from .playback import Playback
from .saving import SavingError, save
from .stage import Stage
from .watched import Watched

TICK = 0.04
"""Seconds between two pictures of a playback."""
LOOK = 0.3
"""Seconds between two looks at the file."""
SLIDERS = 0.25
"""Seconds between two updates of the sliders while a motion is played."""


class Session:
    """Shows a cell until `run` returns; `close` ends its thread."""

    def __init__(self, server: Any, watched: Watched, stations: tuple[str, ...] = ()) -> None:
        self._server = server
        self._watched = watched
        self._stations = stations
        self._inbox = Inbox()
        self._worker = Worker(self._inbox, Listener(self._checked, self._progress, self._planned))
        self._number = 0
        self._playback = Playback()
        self._slid = 0.0
        self._passed = self._looked = time.monotonic()
        self._moves: dict[Target, FloatArray] = {}
        self._file: Cell | None = None
        self._stage: Stage
        self._panel: Panel
        self._dragging = Dragging(server.scene, self._post_drag)
        self._start = server.gui.add_html("")
        self._read()

    def run(self, until: float = np.inf) -> None:
        """Do what browsers, file and planner ask for, until the monotonic clock says `until`
        [s].
        """
        while (now := time.monotonic()) < until:
            for action in self._inbox.take(TICK if self._playback.runs else LOOK / 3.0):
                action()
            if self._playback.runs and self._server.get_clients():
                self._tick(now - self._passed, now)
            self._passed = now
            if now - self._looked >= LOOK:
                self._looked = now
                if self._watched.changed(now):
                    self._read()

    def close(self) -> None:
        """End what is planned."""
        self._worker.close()

    def _read(self) -> None:
        """Take the file as it is now; where it has errors, these stand beside the cell that it
        had.
        """
        reading = self._watched.read()
        cell = reading.cell
        file = self._file
        if cell is not None and (file is None or cell_to_yaml(cell) != cell_to_yaml(file)):
            note = "read again; what was dragged is dropped" if self._moves else ""
            self._show(cell)
            self._stage.note = note
        if self._file is None:
            self._start.content = box([bad("the file can't be read:"), *map(plain, reading.errors)])
            return
        self._stage.errors = reading.errors
        self._stage.blame()
        self._say()

    def _show(self, cell: Cell) -> None:
        """Another cell from the file: everything is drawn again."""
        other = self._file is None or self._file.robot.document != cell.robot.document
        other |= self._file is not None and self._file.robot.name != cell.robot.name
        q = np.array(cell.machine_home) if other else self._stage.q
        self._file = cell
        self._moves = {}
        self._playback = Playback()
        self._dragging.choose(None, cell)
        with self._server.atomic():
            self._server.scene.reset()
            self._stage = Stage(self._server, cell, self._watched.name, q)
            if other:
                self._new_panel(cell)
            self._panel.of_cell(cell.name, [each.text for each in targets(cell)], cell.stations)
            self._show_chosen()
            self._stage.stand(q)
            self._say_moves()
        self._slide()
        look_at(self._server, cell)
        self._ask(quiet=0.0)

    def _new_panel(self, cell: Cell) -> None:
        self._server.gui.reset()
        do = Actions(
            joints=self._joints_moved,
            play=self._play,
            time=self._time_moved,
            at=self._at,
            target=self._target_chosen,
            undo=self._undo,
            save=self._save,
            plan=self._ask,
            cancel=self._cancel,
            show=self._show_chosen,
        )
        self._panel = Panel(self._server.gui, cell.robot, self._inbox.post, do)

    def _say(self) -> None:
        self._panel.status.content = self._stage.lines()

    def _show_chosen(self) -> None:
        for what, checkbox in self._panel.shown.items():
            self._stage.drawing.show(what, bool(checkbox.value))

    # the robot by hand

    def _joints_moved(self) -> None:
        degrees = np.nan_to_num([float(slider.value) for slider in self._panel.joints])
        self._halt()  # and leave the sliders: a hand may have moved one since
        robot = self._stage.cell.robot
        self._stage.stand(np.clip(np.radians(degrees), robot.position_min, robot.position_max))
        self._say()

    def _slide(self) -> None:
        """Put the sliders where the robot is."""
        for slider, value in zip(self._panel.joints, np.degrees(self._stage.q), strict=True):
            slider.value = float(np.clip(round(float(value), 1), slider.min, slider.max))

    def _at(self) -> None:
        name = self._panel.at.value
        if name == NOBODY:
            return
        self._stop()
        q = self._stage.configuration(name)
        if q is not None:
            self._stage.stand(q)
            self._slide()
        self._say()

    # machines and stations by hand

    def _target_chosen(self) -> None:
        cell = self._stage.cell
        wanted = self._panel.target.value
        self._dragging.choose(
            next((each for each in targets(cell) if each.text == wanted), None), cell
        )

    def _post_drag(self, ended: bool) -> None:
        self._inbox.post("drag", lambda: self._dragged(ended))

    def _dragged(self, ended: bool) -> None:
        target = self._dragging.target
        file = self._file
        if target is None or file is None:
            return
        try:
            moves = {**self._moves, target: self._dragging.pose(self._stage.cell, file)}
            cell = cell_with(file, moves)
        except (DescriptionError, InvalidValueError, ValueError) as error:
            self._stage.note = f"{target.text} can't stand there: {error}"
            self._say()
            return
        self._take(cell, moves, target)
        if ended:
            self._dragging.settle(cell)

    def _take(self, cell: Cell, moves: dict[Target, FloatArray], target: Target | None) -> None:
        """Show and plan the cell with these moves; target: what moved last."""
        self._moves = moves
        self._stage.note = ""
        self._stop()
        self._stage.found = ()
        self._stage.failure = ""
        with self._server.atomic():
            self._stage.move(cell)
            self._stage.stand(self._stage.q)
            self._say_moves()
        self._say()
        first = [
            station.name
            for station in cell.stations
            if target is not None and target.name in (station.name, station.equipment)
        ]
        self._ask(frozenset(first), QUIET)

    def _undo(self) -> None:
        if self._file is not None:
            self._take(self._file, {}, None)
            self._dragging.settle(self._file)

    def _save(self) -> None:
        if self._file is None or not self._moves:
            return
        try:
            self._stage.note = f"written: {save(self._watched, self._file, self._moves)}"
        except SavingError as error:
            self._stage.note = f"nothing was written: {error}"
        self._say()

    def _say_moves(self) -> None:
        there = bool(self._moves)
        text = (
            f"<pre style='white-space:pre-wrap'>{plain(snippet(self._moves))}</pre>"
            if there
            else ""
        )
        self._panel.moves_text.content = box([text] if there else [])
        self._panel.save.visible = self._panel.undo.visible = there

    # what is planned

    def _ask(self, first: frozenset[str] = frozenset(), quiet: float = 0.0) -> None:
        self._number += 1
        self._playback = Playback()
        self._panel.working(True)
        self._panel.plan_text.content = box(["planning …"])
        self._worker.ask(Asked(self._number, self._stage.cell, first, self._stations, quiet))

    def _cancel(self) -> None:
        self._worker.cancel()
        self._number += 1
        self._panel.working(False)
        self._panel.plan_text.content = box(["planning was cancelled"])

    def _checked(self, number: int, found: tuple[Judged, ...], complete: bool) -> None:
        if number == self._number:
            self._stage.found = found
            self._stage.blame()
            self._panel.stations_text.content = stations_html(found, complete)

    def _progress(self, number: int, phase: str, done: int, total: int) -> None:
        if number == self._number:
            self._panel.progress.value = 100.0 * done / max(total, 1)
            self._panel.plan_text.content = box([plain(f"planning: {phase} {done} of {total}")])

    def _planned(self, number: int, plan: Planned) -> None:
        if number != self._number:
            return
        motion = plan.motion
        self._stage.failure = plan.failure
        self._playback = Playback(motion)
        self._panel.working(False)
        lines = [bad(f"not planned: {plan.failure}")] if plan.failure else []
        lines += map(plain, plan.lines)
        if motion is None and not plan.failure:
            lines.append("the cell has neither program nor tasks: nothing was planned")
        self._panel.plan_text.content = box(lines) + (
            legend_html(motion) if motion is not None else ""
        )
        self._panel.time.max = round(motion.duration, 2) if motion is not None else 1.0
        self._panel.time.value = 0.0
        self._stage.drawing.path(motion)
        self._stage.blame()

    # what is played

    def _play(self) -> None:
        if self._playback.motion is None:
            return
        if self._playback.runs:
            self._stop()
            return
        self._playback.runs = True
        self._panel.play.label = "Stop"

    def _stop(self) -> None:
        self._halt()
        self._slide()

    def _halt(self) -> None:
        self._playback.runs = False
        self._panel.play.label = "Play"

    def _time_moved(self) -> None:
        if self._playback.motion is not None:
            self._playback.time = float(np.nan_to_num(self._panel.time.value))
            self._picture()

    def _tick(self, seconds: float, now: float) -> None:
        self._playback.advance(min(seconds, 1.0) * SPEEDS.get(self._panel.speed.value, 1.0))
        self._picture()
        if now - self._slid >= SLIDERS:
            self._slid = now
            self._panel.time.value = round(self._playback.time, 2)
            self._slide()

    def _picture(self) -> None:
        """Draw the robot as the motion has it now."""
        motion = self._playback.motion
        step = self._playback.step
        stage = self._stage
        if motion is None or step is None:
            return
        k = self._playback.sample
        stage.note = f"{step.label}, {motion.watts[k] / 1e3:.1f} kW"
        with self._server.atomic():
            stage.hold(step.load, step.places, step.cell)
            stage.stand(motion.q[k], step.movement)
        self._say()
