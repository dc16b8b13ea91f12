"""The simulation as a running thing: stepped by one thread, asked by others, read frame by frame. No ROS.

Everything that touches the simulation holds one lock for a short time; trajectories are checked beside it in
a thread of their own, so that a long one does not keep anybody waiting.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.plc import PlcInputs, PlcOutputs
from ir_msgs_py.power import PowerState
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.executor import Following
from ir_sim_driver.motion.goal import ErrorCode, Outcome, TrajectoryGoal

POWER_PERIOD = 10  # steps: 100 Hz
CONTROLLER_PERIOD = 20  # steps: 50 Hz
QUEUE_MAX = 32
NO_GOAL = 0


@dataclass(frozen=True, eq=False)
class Frame:
    """What is published at a stamp [ns]; None: nothing of it now.

    q, qd, torque (n,) are None while the controller is off the network. inputs: the levels that count, when
    they have changed, whoever set them.
    """

    stamp_ns: int
    q: FloatArray | None
    qd: FloatArray | None
    torque: FloatArray | None
    power: PowerState | None
    following: Following | None
    outputs: PlcOutputs | None
    inputs: PlcInputs | None = None


class Driver:
    """Runs `simulation`, `steps` of its steps per tick."""

    def __init__(self, simulation: Simulation, steps: int = 2) -> None:
        self._simulation, self._steps = simulation, steps
        self._lock = threading.Lock()
        self._checker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="trajectory_checks")
        self._waiting: dict[int, Callable[[Outcome], None]] = {}
        self._queued = 0
        self._stamp = 0
        self._energy = 0.0
        self._burnt = 0.0
        self._metered = 0.0
        self._outputs: PlcOutputs | None = None
        self._inputs: PlcInputs | None = None

    def close(self) -> None:
        """Stop checking trajectories."""
        self._checker.shutdown(wait=True, cancel_futures=True)

    def locked(self) -> AbstractContextManager[Simulation]:
        """The simulation, for a short while: `with driver.locked() as simulation`."""
        return _Locked(self._lock, self._simulation)

    def submit(
        self,
        read: Callable[[], TrajectoryGoal],
        started: Callable[[int], None],
        ended: Callable[[Outcome], None],
    ) -> None:
        """Check a goal beside everything else and start it.

        read: makes the goal, may raise TrajectoryRefusedError. started: told the goal's id. ended: told the
        outcome, whether it was refused (id NO_GOAL) or executed. Both are called from other threads.
        """
        with self._lock:
            full = self._queued >= QUEUE_MAX
            self._queued += not full
        if full:
            ended(_refused(f"{QUEUE_MAX} trajectories are waiting to be checked: send fewer"))
            return
        self._checker.submit(self._check_and_start, read, started, ended)

    def tick(self, stamp_ns: int) -> Frame:
        """Let the steps of a tick pass, which ends at the stamp [ns]."""
        with self._lock:
            self._stamp = stamp_ns
            for _ in range(self._steps):
                self._simulation.step()
            outcomes = self._simulation.take_outcomes()
            calls = [
                (self._waiting.pop(outcome.goal_id), outcome)
                for outcome in outcomes
                if outcome.goal_id in self._waiting
            ]
            frame = self._frame(stamp_ns)
        for call, outcome in calls:
            call(outcome)
        return frame

    def _check_and_start(
        self,
        read: Callable[[], TrajectoryGoal],
        started: Callable[[int], None],
        ended: Callable[[Outcome], None],
    ) -> None:
        try:
            vetted = self._simulation.vet(read(), self._stamp)
            with self._lock:
                goal_id = self._simulation.execute(vetted, self._stamp)
                self._waiting[goal_id] = ended
                started(goal_id)
        except TrajectoryRefusedError as error:
            ended(_refused(str(error), error.code))
        except Exception as error:  # a bug must not leave the sender waiting, nor end the checking
            ended(_refused(f"the check of the trajectory failed: {error!r}"))
        finally:
            with self._lock:
                self._queued -= 1

    def _frame(self, stamp_ns: int) -> Frame:
        simulation = self._simulation
        online = simulation.on_the_network
        backend = simulation.backend
        outputs = following = power = None
        if simulation.steps % POWER_PERIOD < self._steps:
            power = self._power(stamp_ns)
            present = simulation.outputs()
            if present != self._outputs:
                self._outputs = outputs = present
        if online and simulation.steps % CONTROLLER_PERIOD < self._steps:
            following = simulation.executor.following(backend.q, backend.qd)
        levels = simulation.plc.levels
        inputs = None if levels is self._inputs or not online or levels == self._inputs else levels
        self._inputs = inputs or self._inputs
        if not online:
            return Frame(stamp_ns, None, None, None, power, None, outputs)
        return Frame(stamp_ns, backend.q, backend.qd, backend.torque, power, following, outputs, inputs)

    def _power(self, stamp_ns: int) -> PowerState:
        simulation = self._simulation
        simulation.settle_meter()
        reading, modes = simulation.meter.reading(), simulation.modes
        elapsed = reading.time - self._metered
        mean = (reading.energy - self._energy) / elapsed if elapsed > 0.0 else 0.0
        burnt = (reading.burnt_energy - self._burnt) / elapsed if elapsed > 0.0 else 0.0
        self._energy, self._burnt, self._metered = reading.energy, reading.burnt_energy, reading.time
        return PowerState(
            stamp_ns=stamp_ns,
            mode=modes.mode,
            target_mode=modes.target,
            time_to_target=modes.time_to_target,
            power=mean,
            energy=reading.energy,
            base_power=reading.base_power,
            bus_voltage=reading.bus_voltage,
            burnt_power=burnt,
            joint_power=reading.joint_power,
            joint_torque=reading.joint_torque,
        )


class _Locked(AbstractContextManager[Simulation]):
    def __init__(self, lock: threading.Lock, simulation: Simulation) -> None:
        self._lock, self._simulation = lock, simulation

    def __enter__(self) -> Simulation:
        self._lock.acquire()
        return self._simulation

    def __exit__(self, *exception: object) -> None:
        self._lock.release()


def _refused(sentence: str, code: int = ErrorCode.INVALID_GOAL) -> Outcome:
    return Outcome(NO_GOAL, ErrorCode(code), sentence)
