"""The driver: a simulation that one thread steps and other threads ask. No ROS.

Everything that touches the simulation holds one lock for a short time; trajectories are checked
beside it in a thread of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, robot_urdf
from ir_description.robot import FramePose, fixed_frames, moving_frames
from ir_description.shapes import Capsule
from ir_kernels.chain import Chain
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.announcements import ControllerTimers
from ir_msgs_py.modes import Mode, PowerMode
from ir_msgs_py.names import END_REST, TAKE_BACK
from ir_msgs_py.plc import OperatingMode, PlcInputs
from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.access import Access, CellSide, PlcSide
from ir_sim_driver.controller.cell_scene import ContactScene, MachinesInScene, Parts
from ir_sim_driver.controller.contacts import ContactWatch
from ir_sim_driver.controller.goals import NO_GOAL, Goals, refused
from ir_sim_driver.controller.outputs import Frame, FrameMaker, Joints, PartStatus, report
from ir_sim_driver.controller.simulation import Simulation, stale
from ir_sim_driver.controller.surroundings import PlannedCell
from ir_sim_driver.errors import BackendError, RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.motion import (
    ExecutionSettings,
    Following,
    GoalOutcome,
    PathMotion,
    TrajectoryGoal,
)
from ir_sim_driver.notices import Level, Notice
from ir_sim_driver.plant import Carried, Plant
from ir_sim_driver.plc import OWN_BITS, STOP_BIT, giver_of
from ir_values.arrays import FloatArray
from ir_values.errors import IrError

_TAKEN_BACK = {TAKE_BACK + bit: bit for bit in OWN_BITS}


def try_cell(simulation: Simulation, cell: Cell) -> str:
    """Why the robot can't stand in a cell, "" where it can. It may run beside `step`.

    All that depends on the cell is made once, and thrown away.
    """
    robot = simulation.robot
    try:
        load, _ = simulation.surroundings.load_in(cell, simulation.load)
        chain = Chain(robot, cell.base_pose, cell.tcp)
        dynamics = DynamicsModel(robot, load.loads, cell.base_pose)
        scene = ContactScene.of(cell, chain, load, MachinesInScene(cell), Parts(cell, load))
        watch = ContactWatch(robot.acceleration_max, simulation.settings.dt)
        watch.watch(scene, simulation.backend.q, "", True)
        watch.look(0, simulation.backend, dynamics)
        np.abs(simulation.backend.q - cell.machine_home).max()
        robot_urdf(cell.robot, load.loads, cell.tcp, cell.base_pose)
        fixed_frames(cell.robot, load.loads, cell.tcp, cell.base_pose)
    except Exception as error:  # whatever it is: an offered cell must not end the driver
        return f"the robot can't stand in it: {error!r}"
    return ""


def take_offered_cell(simulation: Simulation) -> None:
    """Take the cell that is offered, if any and if the robot stands: tcp, postures, and the load as
    the cell describes it. Where that fails, the robot stands in the old one.
    """
    surroundings = simulation.surroundings
    if surroundings.offered is None or not simulation.stands:
        return
    planned = surroundings.take()
    if planned is None:
        return
    old = simulation.cell
    carried_before = simulation.load
    try:
        _stand_in(simulation, planned.cell)
    except Exception as error:  # whatever it is: it was tried, but the robot has moved since
        _back_to(simulation, old, carried_before)
        simulation.notices.add(
            Level.ERROR,
            f"cell {planned.cell.name!r} is not taken, the old one stays: {error!r}",
        )
        return
    surroundings.settle(planned)
    hashed = f"hash {surroundings.hash}"
    simulation.notices.add(
        Level.OK, f"the robot stands in cell {planned.cell.name!r} now, {hashed}"
    )


def _stand_in(simulation: Simulation, cell: Cell) -> None:
    """Make everything that depends on the cell anew."""
    notices = simulation.notices
    simulation.cell = cell
    simulation.tool.stand_at(cell.base_pose, cell.tcp)
    load, warning = simulation.surroundings.load_in(cell, simulation.load)
    if warning:
        notices.add(Level.WARN, warning)
    try:
        simulation.set_load(load, cell)
    except (BackendError, RequestRefusedError) as error:
        notices.add(
            Level.ERROR, f"load {load.text!r} of cell {cell.name!r} can't be carried: {error}"
        )


def _back_to(simulation: Simulation, cell: Cell, load: Carried) -> None:
    """Stand in the old cell again, with what was carried there."""
    simulation.cell = cell
    simulation.tool.stand_at(cell.base_pose, cell.tcp)
    simulation.cell_watch.stand_in(cell, load)
    if simulation.load is not load:
        simulation.set_load(load)


@dataclass(frozen=True)
class Snapshot:
    """What a person is shown: notices since the last snapshot, and the parts of the driver."""

    notices: list[Notice]
    entries: list[PartStatus]


class Driver:
    """Runs `simulation`, `steps` of its steps per tick.

    plc: what links and the PLC's topic talk to. wake_hint: what wakes the controller, for
    sentences.
    """

    def __init__(
        self, simulation: Simulation, steps: int = 2, wake_hint: str = "a Wake-on-LAN packet"
    ) -> None:
        self._simulation = simulation
        self._steps = steps
        self._access = Access(simulation, wake_hint)
        self._lock = self._access.lock
        self._stamp = 0
        self._goals = Goals(simulation, self._lock, lambda: self._stamp)
        self._frames = FrameMaker(simulation, steps)
        self.plc = PlcSide(self._access)
        self.cell_side = CellSide(self._access)
        self.joint_names = tuple(simulation.robot.joint_names)

    def close(self) -> None:
        """Stop checking trajectories."""
        self._goals.close()

    def tick(self, stamp_ns: int, moved: Callable[[Joints], None] = lambda joints: None) -> Frame:
        """Let the steps of a tick pass, which ends at the stamp [ns].

        moved: gets the joints before the rest of the frame is made; it must be quick, everybody
        waits for it.
        """
        with self._lock:
            self._stamp = stamp_ns
            try:
                take_offered_cell(self._simulation)
                for _ in range(self._steps):
                    self._simulation.step()
                joints = self._frames.joints(stamp_ns)
                moved(joints)
                calls = self._goals.take_calls(self._simulation.take_outcomes())
                frame = self._frames.take(joints)
            except Exception as error:
                self._access.failure = f"the plant has stopped: {error!r}"
                self._simulation.notices.add(Level.ERROR, self._access.failure)
                raise
        for ended, outcome in calls:
            ended(outcome)
        return frame

    def fail(self, sentence: str) -> None:
        """Nobody ticks any more: refuse all requests with this sentence, and end all goals."""
        with self._lock:
            self._access.failure = self._access.failure or sentence
            calls = self._goals.drop(self._access.failure)
        for ended, outcome in calls:
            ended(outcome)

    # -- movements --------------------------------------------------------------------------------

    def admit(self, points: int, size: int = 0, sent: int = 0) -> int:
        """Ticket for a goal of so many points and bytes, before it is converted. Raises
        TrajectoryRefusedError.
        """
        return self._goals.admit(points, size, sent)

    def submit(
        self,
        points: int,
        read: Callable[[], TrajectoryGoal],
        ended: Callable[[GoalOutcome], None],
        ticket: int = 0,
    ) -> int:
        """Check a goal beside everything else and start it; returns its ticket.

        ticket: of `admit`, 0 where it has not been admitted yet. See `Goals.submit`.
        """
        try:
            ticket = ticket or self.admit(points)
        except TrajectoryRefusedError as error:
            ended(refused(str(error), error.code))
            return NO_GOAL

        def here() -> TrajectoryGoal:
            goal = read()
            self._simulation.surroundings.wait_for(goal.cell_hash)
            self._simulation.cell_watch.wait_for(goal.states)
            return goal

        self._goals.submit(ticket, here, ended)
        return ticket

    def cancel(self, ticket: int) -> None:
        """Stop a goal along its path, also one that is still being checked."""
        with self._lock:
            self._goals.cancel(ticket)

    def abandon(self, ticket: int, sentence: str) -> None:
        """Stop a goal along its path, or don't start it, because its sender has gone."""
        with self._lock:
            ended = self._goals.forget(ticket)
            if self._goals.runs(ticket):
                self._simulation.notices.add(Level.WARN, sentence)
                self._simulation.abort(sentence)
        if ended is not None:
            ended(refused(f"{sentence}; it has not been started"))

    def abort(self, sentence: str) -> None:
        """Stop whatever runs along its path, with this warning."""
        with self._lock:
            self._simulation.notices.add(Level.WARN, sentence)
            self._simulation.abort(sentence)

    def following(self, ticket: int) -> Following | None:
        """How the robot follows this goal; None when it is not executed now."""
        with self._lock:
            if not self._goals.runs(ticket):
                return None
            backend = self._simulation.backend
            return self._simulation.executor.following(backend.q, backend.qd)

    def commanded_at(self, stamp_ns: int) -> PathMotion:
        """Commanded motion at a time of the plant [ns]. Raises RequestRefusedError: before the
        movement, off the network.
        """
        with self._access.online() as simulation:
            seconds = (stamp_ns - self._stamp) * 1e-9
            motion = simulation.executor.motion_in(seconds)
            if motion is None:
                raise RequestRefusedError(
                    StatusCode.INVALID_ROBOT_STATE,
                    f"the time is {-seconds:.3f} s ago: no movement that runs now had begun",
                )
            return motion

    def set_speed_scaling(self, factor: float) -> None:
        """Scale the speed of every movement by a factor in [0, 1]."""
        with self._lock:
            self._simulation.set_speed_scaling(factor)

    def set_execution(self, settings: ExecutionSettings) -> None:
        """Use other bounds of trajectories from the next goal on."""
        with self._lock:
            self._simulation.set_execution(settings)

    def forbid_hibernation(self, reason: str) -> None:
        """Ignore HIB from now on and leave hibernation out of pauses, with this reason."""
        with self._lock:
            self._simulation.plc.no_hibernation = reason

    @property
    def stop_number(self) -> int:
        """Number of the last stop (`ir_msgs_py.stop_numbers`)."""
        return self._simulation.stop_number

    @property
    def recovery(self) -> tuple[int, int]:
        """Number of the last stop that was recovered and when [ns of the system's clock]; at 0
        none came yet.
        """
        return self._goals.recovery

    @property
    def inputs_in_force(self) -> PlcInputs | None:
        """The levels that count, whoever set them; None while the controller is off the network."""
        simulation = self._simulation
        return simulation.plc.in_force if simulation.on_the_network else None

    @property
    def stamp_ns(self) -> int:
        """Stamp [ns] of the present tick."""
        return self._stamp

    @property
    def failure(self) -> str:
        """Why the simulation is not stepped any more, "" while it is."""
        return self._access.failure

    @property
    def max_points(self) -> int:
        """Longest trajectory, in points."""
        return self._simulation.settings.execution.max_points

    @property
    def moving(self) -> bool:
        """Whether a movement waits or runs."""
        with self._lock:
            return self._simulation.executor.active

    @property
    def stopped(self) -> bool:
        """Whether a stop is latched."""
        return self._simulation.stopped

    # -- requests; each raises RequestRefusedError, also while the controller is off the network --

    def press(
        self,
        writer: str,
        name: str,
        level: bool,
        came_ns: int = 0,
        client: str = "",
        after_stop: int = 0,
    ) -> tuple[PlcInputs, str]:
        """Set one bit, or the mode switch by the name of its position, or take one's own bit back.

        Returns the levels and a remark: why the bit will not count. A pressed emergency stop is
        latched in every mode, asleep too, and has been acted upon when this returns. came_ns: as of
        `recover`; only a press, and what takes one's own bit back, may come before the last stop.
        client: who it is among a writer's.
        after_stop: the last stop that it knows, 0 where it doesn't say; another one refuses all but
        a press.
        """
        pressed = name == STOP_BIT and level
        with self._access.online(asleep_too=pressed) as simulation:
            plc = simulation.plc
            if not pressed:
                if name not in _TAKEN_BACK:  # which moves nothing, and nobody asks for again
                    plc.stop.refuse_earlier(came_ns, name)
                if after_stop not in (0, simulation.stop_number):
                    refusal = stale(after_stop, simulation.stop_number)
                    raise RequestRefusedError(StatusCode.INVALID_ROBOT_STATE, refusal)
            if name == END_REST or name in _TAKEN_BACK:
                if not level:
                    return plc.raw, ""
                plc.check_owner(writer)
                giver = giver_of(writer, client)
                if name == END_REST:
                    simulation.control.end_rest(giver)
                    return plc.raw, ""
                bit = _TAKEN_BACK[name]
                simulation.control.take_back(bit, giver)
                return plc.raw, plc.remark(bit, simulation.pauses.rest is not None)
            try:
                plc.raw.with_bit(name, level)
            except IrError as error:
                raise RequestRefusedError(StatusCode.INVALID_OBJECT_NAME, str(error)) from error
            if name in OperatingMode.__members__:
                plc.turn_switch(writer, OperatingMode[name])
            else:
                plc.write(writer, {name: level}, client)
                simulation.heed_stop()
            return plc.raw, plc.remark(name, simulation.pauses.rest is not None)

    def start_pause(self, seconds: float) -> PowerMode:
        """Start a PROFIenergy pause; the mode that was chosen."""
        with self._access.online() as simulation:
            return simulation.pauses.start(seconds, simulation.executor.active)

    def end_pause(self) -> float:
        """End the pause; seconds until motors are on."""
        with self._access.online() as simulation:
            return simulation.control.end_pause()

    def query_modes(self) -> tuple[tuple[PowerMode, ...], Mode]:
        """All modes with the present load and posture, and the present mode."""
        with self._access.online() as simulation:
            return simulation.pauses.query_modes(), simulation.modes.mode

    def recover(self, came_ns: int = 0) -> str:
        """Leave the emergency stop; a remark.

        came_ns: when the request came [ns of the host's monotonic clock], 0: now. One that came
        before the last stop, and waited, is refused.
        """
        with self._access.online() as simulation:
            simulation.plc.stop.refuse_earlier(came_ns, "recover")
            remark = simulation.recover()
            self._goals.heed_stop()
            return remark

    def set_load(self, load: Callable[[Cell], Carried]) -> Carried:
        """Carry what `load` makes of the cell, from now on."""
        with self._access.online() as simulation:
            carried = load(simulation.cell)
            simulation.set_load(carried)
            return carried

    def offer_cell(self, planned: PlannedCell) -> None:
        """Stand in this cell as soon as the robot stands; a cell that can't be its own becomes a
        warning.
        """
        failing = try_cell(self._simulation, planned.cell)  # beside the plant: it may take 0.2 s
        with self._lock:
            reason = self._simulation.surroundings.refusal_of(planned.cell) or failing
            if not reason:
                self._simulation.surroundings.offered = planned
            else:
                self._simulation.notices.add(
                    Level.WARN, f"cell {planned.cell.name!r} of the planner is not taken: {reason}"
                )

    # -- what people see --------------------------------------------------------------------------

    def warn(self, sentence: str) -> None:
        """Add a warning to the notices."""
        with self._lock:
            self._simulation.notices.add(Level.WARN, sentence)

    def snapshot(self, worst_lag: float, lag: float = 0.0) -> Snapshot:
        """Notices since the last snapshot, and the state; delays [s] of whoever ticks: worst and
        now.
        """
        with self._lock:
            return Snapshot(
                self._simulation.notices.take(),
                report(self._simulation, worst_lag, self._access.failure, lag),
            )

    @property
    def plant(self) -> Plant:
        """What is driven; it never changes."""
        return self._simulation.plant

    @property
    def carried(self) -> Carried:
        """What the robot carries now."""
        with self._lock:
            return self._simulation.load

    @property
    def timers(self) -> ControllerTimers:
        """What the controller does by itself; they never change."""
        settings = self._simulation.settings
        return ControllerTimers(settings.idle.motors_to_brakes_in_program, settings.transitions)

    def description(self) -> str:
        """URDF of the robot with what it carries."""
        with self._lock:
            cell = self._simulation.cell
            load = self._simulation.load
        return robot_urdf(cell.robot, load.loads, cell.tcp, cell.base_pose)

    def fixed_frames(self) -> tuple[FramePose, ...]:
        """Frames that no joint moves, with those of what is carried."""
        with self._lock:
            cell = self._simulation.cell
            load = self._simulation.load
        return fixed_frames(cell.robot, load.loads, cell.tcp, cell.base_pose)

    def moving_frames(self, q: FloatArray) -> tuple[FramePose, ...]:
        """Frames of the joints at q (n,) [rad]."""
        return moving_frames(self._simulation.robot, self.link_poses(q))

    def link_poses(self, q: FloatArray) -> FloatArray:
        """Poses (n+1, 4, 4) of the links in the world at q (n,) [rad]."""
        poses: FloatArray = self._simulation.tool.chain.link_poses(q[None])[0]
        return poses

    def capsules(self) -> tuple[tuple[Capsule, ...], tuple[Capsule, ...]]:
        """Capsules of the robot and of its load, on their links."""
        loads = self.carried.loads
        of_load = tuple(capsule for item in loads for capsule in item.capsules)
        return tuple(self._simulation.robot.capsules), of_load
