"""Contact monitoring: what the robot touches in the cell as it is now."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Body, Cell
from ir_kernels.collision import CollisionModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.announcements import Contact, MachineState
from ir_msgs_py.report import DistancePair
from ir_sim_driver.controller.cell_scene import (
    ALLOWED_DEPTH,
    SOON,
    ContactScene,
    Keep,
    MachinesInScene,
    Parts,
)
from ir_sim_driver.controller.safety import Safety
from ir_sim_driver.motion import Executor, ToolPoint, TrajectoryGoal
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend, Carried
from ir_values.arrays import BoolArray, FloatArray

# Period of the looks: as often as speed and clearance ask for.
#
# After a look that found the clearance d the next one is due before any surface can have moved by
# d: with v the speed bound of all surfaces now and A that of their acceleration, v T + A T^2 / 2
# = d. A is what motors and gravity can do at most, whoever supervises them. Near things that is
# every step.
#
# A pair that touches when the scene changes, or when the robot recovers, may go on touching, but
# no deeper: whoever is in contact may only leave it.

LONGEST = 100  # steps between two looks, however far everything is
_FAR = 10.0  # m: as far as nothing gets within LONGEST
# N/m of the arm at its tool: 1 N per micrometre, what robots of this size are measured at
STIFFNESS = 1e6
_RELEASE = 5e-4  # m that a pair in contact may go deeper: opening brakes let the arm settle
HARDEST = 6.0
"""Times the acceleration limits: the torque envelope and gravity give a surface 4.1 times (the
largest over random states, loads and plants), in every mode: driven, falling, braking.
"""
_FRESH = 0.5  # share of the clearance that a bound may use up before distances are computed again


@dataclass(eq=False)
class Touch:
    """A contact from its first touch on; pair z of its scene, step: of the first touch."""

    scene: ContactScene
    z: int
    step: int
    speed: float
    impact: float  # N that the robot's moving mass gives at this speed
    depth: float = 0.0
    stood: int | None = None

    def follow(self, backend: Backend) -> None:
        """Look at the pair after a step, until the robot stands."""
        near = self.scene.model.witnesses(backend.q[None], [self.z])
        self.depth = max(self.depth, -float(near.distance[0]))

    def contact(self, q: FloatArray, dt: float, trajectory_id: str, path_time: float) -> Contact:
        """What is reported, with the closest points at q (n,)."""
        kind, body_a, body_b = self.scene.model.pairs[self.z]
        near = self.scene.model.witnesses(q[None], [self.z])
        pair = DistancePair(
            kind.lower(), body_a, body_b, float(near.distance[0]), near.point_a[0], near.point_b[0]
        )
        return Contact(
            pair=pair,
            depth=self.depth,
            speed=self.speed,
            force=min(STIFFNESS * self.depth, self.impact),
            stopped_after=((self.stood or self.step) - self.step) * dt,
            trajectory_id=trajectory_id,
            path_time=path_time,
        )


class _Group:
    """Pairs (Z,) that joints with these reaches (n,) [m] move; due: step of their next look."""

    def __init__(self, pairs: BoolArray, reach: FloatArray, hardest: FloatArray, dt: float) -> None:
        self._pairs = pairs
        self._reach = reach
        self._dt = dt
        self._acceleration = float(reach @ hardest)

    def start(self, thresholds: FloatArray) -> None:
        """Keep these distances (Z,) from now on."""
        self._offset: FloatArray = np.where(self._pairs, thresholds, -np.inf)
        self._clearance = 0.0
        self._from = self._reach
        self.due = 0

    def look(self, model: CollisionModel, step: int, q: FloatArray, qd: FloatArray) -> int:
        """The pair that is too near, -1: none, and not before `due`."""
        left = 0.0
        if self._clearance > 0.0:
            left = self._clearance - float(self._reach.dot(np.abs(q - self._from)))
        if left <= _FRESH * self._clearance:
            distance, z = model.nearest(q, self._offset)
            left = math.inf if z < 0 else distance - float(self._offset[z])
            if left <= 0.0:
                return z
            self._clearance = min(left, _FAR)
            self._from = q
        self.due = step + self._steps(min(left, _FAR), float(self._reach.dot(np.abs(qd))))
        return -1

    def _steps(self, left: float, speed: float) -> int:
        """Steps in which no surface moves by `left` [m]."""
        a = self._acceleration
        if a == 0.0:
            return LONGEST
        seconds = (math.sqrt(speed * speed + 2.0 * a * left) - speed) / a
        return max(1, min(LONGEST, int(seconds / self._dt)))


class ContactWatch:
    """Watches a robot with these acceleration limits (n,), stepped by dt [s]. due: step of the next
    look.
    """

    def __init__(self, acceleration_max: FloatArray, dt: float) -> None:
        self._hardest: FloatArray = HARDEST * np.asarray(acceleration_max)
        self._dt = dt
        self.due = 0
        self._scene: ContactScene | None = None
        self._in_contact = False
        self.thresholds: FloatArray = np.empty(0)

    def watch(
        self, scene: ContactScene, q: FloatArray, station: str, standing: bool
    ) -> tuple[str, ...]:
        """Watch this scene from q (n,) on, with what the station allows; the pairs that touch
        already.

        standing: what touches now may be left; otherwise only what could be left before.
        """
        left = self._in_contact_names()
        self._scene = scene
        self._station = station
        self._groups = tuple(
            _Group(pairs, reach, self._hardest, self._dt)
            for pairs, reach in scene.groups
            if pairs.any()
        )
        self._allowed: BoolArray = scene.allowed(station)
        self._any = bool(self._allowed.any())
        self._inside = self._any
        plain = self._plain()
        pairs = scene.model.pairs
        self.thresholds = self._relaxed(q, plain)
        if not standing:
            known = np.array([(a, b) in left for _, a, b in pairs], dtype=bool)
            self.thresholds = np.where(known, self.thresholds, plain)
        held = np.flatnonzero(self.thresholds < plain)
        self._in_contact = len(held) > 0
        self._start()
        return tuple(f"{pairs[z].body_a} and {pairs[z].body_b}" for z in held)

    def _start(self) -> None:
        """Look at everything in the next step."""
        for group in self._groups:
            group.start(self.thresholds)
        self.due = 0

    def _in_contact_names(self) -> set[tuple[str, str]]:
        """Names of the pairs that are in contact and may be left."""
        if self._scene is None or not self._in_contact:
            return set()
        pairs = self._scene.model.pairs
        return {pairs[z][1:] for z in np.flatnonzero(self.thresholds < self._plain())}

    def allow(self, station: str) -> None:
        """What this station allows from now on; pairs in contact may still leave it."""
        assert self._scene is not None
        if station == self._station:
            return
        before = self.thresholds
        plain = self._plain()
        self._station = station
        self._allowed = self._scene.allowed(station)
        self._any = bool(self._allowed.any())
        self._inside = self._any
        self.thresholds = np.where(before < plain, np.minimum(before, self._plain()), self._plain())
        self._start()

    def asked(self, scene: ContactScene, station: str) -> Keep:
        """What a trajectory of this station must keep in this scene as it is watched now."""
        outside = scene.touching
        allowed = scene.allowed(station)
        if scene is self._scene and len(outside):
            held = self.thresholds < self._plain()
            outside = np.where(held, np.minimum(outside, self.thresholds), outside)
        if not allowed.any():
            return Keep(scene, outside)
        return Keep(
            scene, outside, station, np.where(allowed, np.minimum(outside, -ALLOWED_DEPTH), outside)
        )

    def look(self, step: int, backend: Backend, dynamics: DynamicsModel) -> Touch | None:
        """Look at what is due; a touch that is not allowed."""
        scene = self._scene
        q = backend.q
        qd = backend.qd
        assert scene is not None
        if self._any or self._in_contact:
            self._follow(q)
        for group in self._groups:
            if step >= group.due:
                z = group.look(scene.model, step, q, qd)
                if z >= 0:
                    return self._touched(scene, z, step, backend, dynamics)
        self.due = min((group.due for group in self._groups), default=step + LONGEST)
        return None

    def _touched(
        self, scene: ContactScene, z: int, step: int, backend: Backend, dynamics: DynamicsModel
    ) -> Touch:
        """The first touch: speed along the normal, with a door's own, and the robot's mass behind
        it.
        """
        q = backend.q[None]
        pair = np.array([z])
        gradient = scene.model.gradients(q, pair)[0]
        own = scene.speeds.get(scene.model.pairs[z].body_b, 0.0)
        speed = max(0.0, own - float(gradient @ backend.qd))
        weight = float(gradient @ np.linalg.solve(dynamics.mass_matrix(q)[0], gradient))
        impact = speed * math.sqrt(STIFFNESS / weight) if weight > 0.0 else math.inf
        self.due = step + 1
        return Touch(
            scene, z, step, speed, impact, -float(scene.model.witnesses(q, pair).distance[0])
        )

    def _follow(self, q: FloatArray) -> None:
        """Take back what is allowed where the tool has left the zone, or a pair its contact."""
        assert self._scene is not None
        if self._any:
            inside = self._scene.inside(q, self._station)
            if inside != self._inside:
                before = self.thresholds
                plain = self._plain()
                self._inside = inside
                self.thresholds = np.where(
                    before < plain, np.minimum(before, self._plain()), self._plain()
                )
                self._start()
        if self._in_contact:
            plain = self._plain()
            self.thresholds = np.maximum(
                self.thresholds, np.minimum(plain, self._relaxed(q, plain))
            )
            self._in_contact = bool((self.thresholds < plain).any())
            self._start()

    def _plain(self) -> FloatArray:
        """Distances (Z,) that count as touching here."""
        assert self._scene is not None
        if not (self._any and self._inside):
            return self._scene.touching
        return np.where(self._allowed, -ALLOWED_DEPTH, self._scene.touching)

    def _relaxed(self, q: FloatArray, plain: FloatArray) -> FloatArray:
        """The same, but for the pairs that touch at q (n,): as deep as they are, and _RELEASE."""
        assert self._scene is not None
        distance = self._scene.model.distances(q[None])[0]
        return np.where(distance <= plain, distance - _RELEASE, plain)


# The cell around the robot as it is now.

# s of the clock that a movement waits for a door that will be open within SOON
_PATIENCE = 2.0 * SOON


class CellWatch:
    """Watches `backend` in `cell`; due: step of the next look; now: plant time [s], in steps of dt.

    Everybody but `wait_for` holds the lock of who steps the simulation.
    """

    def __init__(
        self,
        cell: Cell,
        load: Carried,
        tool: ToolPoint,
        backend: Backend,
        notices: Notices,
        dt: float,
        now: Callable[[], float],
    ) -> None:
        self._tool = tool
        self._backend = backend
        self._notices = notices
        self._dt = dt
        self._now = now
        self._machines = MachinesInScene(cell)
        self._parts = Parts(cell, load)
        self._contacts = ContactWatch(cell.robot.acceleration_max, dt)
        self._cell = cell
        self._load = load
        self._station = ""
        self._touch: Touch | None = None
        self._where = ("", 0.0)  # id of the trajectory and time along it, at the first touch
        self._done: list[Contact] = []
        self._last: Contact | None = None
        self._changed = threading.Condition()
        self._versions = 0
        self.due = 0
        self._arrange()

    @property
    def unsettled(self) -> bool:
        """Whether the robot has touched something and does not stand yet."""
        return self._touch is not None and self._touch.stood is None

    @property
    def last(self) -> Contact | None:
        """The last contact; None before the first."""
        return self._last

    @property
    def scene(self) -> ContactScene:
        """What can be touched now; another object when anything has changed."""
        return self._scene

    @property
    def lying(self) -> tuple[Body, ...]:
        """Bodies of the parts that lie there."""
        return self._parts.bodies()

    @property
    def version(self) -> int:
        """Grows with every change of a machine's state and every contact."""
        return self._versions

    # -- what changes -----------------------------------------------------------------------------

    def stand_in(self, cell: Cell, load: Carried) -> None:
        """The robot stands in another cell from now on, with this load."""
        self._cell = cell
        self._load = load
        self._station = ""
        self._machines.stand_in(cell)
        self._parts.stand_in(cell, load)
        self._changed_state()
        self._arrange()

    def carry(self, load: Carried) -> None:
        """The robot carries this load from now on; parts that it let go lie where they are."""
        tcp = self._tool.chain.tcp_poses(self._backend.q[None])[0]
        self._load = load
        self._parts.carry(load, tcp)
        self._arrange()

    def hear(self, signal: str, level: bool) -> None:
        """Take the level of a signal of the machines."""
        if self._machines.hear(signal, level, self._now()):
            self._changed_state()
            self._arrange(standing=False)

    def begin(self, station: str) -> None:
        """A movement of this station starts: its contacts are allowed, and no others."""
        self._station = station
        self._contacts.allow(station)
        self.due = 0

    def recovered(self) -> None:
        """Somebody has recovered: what touches may be left, but go no deeper."""
        if self._touch is not None and self.unsettled:
            self._settle(self._touch, self._touch.step)
        self._touch = None
        self._arrange()

    # -- what is asked ----------------------------------------------------------------------------

    def states(self) -> tuple[MachineState, ...]:
        """What every machine is in, and changes to."""
        return self._machines.states(self._now())

    def refusal(self, goal: TrajectoryGoal, checked: ContactScene) -> str:
        """Why a movement that was checked in this scene can't start with the machines as they are,
        "" when it can.
        """
        refusal = self._machines.refusal(goal.states, self._now())
        if not refusal and checked is not self._scene:
            refusal = (
                "a machine or a part has moved while the trajectory was checked: send it again"
            )
        return refusal

    def wait_for(self, states: Sequence[str]) -> None:
        """Give machines that will be in these states in a moment that moment; not by who steps."""
        with self._changed:
            self._changed.wait_for(lambda: not self._machines.soon(states, self._now()), _PATIENCE)

    def asked(self, station: str) -> Keep:
        """What a trajectory of this station must keep clear of now."""
        return self._contacts.asked(self._scene, station)

    # -- stepped ----------------------------------------------------------------------------------

    def look(self, step: int, executor: Executor, dynamics: DynamicsModel, safety: Safety) -> None:
        """Look after this step, which is due; a robot that touches what it may not is stopped by
        `safety`.
        """
        if self._machines.next_change <= self._now() and self._machines.step(self._now()):
            self._changed_state()
            self._arrange(standing=False)
        touch = self._touch
        if touch is None:
            sentence = self._watched(step, executor, dynamics)
            if sentence:
                safety.touched(sentence)
            return
        if touch.stood is None:
            touch.follow(self._backend)
            if self._backend.standing:
                self._settle(touch, step)
        self.due = self._until_change(step, step + (1 if self.unsettled else LONGEST))

    def _settle(self, touch: Touch, step: int) -> None:
        touch.stood = step
        self._last = touch.contact(self._backend.q, self._dt, *self._where)
        self._done.append(self._last)
        self._versions += 1

    def _watched(self, step: int, executor: Executor, dynamics: DynamicsModel) -> str:
        """What the robot touches, "" when it touches nothing."""
        touch = self._contacts.look(step, self._backend, dynamics)
        if touch is None:
            self.due = self._until_change(step, self._contacts.due)
            return ""
        self._touch = touch
        self._where = (executor.label, executor.path_time)
        self.due = step + 1
        _, body_a, body_b = touch.scene.model.pairs[touch.z]
        at = f" at {executor.path_time:.3f} s of {executor.label}" if executor.active else ""
        return f"{body_a} touches {body_b}{at} with {touch.speed:.2f} m/s"

    def take_contacts(self) -> tuple[Contact, ...]:
        """Contacts since the last call, each when the robot stands again."""
        done = tuple(self._done)
        self._done = []
        return done

    def _until_change(self, step: int, due: int) -> int:
        """The earlier of a step and the next change of a machine."""
        change = self._machines.next_change
        if change == float("inf"):
            return due
        return min(due, step + max(1, math.ceil((change - self._now()) / self._dt)))

    def _changed_state(self) -> None:
        with self._changed:
            self._versions += 1
            self._changed.notify_all()

    def _arrange(self, standing: bool = True) -> None:
        """Build the scene anew. standing: what touches now was there before, or was put there by
        hand.
        """
        scene = ContactScene.of(
            self._cell, self._tool.chain, self._load, self._machines, self._parts
        )
        self._scene = scene
        touching = self._contacts.watch(scene, self._backend.q, self._station, standing)
        self.due = 0
        if touching:
            self._notices.add(
                Level.WARN,
                f"the robot stands in contact, and may only leave it: {', '.join(touching)}",
            )
