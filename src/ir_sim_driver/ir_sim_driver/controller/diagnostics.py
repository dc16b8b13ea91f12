"""What /diagnostics says, without messages: name, level, sentence and values of each part."""

from __future__ import annotations

from typing import NamedTuple

from ir_msgs_py.modes import Mode
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.notices import Level


class Entry(NamedTuple):
    """One part of the driver."""

    name: str
    level: Level
    sentence: str
    values: dict[str, object]


def report(simulation: Simulation, worst_lag: float, failure: str = "") -> list[Entry]:
    """Controller, executor and plant; the controller's entries are STALE while it is off the network.

    worst_lag [s]: longest delay of the plant's thread so far; failure: why it has ended.
    """
    reading = simulation.mains.meter.reading()
    plant = Entry(
        "ir_sim_driver: plant",
        Level.ERROR if failure or simulation.fault else Level.OK,
        failure or simulation.fault or "running",
        {
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
            Entry("ir_sim_driver: controller", Level.STALE, asleep, {}),
            Entry("ir_sim_driver: executor", Level.STALE, asleep, {}),
        ]
    return [plant, _controller(simulation), _executor(simulation)]


def _controller(simulation: Simulation) -> Entry:
    mode = simulation.modes.mode
    last = simulation.notices.last
    level, sentence = Level.OK, mode.name
    if mode is Mode.EMERGENCY_STOP or simulation.stopped:
        level, sentence = Level.ERROR, simulation.fault or "emergency stop: release it, then recover"
    elif last is not None and last.level is not Level.OK:
        level, sentence = last
    return Entry(
        "ir_sim_driver: controller",
        level,
        sentence,
        {
            "mode": mode.name,
            "operating mode": simulation.plc.operating_mode.name,
            "time to target [s]": f"{simulation.modes.time_to_target:.3f}",
            "emergency stop left the path by [mm]": f"{simulation.safety.emergency.excursion * 1e3:.2f}",
        },
    )


def _executor(simulation: Simulation) -> Entry:
    executor = simulation.executor
    return Entry(
        "ir_sim_driver: executor",
        Level.OK,
        f"executing {executor.label}" if executor.active else "holding",
        {
            "path time [s]": f"{executor.path_time:.3f}",
            "path speed": f"{executor.path_speed:.3f}",
            "tool deviation [mm]": f"{executor.deviation * 1e3:.4f}",
        },
    )
