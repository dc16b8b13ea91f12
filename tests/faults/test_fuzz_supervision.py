"""Deviations in every mode: holding, moving, stopping, braking, standing on brakes, asleep, after a
stop.

Whoever leaves the tube around its command or its range is stopped by the brakes, and the fault is
shown until somebody recovers; who stays inside goes on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.modes import OFF_THE_NETWORK, Mode, TransitionTimes
from ir_msgs_py.plc import PlcInputs
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import Simulation, SimulationSettings, TrajectoryGoal, make_simulation
from ir_sim_driver.controller.outputs import report
from ir_sim_driver.notices import Level

LOOKS = 12  # steps within which a deviation must be seen: the supervision looks every 4
SHORT = TransitionTimes(
    **{
        f"{mode}_{part}": 0.05
        for mode in ("stand_on_brakes", "bus_power_off", "hibernation")
        for part in ("enter", "leave", "minimum_stay")
    }
)

BARE = replace(
    load_cell("open"), floor=False, equipment=(), stations=(), parts=(), program=(), tasks=()
)
SITUATIONS = ("holding", "moving", "stopping", "drives_off", "ab", "hib", "emergency_stop")


def brought_into(situation: str, steps: int) -> Simulation:
    """An ideal robot, so many steps after what brings it into a situation."""
    simulation = make_simulation(
        BARE, backend="ideal", settings=SimulationSettings(transitions=SHORT)
    )
    simulation.run(0.1)
    if situation in ("moving", "stopping", "emergency_stop"):
        q = simulation.backend.q
        rest = np.zeros((2, 6))
        names = simulation.robot.joint_names
        goal = TrajectoryGoal(
            JointTrajectory.from_seconds(names, [0.0, 3.0], [q, q + 0.4], rest, rest)
        )
        simulation.execute(simulation.vet(goal, 0), 0)
        simulation.run(1.0)
    if situation == "stopping":
        simulation.abort("for a test")
    elif situation not in ("holding", "moving"):
        simulation.plc.set_bit(situation, True)
    for _ in range(steps):
        simulation.step()
    return simulation


def deviate(simulation: Simulation, by: np.ndarray) -> None:
    """The robot is elsewhere, all at once, and stands there, or follows its command from there."""
    backend = simulation.backend
    follow = backend.track
    backend.track = lambda q: follow(q + by)  # type: ignore[method-assign]
    backend.reset(backend.q + by)


def deviation(simulation: Simulation, by: np.ndarray) -> float:
    """How far the tool moves by it [m]."""
    q = simulation.backend.q
    return float(np.linalg.norm(simulation.tool.position(q + by) - simulation.tool.position(q)))


def is_shown(simulation: Simulation) -> bool:
    """In the state and by diagnostics, as far as the controller is heard."""
    entries = report(simulation, 0.0)
    heard = entries[:1] if simulation.modes.mode in OFF_THE_NETWORK else entries[:2]
    return bool(simulation.fault) and all(entry.level is Level.ERROR for entry in heard)


def recovered(simulation: Simulation) -> bool:
    """Whether it can be brought back into service."""
    del simulation.backend.track
    simulation.plc.set_all(PlcInputs())
    for _ in range(40):
        simulation.wake()
        simulation.run(0.05)
        if simulation.modes.mode in (
            Mode.EMERGENCY_STOP,
            Mode.STAND_ON_MOTORS,
            Mode.STAND_ON_BRAKES,
        ):
            break
    simulation.recover()
    simulation.plc.set_bit("drives_on", True)
    simulation.run(0.3)
    return simulation.modes.mode is Mode.STAND_ON_MOTORS and not simulation.fault


def unseen(cases: int, seed: int) -> tuple[int, list[str]]:
    """How many large ones were made, and what was stopped though it was small, or was not though
    large.
    """
    generator = np.random.default_rng(seed)
    large = 0
    wrong = []
    for case in range(cases):
        situation = SITUATIONS[case % len(SITUATIONS)]
        simulation = brought_into(situation, int(generator.integers(0, 600)))
        mode = simulation.modes.mode
        tube = simulation.settings.execution.tube
        by = generator.normal(size=6) * 10.0 ** generator.uniform(-5.0, 0.5)
        off = deviation(simulation, by)
        moves = bool(simulation.backend.qd.any())
        q = simulation.backend.q + by
        robot = simulation.robot
        slack = 0.02
        outside = bool(((q > robot.position_max + slack) | (q < robot.position_min - slack)).any())
        expected = outside or off > 2.0 * tube
        if not expected and (moves or off > 0.5 * tube):
            continue  # too near to the bound to say, or the jump itself is too fast
        if moves and mode is Mode.EMERGENCY_STOP and not outside:
            continue  # it is being braked: nobody knows where
        large += expected
        deviate(simulation, by)
        for _ in range(LOOKS):
            simulation.step()
        label = f"case {case}: {off:.4g} m in {mode.name} ({situation})"
        if bool(simulation.fault) is not expected:
            wrong.append(f"{label}: {simulation.fault or 'not seen'}")
        elif expected:
            simulation.run(0.3)
            stood = simulation.backend.q.copy()
            simulation.run(0.3)
            if not (is_shown(simulation) and np.array_equal(simulation.backend.q, stood)):
                wrong.append(f"{label}: not stopped, or not shown")
            elif not recovered(simulation):
                wrong.append(
                    f"{label}: not recovered, {simulation.modes.mode.name}: {simulation.fault}"
                )
    return large, wrong


def test_five_deviations_in_every_situation_are_seen() -> None:
    large, wrong = unseen(35, seed=1)
    assert wrong == []
    assert large > 10


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_two_thousand_deviations_in_every_situation_are_seen(seed: int) -> None:
    assert unseen(500, seed=10 + seed)[1] == []
