"""Session of `ir view`: what the page shows, moved machines and plans, all in one thread."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ir_cli.errors import CommandError
from ir_cli.view.background import QUIET, Inbox, Listener, Planned, PlanWorker, ViewRequest
from ir_cli.view.cell_file import Recorded, Watched, save
from ir_cli.view.clearance import Nearest, NearestPairs, StationAccess, names_in
from ir_cli.view.moves import (
    DragTarget,
    cell_with,
    moved_pose,
    numbers_of,
    pose_of_numbers,
    snippet,
    targets,
)
from ir_cli.view.playback import PlayedMotion
from ir_cli.view.scene import planned_content, recorded_content, still_content
from ir_description import Cell, DescriptionError, PartPlaces, cell_to_yaml
from ir_description.poses import composed, inverse
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_recorder.live.server import ButtonAnswer, LiveServer, Site
from ir_recorder.live.stream import Stream
from ir_recorder.report.cell_scene import matrix
from ir_recorder.report.data import page_content
from ir_recorder.report.headline import driven_tiles
from ir_recorder.report.number_text import (
    kilowatt_hours,
    millimetres,
    seconds,
    span_of,
    watts,
)
from ir_recorder.report.series import Json
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, one_line

# What a control may send: no more than a hand can say.

MOST_WORDS = 200
MOST_NUMBERS = 64


def is_value(value: object) -> bool:
    """Whether it is true or false, a number, a text, or a short list of numbers and texts."""
    if isinstance(value, list):
        return len(value) <= MOST_NUMBERS and all(_is_plain(each) for each in value)
    return isinstance(value, bool) or _is_plain(value)


def _is_plain(value: object) -> bool:
    if isinstance(value, str):
        return len(value) <= MOST_WORDS
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9


CELL_SITE = Site(
    "view_cell.html",
    ("player.js", "view.js"),
    is_value,
    "true, a number, a text, or a list of these",
    private=True,
)
"""Of a cell file or a recording: nobody looks without the token."""

# The cell with its robot, what it holds, and what is wrong.


class ShownCell:
    """A cell as it is shown, its robot at q (n,).

    found, failure and errors say what is wrong with it, note what happened last.
    """

    def __init__(self, cell: Cell, q: FloatArray) -> None:
        self._pairs = NearestPairs()
        self.cell = cell
        self.now = cell
        self.q = q
        self.held = cell.tool.name if cell.tool is not None else ""
        self.places = cell.parts_at_start()
        self.near: Nearest | None = None
        self.found: tuple[StationAccess, ...] = ()
        self.errors: tuple[str, ...] = ()
        self.failure = ""
        self.note = ""

    def move(self, cell: Cell) -> None:
        """Another version of the same cell: machines and stations stand elsewhere."""
        self.cell = cell
        self.now = cell
        self.found = ()
        self.failure = ""
        self.note = ""

    def hold(self, load: str, places: PartPlaces, cell: Cell | None = None) -> None:
        """What the robot holds, where the parts lie, and the cell with its machines in other
        states.
        """
        self.now = cell or self.cell
        self.held = load
        self.places = places

    def stand(self, q: FloatArray, movement: PlannedMovement | None = None) -> None:
        """Put the robot at q (n,), on its course in a movement or by hand."""
        self.q = q
        self.near = self._pairs.at(self.now, q, self.held, self.places, movement)

    def blamed(self) -> list[str]:
        """Bodies and capsules that are too near or obstruct."""
        names = set(names_in(f"{self.failure} {' '.join(self.errors)}", self.cell))
        names.update(name for each in self.found if not each.free for name in each.pair)
        if self.near is not None and self.near.distance < DEFAULT_SAFETY_DISTANCE:
            names.update(self.near.names)
        return sorted(names)

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


LOOK = 0.3
"""Seconds between two looks at the file."""
BEAT = 1.0
"""Seconds after which the page hears that the view goes on."""
_LINE = 400  # characters of a sentence on the page
_SAME = 1e-9  # m, of poses
PREDICTED = "Predicted, not driven"


@dataclass(frozen=True)
class ViewControl:
    """What a control does, in the session's thread, and what kind of value it takes."""

    act: Callable[[Any], None]
    kind: tuple[type, ...] = (bool,)


class Session:
    """Shows a cell until `run` returns; `close` ends its threads. RecorderError where the port is
    taken.
    """

    def __init__(
        self, source: Watched | Recorded, stations: tuple[str, ...] = (), port: int = 0
    ) -> None:
        self._source = source
        self._stations = stations
        self._inbox = Inbox()
        self._stream = Stream()
        self._scene = b""
        self._number = 0
        self._scenes = 0
        self._motion: PlayedMotion | None = None
        self._moves: dict[DragTarget, FloatArray] = {}
        self._file: Cell | None = None
        self._drawn: Cell | None = None  # as the scene has it
        self._shown_cell: ShownCell | None = None
        self._looked = time.monotonic()
        self._beat = self._looked
        self._controls = {
            "joints": ViewControl(self._stand_at_joints, (list,)),
            "at": ViewControl(self._stand_at_place, (str,)),
            "time": ViewControl(self._show_time, (int, float)),
            "move": ViewControl(self._move_target, (list,)),
            "undo": ViewControl(self._undo),
            "save": ViewControl(self._save),
            "plan": ViewControl(lambda _: self._ask()),
            "cancel": ViewControl(self._cancel),
            "compare": ViewControl(self._compare),
            "recorded": ViewControl(self._replay),
        }
        self.server = LiveServer(
            self._stream, self._press, lambda: self._scene, port, site=CELL_SITE
        )
        self._worker = PlanWorker(
            self._inbox, Listener(self._show_access, self._show_progress, self._show_plan)
        )
        self._say(name=one_line(source.name, MOST_WORDS), source=one_line(source.source, _LINE))
        self._read()

    def run(self, until: float = np.inf) -> None:
        """Do what browsers, file and planner ask for, until the monotonic clock says `until`
        [s].
        """
        while True:
            now = time.monotonic()
            if now >= until:
                return
            for action in self._inbox.take(LOOK / 3.0):
                action()
            if now - self._beat >= BEAT:
                self._beat = now
                self._stream.add({})
            if now - self._looked >= LOOK:
                self._looked = now
                if self._source.changed(now):
                    self._read()

    def close(self) -> None:
        """End what is planned, and the server."""
        self._worker.close()
        self.server.close()

    def _press(self, name: str, value: Any) -> ButtonAnswer:
        """What a browser asks for: refused, or done by the session's thread."""
        control = self._controls.get(name)
        if control is None:
            known = ", ".join(self._controls)
            return ButtonAnswer(
                False, f"{name[:60]!r} is no control of this page: known are {known}"
            )
        if not isinstance(value, control.kind) or (
            bool not in control.kind and isinstance(value, bool)
        ):
            kinds = " or ".join(kind.__name__ for kind in control.kind)
            return ButtonAnswer(False, f"{name} must have a value of the kind {kinds}")
        self._inbox.post(name, partial(control.act, value))
        return ButtonAnswer(True, "")

    def _say(self, **values: Json) -> None:
        self._stream.add(values, always=("q", "hand") if values.get("hand") else ())

    # the cell, its file and its picture

    def _read(self) -> None:
        """Take the file as it is now; where it has errors, these stand beside the cell that it
        had.
        """
        reading = self._source.read()
        cell = reading.cell
        file = self._file
        errors = [one_line(error, _LINE) for error in reading.errors]
        if cell is not None and (file is None or cell_to_yaml(cell) != cell_to_yaml(file)):
            note = "read again; what was moved is dropped" if self._moves else ""
            self._show(cell, note)
        if self._shown_cell is None:
            self._say(errors=["the file can't be read:", *errors])
            return
        self._shown_cell.errors = tuple(reading.errors)
        first = "the file can't be read; the last cell that could be read is shown:"
        self._say(errors=[first, *errors] if errors else [], blamed=list(self._shown_cell.blamed()))

    def _show(self, cell: Cell, note: str) -> None:
        """Another cell from the file: everything is drawn again."""
        before = self._shown_cell
        same_robot = self._file is not None and (
            self._file.robot.document == cell.robot.document
            and self._file.robot.name == cell.robot.name
        )
        q = before.q if same_robot and before is not None else np.array(cell.machine_home)
        self._file = cell
        self._moves = {}
        shown = ShownCell(cell, q)
        self._shown_cell = shown
        shown.note = note
        shown.stand(q)
        self._say(name=one_line(cell.name, MOST_WORDS), compared="", stations=[], tiles=[])
        if isinstance(self._source, Recorded):
            self._replay(True)
        else:
            self._draw(still_content(cell))
            self._show_by_hand()
            self._ask()

    def _cell_on_page(self) -> ShownCell:
        """The cell that is shown, once a first one could be read."""
        assert self._shown_cell is not None
        return self._shown_cell

    def _draw(self, scene: bytes) -> None:
        """Another scene, of the cell as it stands now."""
        shown = self._cell_on_page()
        self._scene = scene
        self._drawn = shown.cell
        self._scenes += 1
        self._say(scene=str(self._scenes), **self._standing_values())

    def _standing_values(self) -> dict[str, Json]:
        """Where machines and stations stand: in the world, and against the scene."""
        shown = self._cell_on_page()
        drawn = self._drawn
        assert drawn is not None  # a scene comes before anything that stands in it
        cell = shown.cell
        poses: dict[str, Json] = {}
        for target in targets(cell):
            here = (
                cell.machine(target.name).pose
                if target.kind == "equipment"
                else cell.station(target.name).pose
            )
            poses[target.text] = list(numbers_of(here))
        moved: dict[str, Json] = {}
        for machine in cell.equipment:
            before = drawn.machine(machine.name).pose
            if np.abs(machine.pose - before).max() > _SAME:
                moved[machine.name] = matrix(composed(machine.pose, inverse(before)))
        stood: dict[str, Json] = {
            station.name: matrix(station.pose)
            for station in cell.stations
            if np.abs(station.pose - drawn.station(station.name).pose).max() > _SAME
        }
        return {"poses": poses, "moved": moved, "stood": stood, "snippet": snippet(self._moves)}

    # the robot by hand

    def _show_by_hand(self) -> None:
        """Show the robot where it was put."""
        shown = self._cell_on_page()
        lies: dict[str, Json] = {
            name: matrix(shown.cell.station(at).pose)
            for name, at in shown.places.lying.items()
            if at
        }
        q: list[Json] = [round(float(value), 5) for value in shown.q]
        self._say(hand=True, q=q, held=shown.held, lies=lies, **self._near_values())

    def _near_values(self) -> dict[str, Json]:
        """What is nearest to the robot, whom that blames, and the note."""
        shown = self._cell_on_page()
        near = shown.near
        line: Json = None
        if near is not None:
            points = [round(float(x), 4) for x in (*near.point_a, *near.point_b)]
            line = [round(near.distance, 5), *points, near.text]
        return {
            "near": line,
            "blamed": list(shown.blamed()),
            "note": one_line(shown.note, _LINE),
        }

    def _stand_at_joints(self, given: list[Any]) -> None:
        """Stand at values in degrees, of a rail in m."""
        shown = self._shown_cell
        if shown is None:
            return
        robot = shown.cell.robot
        if len(given) != robot.n or not all(isinstance(each, int | float) for each in given):
            units = ", ".join(dict.fromkeys(robot.unit(k) for k in range(robot.n)))
            self._say(note=f"the robot has {robot.n} joints: so many numbers ({units}) are needed")
            return
        shown.note = ""
        q = robot.from_people_units(np.array(given, dtype=float))
        q = np.clip(q, robot.position_min, robot.position_max)
        shown.now = shown.cell
        shown.stand(q)
        self._show_by_hand()

    def _stand_at_place(self, name: str) -> None:
        """Stand in a posture, or at a station."""
        shown = self._shown_cell
        if shown is None:
            return
        shown.note = ""
        shown.now = shown.cell
        q = shown.configuration(name)
        if q is None:
            self._say(note=one_line(shown.note, _LINE))
            return
        shown.stand(q)
        shown.note = f"robot at {name}"
        self._show_by_hand()

    # the motion

    def _show_time(self, at: float) -> None:
        """What is near at a time [s] of the plan; a recording has that in its scene."""
        shown = self._shown_cell
        motion = self._motion
        if shown is None or motion is None:
            self._say(hand=False, note="")
            return
        step = motion.step(float(at))
        shown.hold(step.load, step.places, step.cell)
        shown.stand(step.at(float(at)), step.movement)
        shown.note = f"{step.label}, {watts(motion.watts(float(at)))}"
        self._say(hand=False, nearNow=True, **self._near_values())

    def _replay(self, _: bool) -> None:
        """Show the recorded motion again."""
        source = self._source
        shown = self._shown_cell
        if not isinstance(source, Recorded) or shown is None:
            return
        analysis = source.analysis
        known = np.isfinite(analysis.safety_distance)
        content = page_content(
            analysis, analysis.safety_distance if known else DEFAULT_SAFETY_DISTANCE
        )
        self._motion = None
        self._draw(recorded_content(content, shown.cell))
        recording = analysis.recording
        driven = driven_tiles(analysis)
        # the other notes of the first tile, energy, are a line below
        notes = [driven[0].notes[:1], *(tile.notes for tile in driven[1:])]
        tiles: list[Json] = [
            [tile.name, tile.value, "; ".join(filter(None, kept))]
            for tile, kept in zip(driven, notes, strict=True)
        ]
        kind = "Simulated, not measured" if recording.origin == "simulated" else "Measured"
        said = "The recording as it was driven."
        if recording.only_planned:
            kind = PREDICTED
            said = "The plan as it was written."
        more = "; ".join(filter(None, driven[0].notes[1:]))
        lines: list[Json] = [said, *([f"Energy: {more}."] if more else [])]
        self._say(
            origin=kind,
            recorded=True,
            hand=False,
            near=None,
            tiles=tiles,
            plan={"state": "recorded", "lines": lines, "share": 0.0},
        )
        self._ask(plan=False)

    # machines and stations by hand

    def _move_target(self, words: list[Any]) -> None:
        """Move a machine or a station; words: its name, and the numbers of its pose."""
        shown = self._shown_cell
        file = self._file
        if shown is None or file is None:
            return
        name = str(words[0]) if words else ""
        target = next((each for each in targets(shown.cell) if each.text == name), None)
        if target is None:
            self._say(note=f"{name[:60]!r} is no machine or station of this cell")
            return
        try:
            pose = moved_pose(target, pose_of_numbers(words[1:]), shown.cell, file)
            moves = {**self._moves, target: pose}
            cell = cell_with(file, moves)
        except (DescriptionError, InvalidValueError, TypeError, ValueError) as error:
            self._say(note=one_line(f"{name} can't stand there: {error}", _LINE))
            return
        self._show_moves(cell, moves, target)

    def _show_moves(
        self, cell: Cell, moves: dict[DragTarget, FloatArray], target: DragTarget | None
    ) -> None:
        """Show and plan the cell with these moves; target: what moved last."""
        shown = self._cell_on_page()
        self._moves = moves
        self._motion = None
        shown.move(cell)
        shown.stand(shown.q)
        self._say(stations=[], tiles=[], compared="", **self._standing_values())
        self._show_by_hand()
        first = [
            station.name
            for station in cell.stations
            if target is not None and target.name in (station.name, station.equipment)
        ]
        self._ask(frozenset(first), QUIET)

    def _undo(self, _: bool) -> None:
        if self._file is not None:
            self._show_moves(self._file, {}, None)

    def _save(self, _: bool) -> None:
        if self._file is None or not self._moves:
            return
        try:
            note = f"written: {save(self._source, self._file, self._moves)}"
        except CommandError as error:
            note = f"nothing was written: {error}"
        self._say(note=one_line(note, _LINE))

    # what is planned

    def _ask(
        self,
        first: frozenset[str] = frozenset(),
        quiet: float = 0.0,
        *,
        plan: bool = True,
        compare: bool = False,
    ) -> None:
        shown = self._shown_cell
        if shown is None:
            return
        self._number += 1
        if plan:
            self._say_planning("comparing …" if compare else "planning …", 0.0)
        asked = ViewRequest(
            self._number, shown.cell, first, self._stations, quiet, plan=plan, compare=compare
        )
        self._worker.ask(asked)

    def _compare(self, _: bool) -> None:
        self._ask(compare=True)

    def _say_planning(self, words: str, share: float) -> None:
        self._say(plan={"state": "planning", "lines": [words], "share": round(share, 2)})

    def _cancel(self, _: bool) -> None:
        self._worker.cancel()
        self._number += 1
        self._say(plan={"state": "cancelled", "lines": ["planning was cancelled"], "share": 0.0})

    def _show_access(self, number: int, found: tuple[StationAccess, ...], complete: bool) -> None:
        shown = self._shown_cell
        if number != self._number or shown is None:
            return
        shown.found = found
        rows: list[Json] = [_access(each) for each in found]
        self._say(stations=rows, checked=complete, blamed=list(shown.blamed()))

    def _show_progress(self, number: int, phase: str, done: int, total: int) -> None:
        if number == self._number:
            self._say_planning(f"planning: {phase} {done} of {total}", done / max(total, 1))

    def _show_plan(self, number: int, plan: Planned) -> None:
        """Show what was planned, compared, or why there is no plan."""
        shown = self._shown_cell
        if number != self._number or shown is None:
            return
        shown.failure = plan.failure
        if plan.compared:
            lines: list[Json] = ["compared: the figures stand below"]
            self._say(
                compared=plan.compared, plan={"state": "planned", "lines": lines, "share": 1.0}
            )
            return
        lines = [one_line(line, _LINE) for line in plan.lines]
        state = "planned"
        if plan.failure:
            state = "failed"
            lines = [one_line(f"not planned: {plan.failure}", _LINE), *lines]
        elif plan.motion is None:
            state = "none"
            lines = ["the cell has neither program nor tasks: nothing was planned"]
        self._motion = plan.motion
        if plan.motion is not None:
            self._draw(planned_content(plan.motion.side, shown.cell))
            self._say(hand=False, near=None, note="", origin=PREDICTED)
        tiles = _tiles(plan.report) if plan.report is not None else []
        self._say(
            tiles=tiles,
            blamed=list(shown.blamed()),
            plan={"state": state, "lines": lines, "share": 1.0},
        )


def _access(each: StationAccess) -> list[Json]:
    """A station with one load: how many configurations are free, or why none is."""
    words = f"{each.free} of {each.reached} free"
    if each.free and each.clearance is not None:
        words += f", {1e3 * each.clearance:.1f} mm"
        words += " to allowed contacts" if each.clearance < DEFAULT_SAFETY_DISTANCE else ""
    return [each.station, each.load, words, each.free > 0, one_line(each.sentence, _LINE)]


def _tiles(report: TrajectoryReport) -> list[Json]:
    """The figures of a plan, as every page has them."""
    within = span_of(report.energy_low, report.energy_high, kilowatt_hours)
    return [
        ["cycle", seconds(report.duration), "planned, as fast as pays"],
        ["energy a cycle", kilowatt_hours(report.energy), f"90 % interval {within}"],
        ["peak power", watts(report.peak_power), "at the mains, predicted"],
        ["least clearance", millimetres(report.min_clearance), "without pairs that may touch"],
        [
            "clearance and limits",
            "proved" if report.certified else "not certified",
            "at every instant",
            not report.certified,
        ],
    ]
