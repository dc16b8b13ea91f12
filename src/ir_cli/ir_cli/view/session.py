"""Session of `ir view`: picture, panel, dragged machines and plans, all in one thread."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from ir_cli.station_access import MARGIN
from ir_cli.view.background import QUIET, Inbox, Listener, Planned, PlanWorker, ViewRequest
from ir_cli.view.cell_file import SavingError, Watched, save
from ir_cli.view.clearance import Nearest, NearestPairs, StationAccess, names_in
from ir_cli.view.drawing import Drawing, look_at
from ir_cli.view.moves import Dragging, Target, cell_with, snippet, targets
from ir_cli.view.panel import (
    NOBODY,
    SPEEDS,
    Actions,
    Panel,
    bad,
    box,
    legend_html,
    plain,
    stations_html,
)
from ir_cli.view.playback import Playback
from ir_description import Cell, DescriptionError, PartPlaces, cell_to_yaml
from ir_msgs_py.report import PlannedMovement
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

# The picture: the cell, the robot with what it holds, and in red what is wrong.


class Stage:
    """A cell as it is shown, its robot at q (n,).

    found, failure and errors say what is wrong with it, note what happened last.
    """

    def __init__(self, server: Any, cell: Cell, source: str, q: FloatArray) -> None:
        self._server = server
        self._source = source
        self._pairs = NearestPairs()
        self.cell = cell
        self._now = cell
        self.q = q
        self.held = cell.tool.name if cell.tool is not None else ""
        self.places = cell.parts_at_start()
        self.near: Nearest | None = None
        self.found: tuple[StationAccess, ...] = ()
        self.errors: tuple[str, ...] = ()
        self.failure = self.note = ""
        self.drawing = Drawing(server.scene, cell)
        self.drawing.lie(self.places, self.held)

    def together(self) -> AbstractContextManager[None]:
        """What is changed inside the block is seen at once."""
        context: AbstractContextManager[None] = self._server.atomic()
        return context

    def move(self, cell: Cell) -> None:
        """Another version of the same cell: machines and stations stand elsewhere."""
        self.cell = self._now = cell
        self.drawing.move(cell)
        self.drawing.states(cell)
        self.drawing.lie(self.places, self.held)
        self.drawing.path(None)

    def hold(self, load: str, places: PartPlaces, cell: Cell | None = None) -> None:
        """What the robot holds, where the parts lie, and the cell with its machines in other
        states.
        """
        now = cell or self.cell
        if now is not self._now:
            self._now = now
            self.drawing.states(now)
        if (load, places) != (self.held, self.places):
            self.held = load
            self.places = places
            self.drawing.lie(places, load)

    def stand(self, q: FloatArray, movement: PlannedMovement | None = None) -> None:
        """Put the robot at q (n,), on its course in a movement or by hand."""
        self.q = q
        self.drawing.stand(q)
        self.near = near = self._pairs.at(self._now, q, self.held, self.places, movement)
        if near is not None:
            self.drawing.nearest(near.point_a, near.point_b, near.text, near.distance < MARGIN)
        self.blame()

    def blame(self) -> None:
        """Show in red what is too near or obstructs."""
        names = set(names_in(f"{self.failure} {' '.join(self.errors)}", self.cell))
        names.update(name for each in self.found if not each.free for name in each.pair)
        if self.near is not None and self.near.distance < MARGIN:
            names.update(self.near.names)
        self.drawing.highlight(names)

    def lines(self) -> str:
        """The state of the file, the nearest pair, and what happened last, as HTML."""
        lines = [f"{plain(self.cell.name)}, {plain(self._source)}"]
        if self.errors:
            lines.append(bad("the file can't be read; the last cell that could be read is shown:"))
            lines += map(plain, self.errors)
        if self.near is not None:
            words = bad if self.near.distance < MARGIN else plain
            lines.append(words(f"nearest {self.near.text}"))
        if self.note:
            lines.append(plain(self.note))
        return box(lines)

    def configuration(self, name: str) -> FloatArray | None:
        """Joint values (n,) of a posture, or of the best configuration at a station with what is
        held there; None, and a note, where there is none.
        """
        if name in ("home", "park"):
            return np.array(self.cell.posture(name))
        found = [each for each in self.found if each.station == name]
        chosen = next((each for each in found if each.free), found[0] if found else None)
        if chosen is None or chosen.q is None:
            self.note = chosen.sentence if chosen is not None else f"{name} is being checked"
            return None
        self.hold(chosen.load, self.places)
        return chosen.q


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
        self._worker = PlanWorker(
            self._inbox, Listener(self._checked, self._progress, self._planned)
        )
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
        self._worker.ask(ViewRequest(self._number, self._stage.cell, first, self._stations, quiet))

    def _cancel(self) -> None:
        self._worker.cancel()
        self._number += 1
        self._panel.working(False)
        self._panel.plan_text.content = box(["planning was cancelled"])

    def _checked(self, number: int, found: tuple[StationAccess, ...], complete: bool) -> None:
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
