"""The planner as a library: cells, places and options as people give them, results as they see
them.
"""

from __future__ import annotations

import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from ir_description import cell_to_yaml, load_cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner import Goal, Planner, RequestError
from ir_planner.planner import OptionFields

OPEN = load_cell("open")
BEYOND = np.full(6, 9.0)  # rad


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


def test_a_cell_is_given_by_name_path_value_or_text(tmp_path: Path) -> None:
    file = tmp_path / "cell.yaml"
    file.write_text(cell_to_yaml(OPEN), encoding="utf-8")
    known = Planner("open").cell_hash
    empty = Planner()
    assert not empty.has_cell
    empty.set_cell(text=cell_to_yaml(OPEN))
    for given in (Planner(OPEN), Planner(file), Planner(str(file)), empty):
        assert given.cell_hash == known
    with pytest.raises(RequestError, match="both are"):
        empty.set_cell("open", text=cell_to_yaml(OPEN))
    with pytest.raises(RequestError, match="cell and text are given"):
        empty.set_cell(OPEN, text=cell_to_yaml(OPEN))
    with pytest.raises(RequestError, match="neither is"):
        empty.set_cell()


def test_every_option_is_an_argument(planner: Planner) -> None:
    assert set(OptionFields.__annotations__) == {field.name for field in fields(PlanOptions)}
    one = planner.plan_regional(goal="park", objective="time", seed=3)
    other = planner.plan_regional(goal="park", options=PlanOptions(objective="time", seed=3))
    assert one.trajectory is not None
    assert other.trajectory is not None
    assert one.trajectory.trajectory_id == other.trajectory.trajectory_id
    over = planner.plan_regional(goal="park", options=PlanOptions(seed=4), seed=3)
    assert over.info.seed == 3
    with pytest.raises(RequestError, match="option 'objektive' is unknown"):
        planner.plan_regional(goal="park", objektive="time")  # type: ignore[call-arg]
    with pytest.raises(RequestError, match="safety_distance is -1 m"):
        planner.plan_regional(goal="park", safety_distance=-1.0)


def test_a_place_is_a_text_an_array_or_a_goal(planner: Planner) -> None:
    park = np.array(OPEN.park)
    ids = set()
    for goal in ("park", park, Goal(configuration=park)):
        plan = planner.plan_regional(start="home", goal=goal)
        assert plan.trajectory is not None
        ids.add(plan.trajectory.trajectory_id)
    assert len(ids) == 1
    pose = planner.plan_regional(goal=OPEN.stations[0].pose)
    assert pose.trajectory is not None


@pytest.mark.parametrize(
    "goal", [BEYOND, Goal(configuration=BEYOND), "A1 500 A2 0 A3 0 A4 0 A5 0 A6 0"]
)
def test_a_goal_beyond_a_limit_is_refused_in_every_form(planner: Planner, goal: object) -> None:
    with pytest.raises(RequestError, match=r"goal: joint_a1 is .* it must be in") as caught:
        planner.plan_regional(goal=goal)  # type: ignore[arg-type]
    assert caught.value.code == StatusCode.GOAL_STATE_INVALID


def test_joint_values_of_another_shape_and_poses_as_a_start_are_refused(planner: Planner) -> None:
    with pytest.raises(RequestError, match=r"goal has shape \(5,\): it must be \(6,\)"):
        planner.plan_regional(goal=np.zeros(5))
    with pytest.raises(RequestError, match="start is a pose"):
        planner.plan_regional(start=OPEN.stations[0].name, goal="park")


def test_results_say_what_they_are(planner: Planner) -> None:
    plan = planner.plan_regional(goal="park")
    assert plan.trajectory is not None
    text = repr(plan)
    assert text == str(plan)
    assert f"{plan.report.duration:.2f} s, {plan.report.energy:.0f} J" in text
    assert "certified" in text
    assert plan.trajectory.trajectory_id in text
    program = planner.plan_program(stations=(OPEN.stations[0].name, "home"))
    assert program.program_id in repr(program)
    assert "free" in repr(planner.check_state("home"))
    assert "1 of 1 states are free" in repr(planner.check_states(np.array([OPEN.machine_home])))
    assert "solutions" in repr(planner.compute_ik(OPEN.stations[0].name))
    assert "saves" in repr(planner.standby(600.0))
    assert repr(planner).startswith("Planner('open', ")


def test_results_draw_themselves(planner: Planner) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    plan = planner.plan_regional(goal="park")
    assert plan.trajectory is not None
    for result in (
        plan,
        planner.evaluate(plan.trajectory),
        planner.optimize_trajectory(plan.trajectory),
        planner.plan_program(stations=(OPEN.stations[0].name, "home")),
        planner.standby(600.0),
    ):
        figure = result.plot()
        assert figure.axes[0].has_data()
        pyplot.close(figure)


def test_without_matplotlib_a_plot_says_what_is_missing(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        planner.standby(600.0).plot()
