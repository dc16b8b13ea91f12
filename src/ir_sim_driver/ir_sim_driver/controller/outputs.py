"""Outputs of the driver: frames at a stamp, and the entries of /diagnostics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ir_msgs_py.modes import Mode, PowerState
from ir_msgs_py.plc import PlcOutputs
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.load_check import LoadFinding
from ir_sim_driver.motion import Following
from ir_sim_driver.notices import Level
from ir_sim_driver.plant import Carried
from ir_values.arrays import FloatArray

# Frames: joints every tick; power, controller state and PLC levels when due.
#
# Joints are taken first and without the rest: reading the mains meter takes a fifth of a tick,
# every fifth tick, and would make the period of joint states that irregular.

POWER_PERIOD = 10  # steps: 100 Hz
CONTROLLER_PERIOD = 20  # steps: 50 Hz


@dataclass(frozen=True, eq=False)
class Joints:
    """Joints at a stamp [ns]: q, qd, torque (n,) [rad, rad/s, Nm].

    None while the controller is off the network.
    """

    stamp_ns: int
    q: FloatArray | None = None
    qd: FloatArray | None = None
    torque: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Frame:
    """What is published at the stamp of `joints`; None: nothing of it now.

    load: what is carried. load_check: of a movement that has ended.
    """

    joints: Joints
    load: Carried
    power: PowerState | None
    following: Following | None
    outputs: PlcOutputs | None
    load_check: LoadFinding | None = None


class FrameMaker:
    """Makes frames of `simulation`, which is stepped `steps` times between two of them."""

    def __init__(self, simulation: Simulation, steps: int) -> None:
        self._simulation = simulation
        self._steps = steps
        self._outputs: PlcOutputs | None = None
        self._energy = 0.0
        self._dissipated = 0.0
        self._rectified = 0.0
        self._metered = 0.0

    def joints(self, stamp_ns: int) -> Joints:
        """The joints of now."""
        if not self._simulation.on_the_network:
            return Joints(stamp_ns)
        backend = self._simulation.backend
        return Joints(stamp_ns, backend.q, backend.qd, backend.torque)

    def take(self, joints: Joints) -> Frame:
        """The frame around these joints of now."""
        simulation = self._simulation
        backend = simulation.backend
        outputs = None
        following = None
        power = None
        if simulation.steps % POWER_PERIOD < self._steps:
            power = self._power(joints.stamp_ns)
            present = simulation.outputs()
            if present != self._outputs:
                self._outputs = present
                outputs = present
        if joints.q is None:
            return Frame(joints, simulation.load, power, None, outputs)
        if simulation.steps % CONTROLLER_PERIOD < self._steps:
            following = simulation.executor.following(backend.q, backend.qd)
        finding = simulation.load_checks.take()
        return Frame(joints, simulation.load, power, following, outputs, finding)

    def _power(self, stamp_ns: int) -> PowerState:
        """The meter's reading; powers [W] are means since the reading before, as differences of
        energies.
        """
        simulation = self._simulation
        simulation.mains.settle()
        reading = simulation.mains.meter.reading()
        modes = simulation.modes
        elapsed = reading.time - self._metered
        per_second = 1.0 / elapsed if elapsed > 0.0 else 0.0
        mean = (reading.energy - self._energy) * per_second
        dissipated = (reading.burnt_energy - self._dissipated) * per_second
        rectifier = (reading.rectifier_energy - self._rectified) * per_second
        self._energy = reading.energy
        self._dissipated = reading.burnt_energy
        self._metered = reading.time
        self._rectified = reading.rectifier_energy
        temperature = simulation.backend.temperature
        return PowerState(
            stamp_ns=stamp_ns,
            mode=modes.mode,
            target_mode=modes.target,
            time_to_target=modes.time_to_target,
            power=mean,
            energy=reading.energy,
            base_power=reading.base_power,
            bus_voltage=reading.bus_voltage,
            burnt_power=dissipated,
            joint_power=reading.joint_power,
            joint_torque=reading.joint_torque,
            joint_current=reading.joint_current,
            joint_temperature=np.zeros(0) if temperature is None else temperature,
            rectifier_loss=rectifier,
            tool_power=reading.tool_power,
            plant=simulation.plant.name,
        )


# Entries of /diagnostics, without messages.


class PartStatus(NamedTuple):
    """One part of the driver."""

    name: str
    level: Level
    sentence: str
    values: dict[str, object]


_LAG_SHOWN = 0.5  # s; people and timeouts notice no shorter one


def report(
    simulation: Simulation, worst_lag: float, failure: str = "", lag: float = 0.0
) -> list[PartStatus]:
    """Controller, executor and plant; the controller's entries are STALE while it is off the
    network.

    worst_lag, lag [s]: delay of the plant's thread, the longest so far and now; failure: why it has
    ended.
    """
    reading = simulation.mains.meter.reading()
    level = Level.OK
    sentence = "running"
    if failure or simulation.fault:
        level = Level.ERROR
        sentence = failure or simulation.fault
    elif lag > _LAG_SHOWN:
        level = Level.WARN
        sentence = f"{lag:.1f} s behind the clock: this machine is too slow, or loaded"
    plant = PartStatus(
        "ir_sim_driver: plant",
        level,
        sentence,
        {
            "plant": simulation.plant.name,
            "plant time [s]": f"{simulation.time:.3f}",
            "energy [J]": f"{reading.energy:.1f}",
            "load": simulation.load.text,
            "emergency stop": "latched" if simulation.stopped else "reset",
            "worst delay of the plant's thread [ms]": f"{worst_lag * 1e3:.2f}",
        },
    )
    if not simulation.on_the_network:
        asleep = f"{simulation.modes.mode.name}: no data, only Wake-on-LAN is heard"
        return [
            plant,
            PartStatus("ir_sim_driver: controller", Level.STALE, asleep, {}),
            PartStatus("ir_sim_driver: executor", Level.STALE, asleep, {}),
        ]
    return [plant, _controller(simulation), _executor(simulation)]


def _controller(simulation: Simulation) -> PartStatus:
    mode = simulation.modes.mode
    last = simulation.notices.last
    level = Level.OK
    sentence = mode.name
    if mode is Mode.EMERGENCY_STOP or simulation.stopped:
        level = Level.ERROR
        sentence = simulation.fault or "emergency stop: release it, then recover"
    elif last is not None and last.level is not Level.OK:
        level, sentence = last
    return PartStatus(
        "ir_sim_driver: controller",
        level,
        sentence,
        {
            "mode": mode.name,
            "operating mode": simulation.plc.operating_mode.name,
            "time to target [s]": f"{simulation.modes.time_to_target:.3f}",
            "emergency stop left the path by "
            "[mm]": f"{simulation.safety.emergency.excursion * 1e3:.2f}",
        },
    )


def _executor(simulation: Simulation) -> PartStatus:
    executor = simulation.executor
    load = simulation.load_checks.last
    level = Level.OK
    sentence = f"executing {executor.label}" if executor.active else "holding"
    held = simulation.speed_scaling.holds()
    if executor.active and held:
        level = Level.WARN
        sentence = f"{sentence}, which stands: {held}"
    if load is not None and load.noticed:
        level = Level.WARN
        sentence = load.sentence
    return PartStatus(
        "ir_sim_driver: executor",
        level,
        sentence,
        {
            "path time [s]": f"{executor.path_time:.3f}",
            "path speed": f"{executor.path_speed:.3f}",
            "tool deviation [mm]": f"{executor.deviation * 1e3:.4f}",
        },
    )
