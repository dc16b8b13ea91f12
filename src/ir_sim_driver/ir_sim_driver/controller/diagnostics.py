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


_LAG_SHOWN = 0.5  # s; people and timeouts notice no shorter one


def report(
    simulation: Simulation, worst_lag: float, failure: str = "", lag: float = 0.0
) -> list[Entry]:
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
    plant = Entry(
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
            Entry("ir_sim_driver: controller", Level.STALE, asleep, {}),
            Entry("ir_sim_driver: executor", Level.STALE, asleep, {}),
        ]
    return [plant, _controller(simulation), _executor(simulation)]


def _controller(simulation: Simulation) -> Entry:
    mode = simulation.modes.mode
    last = simulation.notices.last
    level = Level.OK
    sentence = mode.name
    if mode is Mode.EMERGENCY_STOP or simulation.stopped:
        level = Level.ERROR
        sentence = simulation.fault or "emergency stop: release it, then recover"
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
            "emergency stop left the path by "
            "[mm]": f"{simulation.safety.emergency.excursion * 1e3:.2f}",
        },
    )


def _executor(simulation: Simulation) -> Entry:
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
    return Entry(
        "ir_sim_driver: executor",
        level,
        sentence,
        {
            "path time [s]": f"{executor.path_time:.3f}",
            "path speed": f"{executor.path_speed:.3f}",
            "tool deviation [mm]": f"{executor.deviation * 1e3:.4f}",
        },
    )
