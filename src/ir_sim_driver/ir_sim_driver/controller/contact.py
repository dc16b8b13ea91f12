"""Does the robot touch what it may not? Looked at as often as its speed and the clearance ask for.

After a look that found the clearance d the next one is due before any surface can have moved by d:
with v the speed bound of all surfaces now and A that of their acceleration, v T + A T^2 / 2 = d. A
is what motors and gravity can do at most, whoever supervises them. Near things that is every step.

A pair that touches when the scene changes, or when the robot recovers, may go on touching, but no
deeper: whoever is in contact may only leave it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_kernels.collision import CollisionModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.contact import Contact
from ir_msgs_py.report import DistancePair
from ir_sim_driver.controller.contact_scene import ALLOWED_DEPTH, ContactScene
from ir_sim_driver.controller.keep import Keep
from ir_sim_driver.plant import Backend

LONGEST = 100  # steps between two looks, however far everything is
_FAR = 10.0  # m: as far as nothing gets within LONGEST
STIFFNESS = (
    1e6  # N/m of the arm at its tool: 1 N per micrometre, what robots of this size are measured at
)
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
        self._inside = self._any = bool(self._allowed.any())
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
        self._inside = self._any = bool(self._allowed.any())
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
        self.due = min(group.due for group in self._groups)
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
