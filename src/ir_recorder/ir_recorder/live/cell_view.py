"""The cell as the nodes describe it: what the page draws, the parts' places, the nearest pair,
planned paths.

It runs in a worker's thread, over whatever was heard last: a large cell or a slow machine delays
the picture, and nothing else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, DescriptionError, PartPlaces, cell_from_yaml
from ir_description.cell import cell_in
from ir_kernels import Chain, CollisionModel
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.analysis.clearance import allowed_pairs, collision_model, pair_name, places_after
from ir_recorder.reading.recording import TextEvent
from ir_recorder.report.cell_scene import cell_scene, door_bodies, matrix, part_meshes
from ir_recorder.report.series import Json, floats
from ir_values.arrays import FloatArray
from ir_values.errors import one_line

PATH_POINTS = 200  # of a planned path: a corner every 2 cm of a long movement
MOST_STEPS = 2_000
"""Ended steps between two looks; a stranger may say more."""


@dataclass(frozen=True, eq=False)
class ReceivedCell:
    """What was heard last.

    cell: the text of its file; states: machine and state, "shut>open" while it changes; joints, q:
    names and values (n,) [rad], None while none are heard; load: what is carried; movement: the
    step that runs; ended: steps since the last look, None among them where a program begins; path:
    what is or will be driven.
    """

    cell: str = ""
    states: tuple[tuple[str, str], ...] = ()
    joints: tuple[str, ...] = ()
    q: FloatArray | None = None
    load: str = ""
    movement: PlannedMovement | None = None
    ended: Sequence[PlannedMovement | None] = ()
    path: JointTrajectory | None = None


class CellView:
    """Keeps the cell between looks; `scene` may be read by any thread."""

    def __init__(self) -> None:
        self.scene = b""
        self._text = ""
        self._scene_id = ""
        self._states: tuple[tuple[str, str], ...] = ()
        self._read_cell: Cell | None = None  # as its file has it
        self._standing: dict[str, tuple[str, ...]] = {}  # machines that stand otherwise, or change
        self._cell: Cell | None = None  # as it stands
        self._problem = ""
        self._places = PartPlaces("", {})
        self._version = 0
        self._model: tuple[object, CollisionModel] | None = None
        self._path: tuple[JointTrajectory | None, str] = (None, "")

    def look(self, heard: ReceivedCell) -> dict[str, Json]:
        """What has to be shown: name, problem, number of the scene, places of parts, nearest pair,
        path.
        """
        if heard.cell != self._text:
            self._read(heard.cell)
        if self._cell is None:
            return {
                "cell": "",
                "problem": self._problem,
                "scene": "",
                "near": None,
                "path": "",
                "lies": {},
            }
        if heard.states != self._states:
            self._stand(heard.states)
        for movement in heard.ended[:MOST_STEPS]:
            if movement is None:
                self._places = self._cell.parts_at_start()
            else:
                self._places = places_after(self._cell, self._places, movement)
        return {
            "cell": one_line(self._cell.name, 200),
            "problem": "",
            "scene": self._scene_id,
            "lies": self._lies(),
            "near": self._near(heard),
            "path": self._path_of(heard.path),
        }

    def _read(self, text: str) -> None:
        self._text = text
        self._states = ()
        self._cell = None
        self.scene = b""
        self._model = None
        self._read_cell = None
        self._standing = {}
        try:
            self._cell = cell_from_yaml(text) if text else None
            self._read_cell = self._cell
            self._problem = ""
        except DescriptionError as error:
            self._problem = one_line(f"the planner's cell can't be read: {error}", 300)
            return
        if self._cell is not None:
            self._places = self._cell.parts_at_start()
            self._show()

    def _stand(self, states: tuple[tuple[str, str], ...]) -> None:
        """Puts the machines into the states that the driver says they are in; what they sweep while
        they change is there, too. States that the planner's cell doesn't have are not followed.
        """
        self._states = states
        if self._read_cell is None:
            return
        heard = {name: tuple(text.split(">")) for name, text in states}
        standing = {}
        for machine in self._read_cell.equipment:
            now = heard.get(machine.name, ())
            known = {state.name for state in machine.states}
            if 1 <= len(now) <= 2 and known.issuperset(now) and now != (machine.state,):
                standing[machine.name] = now
        if standing != self._standing:
            self._standing = standing
            self._model = None
            self._cell = cell_in(self._read_cell, standing)
            self._show()

    def _show(self) -> None:
        """Make the scene anew of the cell and its doors as they stand, without frames: a live view
        has none.
        """
        cell = self._cell
        read = self._read_cell
        if cell is None or read is None:
            return
        self._version += 1
        doors = [TextEvent(0.0, name, ">".join(now)) for name, now in self._standing.items()]
        self._path = (None, "")
        content = {
            **cell_scene(cell),
            "bodies": door_bodies(read, doors),
            **{
                "start": 0.0,
                "step": 1.0,
                "frames": 0,
                "jointSteps": [],
                "jointValues": "",
                "power": "",
            },
            "parts": [
                {"name": part.name, "lies": [], "meshes": part_meshes(cell, part.name)}
                for part in cell.parts
            ],
            **{"loads": [], "nearest": []},
        }
        self.scene = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        self._scene_id = hashlib.sha256(self.scene).hexdigest()[:16]

    def _lies(self) -> dict[str, Json]:
        """Where each part lies, for those that lie somewhere."""
        cell = self._cell
        places = self._places.lying
        return {
            name: matrix(cell.station(at).pose)
            for name, at in places.items()
            if at and cell is not None
        }

    def _near(self, heard: ReceivedCell) -> Json:
        """Distance [m], the two points and the names of the nearest pair that isn't allowed to
        touch, with the load of the movement that runs; None in a pause. Both as in a report: what
        stands at a station may touch it, and the word of a new load may come late.
        """
        cell = self._cell
        q = self.in_order(heard.joints, heard.q)
        pausing = heard.movement is not None and heard.movement.is_pause
        if cell is None or q is None or pausing:
            return None
        own = heard.movement.load if heard.movement is not None else ""
        load = own or heard.load
        key = (self._version, load, tuple(sorted(self._places.lying.items())))
        if self._model is None or self._model[0] != key:
            self._model = (key, collision_model(cell, load, self._places))
        model = self._model[1]
        offset = np.zeros(len(model.pairs))
        if heard.movement is not None:
            offset[~np.isnan(allowed_pairs(cell, heard.movement, model))] = -np.inf
        near = model.min_distance(q[None], offset)
        if not np.isfinite(near.distance[0]):
            return None
        points = [round(float(x), 4) for x in (*near.point_a[0], *near.point_b[0])]
        return [round(float(near.distance[0]), 5), *points, pair_name(model, int(near.pair[0]))]

    def _path_of(self, path: JointTrajectory | None) -> str:
        """The tool's path (PATH_POINTS, 3) [m], packed; "" for none."""
        cell = self._cell
        if path is None or cell is None:
            return ""
        if self._path[0] is not path:
            q = self.in_order(path.joint_names, path.sample(_spread(path.times)).q)
            chain = Chain(cell.robot, cell.base_pose, cell.tcp)
            self._path = (path, "" if q is None else floats(chain.tcp_poses(q)[:, :3, 3]))
        return self._path[1]

    def in_order(self, names: Sequence[str], values: FloatArray | None) -> FloatArray | None:
        """Values (..., n) in the robot's order of joints; None for other joints, or without
        numbers.
        """
        robot = self._cell.robot if self._cell is not None else None
        if robot is None or values is None or sorted(names) != sorted(robot.joint_names):
            return None
        if values.shape[-1] != robot.n or not np.isfinite(values).all():
            return None
        order = [list(names).index(name) for name in robot.joint_names]
        return np.ascontiguousarray(values[..., order])


def _spread(times: FloatArray) -> FloatArray:
    """PATH_POINTS instants from the first to the last of the times [s]."""
    return np.linspace(times[0], times[-1], PATH_POINTS)
