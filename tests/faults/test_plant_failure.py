"""When the plant's thread ends: requests are refused, goals end, and the process exits with a
code.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import Driver, ErrorCode, TrajectoryGoal, make_simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.motion import GoalOutcome
from ir_sim_driver.notices import Level
from ir_sim_driver.plc import SERVICE


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> tuple[Driver, list[GoalOutcome]]:
    """A driver whose plant has failed in the middle of a goal."""
    simulation = make_simulation("open", backend="ideal")
    driver = Driver(simulation)
    outcomes = []
    q = simulation.backend.q
    rest = np.zeros((2, 6))
    names = simulation.robot.joint_names
    goal = TrajectoryGoal(JointTrajectory.from_seconds(names, [0.0, 2.0], [q, q + 0.2], rest, rest))
    ticket = driver.submit(2, lambda: goal, outcomes.append)
    stamp = 0
    while driver.following(ticket) is None:
        stamp += 2_000_000
        driver.tick(stamp)

    def explode() -> None:
        raise SystemError("no such body")

    monkeypatch.setattr(simulation, "step", explode)
    with pytest.raises(SystemError):
        driver.tick(stamp + 2_000_000)
    driver.fail("the plant has stopped")
    driver.submit(2, lambda: goal, outcomes.append)
    driver.close()
    return driver, outcomes


def test_no_request_is_answered_with_success_over_a_dead_plant(
    broken: tuple[Driver, list[GoalOutcome]],
) -> None:
    driver, _ = broken
    requests = (
        lambda: driver.press(SERVICE, "emergency_stop", True),
        lambda: driver.plc.write_inputs("modbus", {"emergency_stop": True}),
        lambda: driver.set_load(lambda cell: pytest.fail("the load was made")),
        driver.recover,
        driver.end_pause,
        driver.query_modes,
        lambda: driver.plc.write_mode_and_pause("modbus", None, 10.0),
    )
    for request in requests:
        with pytest.raises(RequestRefusedError, match="no such body") as refusal:
            request()
        assert refusal.value.code is StatusCode.FAILURE


def test_goals_end_with_a_status_those_that_run_and_those_that_come(
    broken: tuple[Driver, list[GoalOutcome]],
) -> None:
    _, outcomes = broken
    assert [outcome.code for outcome in outcomes] == [ErrorCode.INVALID_GOAL] * 2
    assert all("no such body" in outcome.sentence for outcome in outcomes)


def test_diagnostics_say_so(broken: tuple[Driver, list[GoalOutcome]]) -> None:
    snapshot = broken[0].snapshot(0.0)
    plant = snapshot.entries[0]
    assert plant.level is Level.ERROR
    assert "no such body" in plant.sentence
    assert any(notice.level is Level.ERROR for notice in snapshot.notices)
