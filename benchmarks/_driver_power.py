"""The power side of `benchmarks/driver.py`: watts of modes, times of transitions, the published
energy.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ir_description import Cell, load_power_data
from ir_msgs_py.modes import ROW, Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import Driver, Simulation, TrajectoryGoal, make_simulation

HOUR = 3600.0
TICK = 0.01
LIMIT = 600.0  # s of plant time for a mode to come


def until(simulation: Simulation, mode: Mode) -> None:
    """Step until the mode has come."""
    for _ in range(round(LIMIT / simulation.settings.dt)):
        if simulation.modes.mode is mode:
            return
        simulation.step()
    raise RuntimeError(
        f"{mode.name} has not come within {LIMIT:g} s, it is {simulation.modes.mode.name}"
    )


def press(*bits: str) -> Callable[[Simulation], None]:
    """Set these bits; "-bit" clears one."""

    def act(simulation: Simulation) -> None:
        for bit in bits:
            simulation.plc.set_bit(bit.removeprefix("-"), not bit.startswith("-"))

    return act


def wake(simulation: Simulation) -> None:
    """What a Wake-on-LAN packet does."""
    simulation.plc.set_bit("hib", False)
    simulation.wake()


RESTS = (
    (Mode.STAND_ON_BRAKES, press("drives_off"), press("-drives_off", "drives_on")),
    (Mode.BUS_POWER_OFF, press("ab"), press("-ab")),
    (Mode.HIBERNATION, press("hib"), wake),
)


def transition_rows(cell: Cell) -> list[dict[str, Any]]:
    """How long every transition into a mode and out of it takes, beside its parameter."""
    simulation = make_simulation(cell, backend="ideal")
    rows = []
    for mode, enter, leave in RESTS:
        rest = ROW[mode]
        times = simulation.modes.times[mode]
        for act, transition, there, asked in (
            (enter, rest.entering, mode, times.enter),
            (leave, rest.leaving, Mode.STAND_ON_MOTORS, times.leave),
        ):
            act(simulation)
            until(simulation, transition)
            began = simulation.time
            until(simulation, there)
            took = simulation.time - began
            row = {"case": "transition", "name": transition.name, "seconds": took, "asked": asked}
            rows.append({**row, "error_s": abs(took - asked)})
        press("-drives_on")(simulation)
        simulation.run(1.0)
    return rows


def table_2_rows(cell: Cell) -> list[dict[str, Any]]:
    """Watts at the meter in every mode at machine home, beside Table II's."""
    data = load_power_data()
    loads = {0.0: "none"}
    if cell.tool is not None and any(row.payload == cell.tool.mass for row in data.table_2):
        loads[cell.tool.mass] = cell.tool.name
    rows = []
    for payload, load in loads.items():
        simulation = make_simulation(cell, load)
        simulation.run(1.0)
        rows.append(_watts(simulation, Mode.STAND_ON_MOTORS, payload))
        for mode, enter, leave in RESTS:
            enter(simulation)
            until(simulation, mode)
            rows.append(_watts(simulation, mode, payload))
            leave(simulation)
            until(simulation, Mode.STAND_ON_MOTORS)
            press("-drives_on")(simulation)
            simulation.run(0.1)
    for row in rows:
        row["table"] = data.measured(row["payload_kg"], row["mode"])
        row["error_percent"] = 100.0 * abs(row["watts"] / row["table"] - 1.0)
    return rows


def _watts(simulation: Simulation, mode: Mode, payload: float) -> dict[str, Any]:
    def energy() -> float:
        simulation.mains.settle()
        return simulation.mains.meter.reading().energy

    before = energy()
    simulation.run(0.5)
    watts = (energy() - before) / 0.5
    return {"case": "Table II", "mode": mode.name, "payload_kg": payload, "watts": watts}


def energy_row(cell: Cell, seconds: float) -> dict[str, Any]:
    """The ideal robot to and fro and at rest for so long: the meter beside the sum of what it
    publishes.
    """
    simulation = make_simulation(cell, backend="ideal")
    driver = Driver(simulation, round(TICK / simulation.settings.dt))
    home = simulation.executor.command
    places = (home + np.array([0.8, 0.2, -0.2, 0.4, -0.3, 0.5]), home)
    rest = np.zeros((1, 6))
    total = energy = 0.0
    for k in range(1, round(seconds / TICK)):
        if k % 1500 == 0:  # every 15 s, and 60 s of Bus Power Off in every 5 min
            press("ab" if k % 30_000 == 24_000 else "-ab")(simulation)
            if simulation.modes.motors_on:
                target = places[k // 1500 % 2][None]
                goal = TrajectoryGoal(
                    JointTrajectory.from_seconds(simulation.robot.joint_names, [2.5], target, rest)
                )
                simulation.execute(simulation.vet(goal, 0), 0)
        frame = driver.tick(round(k * TICK * 1e9))
        if frame.power is not None:
            total += frame.power.power * TICK
            energy = frame.power.energy
    driver.close()
    percent = 100.0 * abs(total / energy - 1.0)
    return {
        "case": "energy",
        "cell": cell.name,
        "published_J": total,
        "meter_J": energy,
        "error_percent": percent,
    }
