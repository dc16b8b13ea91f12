"""The cell around the robot as it is now: states of machines, parts that lie, and what the robot
touches.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence

from ir_description import Body, Cell
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.contact import Contact, MachineState
from ir_sim_driver.controller.contact import LONGEST, ContactWatch, Touch
from ir_sim_driver.controller.contact_scene import ContactScene
from ir_sim_driver.controller.keep import Keep
from ir_sim_driver.controller.machines import SOON, Machines
from ir_sim_driver.controller.parts import Parts
from ir_sim_driver.controller.safety import Safety
from ir_sim_driver.motion import Executor, ToolPoint, TrajectoryGoal
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend, Carried

_PATIENCE = (
    2.0 * SOON
)  # s of the clock that a movement waits for a door that will be open within SOON


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
        self._machines = Machines(cell)
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

    # -- what changes
    # ---------------------------------------------------------------------------------------

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

    # -- what is asked
    # --------------------------------------------------------------------------------------

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

    # -- stepped
    # --------------------------------------------------------------------------------------------

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
        self._scene = scene = ContactScene.of(
            self._cell, self._tool.chain, self._load, self._machines, self._parts
        )
        touching = self._contacts.watch(scene, self._backend.q, self._station, standing)
        self.due = 0
        if touching:
            self._notices.add(
                Level.WARN,
                f"the robot stands in contact, and may only leave it: {', '.join(touching)}",
            )
