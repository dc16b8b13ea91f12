"""A cell in viser's scene: robot, loads, machines with zones and stations, parts, a path.

The triangles are those of the report. A machine is a frame with all that belongs to it below, so
that moving it moves one frame.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from ir_cli.view.moves import placed
from ir_cli.view.playback import PlayedMotion
from ir_description import Body, Cell, PartPlaces
from ir_kernels import Chain
from ir_msgs_py.names import LOAD_SEPARATOR
from ir_recorder.report.shapes import Mesh, body_mesh, capsule_mesh, robot_parts
from ir_values.arrays import FloatArray

Colour = tuple[int, int, int]
KINDS: dict[str, Colour] = {
    "base": (70, 74, 80),
    "link": (235, 120, 40),
    "joint": (60, 64, 70),
    "tool": (120, 130, 140),
    "part": (40, 150, 140),
}
BODIES: tuple[Colour, ...] = (
    (150, 170, 190),
    (175, 165, 145),
    (150, 180, 155),
    (180, 155, 175),
    (165, 165, 165),
)
LYING: Colour = (40, 150, 140)
CAPSULE: Colour = (90, 140, 220)
HIGHLIGHT: Colour = (225, 30, 40)
ZONE: Colour = (200, 150, 30)
APPROACH: Colour = (60, 60, 200)
REACH: Colour = (120, 120, 120)
NEAR: Colour = (30, 150, 70)
TOO_NEAR: Colour = (225, 30, 40)
SCALE = np.array(
    [(48, 70, 170), (40, 150, 190), (60, 180, 90), (230, 200, 50), (220, 60, 40)], dtype=np.float64
)
"""From the least power to the most."""


def by_power(watts: FloatArray) -> NDArray[np.uint8]:
    """Colours (N, 3) of watts (N,), from the least of them to the most."""
    low = float(watts.min())
    high = float(watts.max())
    share = (watts - low) / max(high - low, 1e-9)
    steps = np.linspace(0.0, 1.0, len(SCALE))
    return np.stack([np.interp(share, steps, SCALE[:, k]) for k in range(3)], axis=1).astype(
        np.uint8
    )


# The outline of what the tool reaches.

POSTURES = 20_000
"""Drawn within the joint limits; more widen the outline by less than a centimetre."""
MERIDIANS = 8
_RING = 72


def reach_lines(cell: Cell) -> FloatArray:
    """Pieces (M, 2, 3) [m] in the base's frame: the convex outline in planes through axis 1, and
    its widest circle. Every place of the tcp of the drawn postures lies within; not every place
    within is reached.
    """
    robot = cell.robot
    q = np.random.default_rng(0).uniform(
        robot.position_min, robot.position_max, (POSTURES, robot.n)
    )
    places = Chain(robot, np.eye(4), cell.tcp).tcp_poses(q)[:, :3, 3] - robot.joint_origin[0][:3, 3]
    radius = np.hypot(places[:, 0], places[:, 1])
    both = np.concatenate([np.stack([s * radius, places[:, 2]], axis=1) for s in (1.0, -1.0)])
    outline = both[ConvexHull(both).vertices]
    closed = np.concatenate([outline, outline[:1]])
    lines = []
    for angle in np.arange(MERIDIANS // 2) * 2.0 * np.pi / MERIDIANS:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        points = closed[:, :1] * direction + closed[:, 1:] * np.array([0.0, 0.0, 1.0])
        lines.append(np.stack([points[:-1], points[1:]], axis=1))
    widest = outline[int(np.argmax(outline[:, 0]))]
    turn = np.linspace(0.0, 2.0 * np.pi, _RING + 1)
    ring = np.stack(
        [widest[0] * np.cos(turn), widest[0] * np.sin(turn), np.full(_RING + 1, widest[1])], 1
    )
    lines.append(np.stack([ring[:-1], ring[1:]], axis=1))
    return np.concatenate(lines) + robot.joint_origin[0][:3, 3]


# The first view of a browser.

DIRECTION = np.array([0.72, -0.78, 0.55])
"""Of the eye from the middle of the cell."""
DISTANCE = 0.95
"""Of the eye, per diagonal of the cell."""
LEAST = 2.0  # m: of a diagonal, for a robot alone


def look_at(server: Any, cell: Cell) -> None:
    """The first view of browsers that open from now on; those that look already keep theirs."""
    base = cell.base_pose[:3, 3]
    points = [base, base + np.array([0.0, 0.0, 1.5])]
    bodies = [
        body
        for machine in cell.equipment
        for body in machine.world_bodies()
        if body.kind != "plane"
    ]
    points += [corner for body in bodies for corner in body.bounds()]
    low = np.min(points, axis=0)
    high = np.max(points, axis=0)
    middle = (low + high) / 2.0
    size = max(float(np.linalg.norm(high - low)), LEAST)
    server.initial_camera.look_at = middle
    server.initial_camera.position = middle + DISTANCE * size * DIRECTION / np.linalg.norm(
        DIRECTION
    )


MOST_BODIES = 600
"""Up to so many bodies stand for themselves; more are drawn as one per machine, and can't be
highlighted.
"""
_BOX = [
    (0, 1),
    (1, 3),
    (3, 2),
    (2, 0),
    (4, 5),
    (5, 7),
    (7, 6),
    (6, 4),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
]


class Drawing:
    """A cell that is drawn; another one replaces all of it."""

    def __init__(self, scene: Any, cell: Cell) -> None:
        self._scene = scene
        self.cell = cell
        self._chain = Chain(cell.robot, cell.base_pose, cell.tcp)
        self._meshes: dict[
            str, tuple[Any, Colour]
        ] = {}  # by name of body or capsule: what is highlighted
        self._machines: dict[str, Any] = {}
        self._links: list[Any] = []
        self._held: dict[str, list[Any]] = {}
        self._parts: dict[str, Any] = {}
        self._stations: dict[str, Any] = {}
        self._shown: dict[str, list[Any]] = {"zones": [], "labels": [], "capsules": [], "reach": []}
        self._nearest: list[Any] = []
        self._robot()
        for machine in cell.equipment:
            if machine.enabled:
                self._machine(machine.name)
        for part in cell.parts:
            self._part(part.name)
        self._floor()
        self.states(cell)

    def _robot(self) -> None:
        cell = self.cell
        scene = self._scene
        for link in range(cell.robot.n + 1):
            self._links.append(scene.add_frame(f"/robot/link_{link}", show_axes=False))
        for k, part in enumerate(robot_parts(cell.robot)):
            self._mesh(f"/robot/link_{part.link}/look_{k}", part.mesh, KINDS[part.kind])
        for capsule in cell.robot.capsules:
            self._capsule(
                f"/robot/link_{capsule.link}", capsule.name, capsule_mesh(capsule), hidden=True
            )
        loads = [(load, "tool") for load in cell.loads()]
        loads += [(part.held(cell.tcp), "part") for part in cell.parts]
        for load, kind in loads:
            for capsule in load.capsules:
                path = f"/robot/link_{capsule.link}/held_{capsule.name}"
                handle = self._mesh(path, capsule_mesh(capsule), KINDS[kind])
                self._meshes[capsule.name] = handle, KINDS[kind]
                self._held.setdefault(load.name, []).append(handle)
        flange = scene.add_frame(
            f"/robot/link_{cell.robot.n}/tcp", axes_length=0.15, axes_radius=0.004
        )
        placed(flange, cell.tcp)
        base = scene.add_frame("/reach", show_axes=False)
        placed(base, cell.base_pose)
        lines = self._lines("/reach/outline", reach_lines(cell), REACH, 1.5, visible=False)
        self._shown["reach"].append(lines)

    def _capsule(self, parent: str, name: str, mesh: Mesh, *, hidden: bool) -> None:
        handle = self._mesh(f"{parent}/capsule_{name}", mesh, CAPSULE, opacity=0.4)
        handle.visible = not hidden
        self._meshes[name] = handle, CAPSULE
        self._shown["capsules"].append(handle)

    def _machine(self, name: str) -> None:
        machine = self.cell.machine(name)
        scene = self._scene
        frame = scene.add_frame(f"/machines/{name}", show_axes=False)
        placed(frame, machine.pose)
        self._machines[name] = frame
        bodies = machine.bodies
        colour = BODIES[[each.name for each in self.cell.equipment].index(name) % len(BODIES)]
        if sum(len(each.bodies) for each in self.cell.equipment) > MOST_BODIES:
            self._merged(name, machine.present_bodies(), colour)
        else:
            for body in bodies:
                self._body(f"/machines/{name}/{body.name}", body, colour)
        zone = machine.zone_in_equipment
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        corners = signs * zone.size @ zone.pose[:3, :3].T + zone.pose[:3, 3]
        edges = corners[np.array(_BOX)]
        self._shown["zones"].append(self._lines(f"/machines/{name}/zone", edges, ZONE, 1.5))
        top = np.array([zone.pose[0, 3], zone.pose[1, 3], corners[:, 2].max() + 0.3])
        self._shown["labels"].append(scene.add_label(f"/machines/{name}/name", name, position=top))
        for station in self.cell.stations:
            if station.equipment == name:
                self._station(station.name)

    def _station(self, name: str) -> None:
        station = self.cell.station(name)
        scene = self._scene
        path = f"/machines/{station.equipment}/station_{name}"
        frame = scene.add_frame(path, axes_length=0.15, axes_radius=0.006)
        placed(frame, station.pose_in_equipment)
        self._stations[name] = frame
        self._shown["labels"].append(scene.add_label(f"{path}/name", name, font_screen_scale=0.8))
        if station.approach_distance > 0.0:
            line = np.array([[[0.0, 0.0, 0.0], [-station.approach_distance, 0.0, 0.0]]])
            self._lines(f"{path}/approach", line, APPROACH, 2.0)

    def _part(self, name: str) -> None:
        """What lies where the part is put down, in the frame of its station."""
        frame = self._scene.add_frame(f"/parts/{name}", show_axes=False)
        for body in self.cell.part(name).lying(np.eye(4)):
            self._body(f"/parts/{name}/{body.name}", body, LYING)
        self._parts[name] = frame

    def _floor(self) -> None:
        far = max(
            (float(np.abs(machine.pose[:2, 3]).max()) for machine in self.cell.equipment),
            default=1.0,
        )
        size = 2.0 * (2.0 + far)
        self._scene.add_grid("/floor", width=size, height=size, visible=self.cell.floor)

    def _lines(
        self, path: str, ends: FloatArray, colours: Any, thickness: float, *, visible: bool = True
    ) -> Any:
        """Pieces (M, 2, 3) [m], as wide as so many pixels."""
        return self._scene.add_line_segments(
            path, ends, colours, thickness=thickness, thickness_units="screen", visible=visible
        )

    def _body(self, path: str, body: Body, colour: Colour) -> None:
        mesh = body_mesh(body)
        if mesh is not None:
            handle = self._mesh(path, mesh, colour)
            placed(handle, body.pose)
            self._meshes[body.name] = handle, colour

    def _merged(self, name: str, bodies: Sequence[Body], colour: Colour) -> None:
        points = []
        triangles = []
        count = 0
        for body in bodies:
            mesh = body_mesh(body)
            if mesh is not None:
                points.append(mesh.points @ body.pose[:3, :3].T + body.pose[:3, 3])
                triangles.append(mesh.triangles + count)
                count += len(mesh.points)
        if points:
            merged = Mesh(np.concatenate(points), np.zeros((0, 3)), np.concatenate(triangles))
            self._mesh(f"/machines/{name}/bodies", merged, colour)

    def _mesh(self, path: str, mesh: Mesh, colour: Colour, opacity: float | None = None) -> Any:
        return self._scene.add_mesh_simple(
            path,
            mesh.points.astype(np.float32),
            mesh.triangles.astype(np.uint32),
            color=colour,
            opacity=opacity,
            side="double",
        )

    def stand(self, q: FloatArray) -> None:
        """Puts the robot at q (n,)."""
        for frame, pose in zip(self._links, self._chain.link_poses(q[None])[0], strict=True):
            placed(frame, pose)

    def lie(self, places: PartPlaces, load: str) -> None:
        """Shows parts where they lie, and on the flange what is held: load as reports write it."""
        names = load.split(LOAD_SEPARATOR)
        for name, handles in self._held.items():
            for handle in handles:
                handle.visible = name in names
        for name, frame in self._parts.items():
            at = places.lying.get(name, "")
            frame.visible = bool(at) and name not in names
            if at:
                placed(frame, self.cell.station(at).pose)

    def move(self, cell: Cell) -> None:
        """Puts machines and stations where another version of the same cell has them."""
        self.cell = cell
        for name, frame in self._machines.items():
            placed(frame, cell.machine(name).pose)
        for name, frame in self._stations.items():
            placed(frame, cell.station(name).pose_in_equipment)

    def states(self, cell: Cell) -> None:
        """Shows of each machine what is there in its state."""
        for machine in cell.equipment:
            there = {body.name for body in machine.present_bodies()}
            bound = {
                name for state in machine.states for name in state.bodies
            } & self._meshes.keys()
            for name in bound:
                self._meshes[name][0].visible = name in there

    def highlight(self, names: Collection[str]) -> None:
        """Shows bodies and capsules of these names in red, all others in their own colour."""
        capsules = set(map(id, self._shown["capsules"]))
        for name, (handle, colour) in self._meshes.items():
            wanted = HIGHLIGHT if name in names else colour
            if tuple(handle.color) != wanted:
                handle.color = wanted
                if id(handle) in capsules and not self.capsules:
                    handle.visible = name in names

    capsules = False
    """Whether the robot's capsules are shown."""

    def show(self, what: str, visible: bool) -> None:
        """Shows or hides "zones", "labels", "capsules" or "reach"."""
        if what == "capsules":
            self.capsules = visible
        for handle in self._shown[what]:
            handle.visible = visible

    def nearest(self, point_a: FloatArray, point_b: FloatArray, text: str, near: bool) -> None:
        """Draws the line between the nearest points (3,) of a pair, with its distance."""
        line = np.stack([point_a, point_b])[None]
        self._lines("/nearest", line, TOO_NEAR if near else NEAR, 4.0)
        self._scene.add_label("/nearest_text", text, position=(point_a + point_b) / 2.0)

    def path(self, motion: PlayedMotion | None) -> None:
        """Draws the tool's path, coloured by power; None: nothing."""
        at = np.zeros(0, dtype=int) if motion is None else motion.segments()
        if motion is None or not len(at):
            self._lines("/path", np.zeros((1, 2, 3)), REACH, 1.0, visible=False)
        else:
            ends = np.stack([at, at + 1], axis=1)
            self._lines("/path", motion.tool[ends], by_power(motion.watts)[ends], 3.0)
