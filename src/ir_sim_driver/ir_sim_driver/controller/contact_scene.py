"""What the robot can touch at one moment: itself, tool and part against machines, floor and lying
parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property

import numpy as np

from ir_description import AllowedContact, Body, Capsule, Cell, cell_in, sweep_speeds
from ir_kernels.chain import Chain
from ir_kernels.collision import CollisionModel
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.errors import InvalidValueError
from ir_sim_driver.controller.machines import Machines
from ir_sim_driver.controller.parts import Parts
from ir_sim_driver.plant import Carried

TOUCH = 1e-5  # m of overlap that counts as touching: ten times what distances are off by
ALLOWED_DEPTH = 5e-3  # m that an allowed pair may overlap: as far as the tool may be off its path
# links
_UPPER_ARM = 2
_FOREARM = 3
ZONE_MARGIN = 0.05  # m around a zone where its contacts are still allowed: beyond usual S_m


class ContactScene:
    """All pairs of `capsules` and `bodies`, and of capsules among themselves. Never changed.

    speeds: bounds [m/s] of bodies that move by themselves, by name.
    """

    def __init__(
        self,
        cell: Cell,
        chain: Chain,
        load: Carried,
        bodies: Iterable[Body],
        speeds: Mapping[str, float] | None = None,
    ) -> None:
        self.cell = cell
        self.chain = chain
        bodies = tuple(bodies)
        self.speeds = speeds or {}
        self.capsules: tuple[Capsule, ...] = (
            *cell.robot.capsules,
            *(capsule for each in load.loads for capsule in each.capsules),
        )
        own = (
            *(
                (capsule.name, other)
                for each in load.loads
                for capsule in each.capsules
                for other in cell.robot.load_self_capsules
            ),
            *cell.robot.self_pairs,
        )
        there = {*(capsule.name for capsule in self.capsules), *(body.name for body in bodies)}
        ignored = tuple(pair for pair in cell.ignored_pairs if there.issuperset(pair))
        self.model = CollisionModel(chain, self.capsules, bodies, own, ignored)
        self.touching: FloatArray = np.full(len(self.model.pairs), -TOUCH)

    @classmethod
    def of(
        cls, cell: Cell, chain: Chain, load: Carried, machines: Machines, parts: Parts
    ) -> ContactScene:
        """The scene of the cell as its machines and parts are now."""
        floor = tuple(body for body in cell.bodies() if body.name == "floor") if cell.floor else ()
        states = machines.present_states()
        elsewhere = {
            each.name: states[each.name]
            for each in cell.equipment
            if states[each.name] != (each.state,)
        }
        # machines as the file has them keep their placed bodies, which take long to make
        around = (
            body for each in cell_in(cell, elsewhere).equipment for body in each.world_bodies()
        )
        speeds = {
            name: speed
            for machine in cell.equipment
            if len(states[machine.name]) == 2
            for name, speed in sweep_speeds(machine, *states[machine.name]).items()
        }
        return cls(cell, chain, load, (*floor, *around, *parts.bodies()), speeds)

    @cached_property
    def groups(self) -> tuple[tuple[BoolArray, FloatArray], ...]:
        """Pairs (Z,) with the reaches (n,) [m] of the joints that move them: those of links 1 and 2
        with what stands around, those of the wrist among themselves, and all others.
        """
        n = len(self.reach)
        link = {capsule.name: capsule.link for capsule in self.capsules}
        outer = np.array([max(link[a], link.get(b, 0)) for _, a, b in self.model.pairs], dtype=int)
        inner = np.array([min(link[a], link.get(b, 0)) for _, a, b in self.model.pairs], dtype=int)
        wrist = inner >= _FOREARM
        near = (inner == 0) & (outer <= _UPPER_ARM)
        joints = np.arange(n)
        return (
            (near, self._reach_of(_ends(c for c in self.capsules if c.link <= _UPPER_ARM))),
            (wrist, np.where(joints >= _FOREARM, self.reach, 0.0)),
            (~near & ~wrist, self.reach),
        )

    @cached_property
    def reach(self) -> FloatArray:
        """(n,): how far from each joint's axis anything that it moves can be [m]."""
        return self._reach_of(_ends(self.capsules))

    def _reach_of(self, points: Iterable[tuple[int, float]]) -> FloatArray:
        """The same for points on links, so far [m] from their frames."""
        robot = self.cell.robot
        offsets = np.linalg.norm(np.array(robot.joint_origin)[:, :3, 3], axis=1)
        result = np.zeros(robot.n)
        for link, far in points:
            for joint in range(link - 1, -1, -1):
                result[joint] = max(result[joint], far)
                far += float(offsets[joint])
        return result

    def contacts(self, stop: str) -> tuple[AllowedContact, ...]:
        """What a station or a path allows. Raises InvalidValueError (one that nobody has)."""
        try:
            return self.cell.contacts_at(stop)
        except LookupError as error:
            raise InvalidValueError(str(error)) from error

    def allowed(self, station: str) -> BoolArray:
        """Which pairs (Z,) may touch at a station; none for ""."""
        if not station:
            return np.zeros(len(self.model.pairs), dtype=bool)
        contacts = {frozenset((c.body_a, c.body_b)) for c in self.contacts(station)}
        return np.array([frozenset((a, b)) in contacts for _, a, b in self.model.pairs], dtype=bool)

    def inside(self, q: FloatArray, station: str) -> bool:
        """Whether the tcp at q (n,) is in the zone of a station's machine, or within ZONE_MARGIN of
        it.
        """
        return bool(self.depth(q[None], station)[0] >= 0.0)

    def depth(self, q: FloatArray, station: str) -> FloatArray:
        """(N,): how far [m] the tcp at q (N, n) is from leaving that; negative: from getting
        there.
        """
        zone = self.cell.zone_at(station)
        if zone is None:
            return np.full(len(q), -np.inf)
        tcp = self.chain.tcp_poses(q)[:, :3, 3]
        local = (tcp - zone.pose[:3, 3]) @ zone.pose[:3, :3]
        beyond = np.abs(local) - 0.5 * zone.size
        far = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
        depth: FloatArray = ZONE_MARGIN - far - np.minimum(beyond.max(axis=1), 0.0)
        return depth

    @cached_property
    def tcp_reach(self) -> FloatArray:
        """(n,): how far from each joint's axis the tcp can be [m]."""
        return self._reach_of([(self.cell.robot.n, float(np.linalg.norm(self.cell.tcp[:3, 3])))])


def _ends(capsules: Iterable[Capsule]) -> Iterator[tuple[int, float]]:
    """Link and distance [m] from its frame of what moves farthest of each: the end of its
    segment.
    """
    for capsule in capsules:
        yield (
            capsule.link,
            max(float(np.linalg.norm(capsule.p0)), float(np.linalg.norm(capsule.p1))),
        )
