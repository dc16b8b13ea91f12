"""No value of an argument of the library leads to a traceback: every public callable by a table of
bad values, each alone in an otherwise good call.

A call either answers or raises an error of the package whose sentence is one line that names the
argument. What holds no number is never answered.
"""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import NO_TILT
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, Planner, PlannerError, PlanOptions, Reference, parse_goal, what_if
from ir_values.errors import IrError

NAN = float("nan")
BAD: dict[str, Any] = {
    "None": None,
    "text": "x",
    "empty text": "",
    "long text": "x" * 500,
    "bytes": b"x",
    "nan": NAN,
    "inf": float("inf"),
    "-inf": float("-inf"),
    "negative": -1.0,
    "fraction": 0.5,
    "huge": 1e308,
    "huge integer": 10**400,
    "complex": 1j,
    "true": True,
    "list": [0.1],
    "ragged": [[1.0, 2.0], [3.0]],
    "mapping": {"x": 1.0},
    "object": object(),
    "no joints": np.zeros(0),
    "five joints": np.zeros(5),
    "matrix": np.zeros((2, 3)),
    "nan joints": np.full(6, NAN),
    "nan pose": np.full((4, 4), NAN),
    "flat pose": np.zeros((4, 4)),
    "far joints": np.full(6, 1e9),
    "words": ["x"] * 6,
    "function": len,
}
NO_NUMBERS = ("nan", "inf", "-inf", "nan joints", "nan pose")
SENTENCE_MAX = 1000
CALLS = ("cancelled", "progress", "clock", "read_cell")  # functions, which are called as they are
QUICK = PlanOptions(objective="time", max_iterations=50)
SIX = tuple(f"joint_a{i}" for i in range(1, 7))


@dataclass(frozen=True)
class Target:
    """A callable with arguments of a good call; said: what a sentence may name an argument by."""

    call: Callable[..., Any]
    good: dict[str, Any]
    said: dict[str, str] = field(default_factory=dict)

    def arguments(self) -> Iterator[str]:
        """Names of all of its arguments but functions."""
        for name, parameter in inspect.signature(self.call).parameters.items():
            if parameter.kind is not parameter.VAR_KEYWORD and name not in CALLS:
                yield name


OPEN = Planner("open", clock=lambda: 0.0)
TENDED = Planner("flexible", clock=lambda: 0.0)
HOME = np.array(OPEN.cell.machine_home)
PARK = np.array(OPEN.cell.park)
DRIVEN = OPEN.plan_regional(goal="park", options=QUICK).trajectory
assert DRIVEN is not None
STATION = OPEN.cell.stations[0].name
POSE = np.array(OPEN.scene().chain.tcp_poses(HOME[None])[0])
MOVED = POSE + np.array([[0.0, 0.0, 0.0, 0.1], *np.zeros((3, 4))])
LINE = CartesianSegment("line", (MOVED,))
MOTION = dict.fromkeys(
    ("start_velocity", "start_acceleration", "goal_velocity", "goal_acceleration"), "in motion"
)
POINTS = np.stack([HOME, PARK])


def targets() -> dict[str, Target]:
    """Every public callable."""
    quick = {"options": QUICK}
    names = {"joint_names": "joint", "times_ns": "point", "times": "point"}
    names |= {"positions": "position", "velocities": "velocity", "accelerations": "acceleration"}
    given = {"joint_names": SIX, "positions": POINTS}

    def through(points: Any, times: Any = None) -> object:
        return OPEN.plan_trajectory(reference=Reference(points, times), options=QUICK)

    def to_goal(configuration: Any = None, pose: Any = None) -> object:
        return OPEN.plan_regional(goal=Goal(configuration, pose), options=QUICK)

    return {
        "Planner": Target(Planner, {"cell": "open"}),
        "set_cell": Target(OPEN.set_cell, {}, {"cell": "cell", "text": "cell"}),
        "scene": Target(OPEN.scene, {}),
        "check_state": Target(OPEN.check_state, {"q": HOME}, {"q": "state"}),
        "check_states": Target(OPEN.check_states, {"q": HOME[None]}, {"q": "states"}),
        "compute_ik": Target(OPEN.compute_ik, {"goal": STATION}),
        "evaluate": Target(OPEN.evaluate, {"trajectory": DRIVEN}),
        "standby": Target(OPEN.standby, {"pause": 60.0}, {"postures": "posture"}),
        "plan_regional": Target(OPEN.plan_regional, {"goal": "park", **quick}, MOTION),
        "plan_regional to a Goal": Target(
            to_goal, {}, dict.fromkeys(("configuration", "pose"), "goal")
        ),
        "replan": Target(
            OPEN.replan,
            {"driven": DRIVEN, "at": 0.5, "goal": "home", **quick},
            {"driven": "trajectory"},
        ),
        "plan_escape": Target(OPEN.plan_escape, {"start": HOME, **quick}),
        "plan_service": Target(OPEN.plan_service, {"station": STATION, **quick}),
        "plan_trajectory": Target(OPEN.plan_trajectory, {"reference": Reference(POINTS), **quick}),
        "plan_trajectory of a Reference": Target(
            through, {"points": POINTS}, {"times": "time", "points": "point"}
        ),
        "plan_cartesian": Target(
            OPEN.plan_cartesian, {"path": CartesianPath(POSE, (LINE,)), **quick}
        ),
        "optimize_trajectory": Target(OPEN.optimize_trajectory, {"trajectory": DRIVEN, **quick}),
        "plan_program": Target(
            OPEN.plan_program, {"stations": ("home",), **quick}, {"stations": "station"}
        ),
        "cycle_request": Target(OPEN.cycle_request, {}),
        "trajectories.get": Target(
            OPEN.trajectories.get, {"key": DRIVEN.trajectory_id}, {"key": "trajectory"}
        ),
        "sample": Target(DRIVEN.sample, {"t": [0.1]}, {"t": "times"}),
        "until": Target(DRIVEN.until, {"time": 0.1}),
        "then": Target(DRIVEN.until(0.1).then, {"following": DRIVEN}),
        "reordered": Target(DRIVEN.reordered, {"joint_names": SIX}, {"joint_names": "joint"}),
        "JointTrajectory": Target(
            JointTrajectory, {"times_ns": np.array([0, 10**9]), **given}, names
        ),
        "JointTrajectory.from_seconds": Target(
            JointTrajectory.from_seconds, {"times": np.array([0.0, 1.0]), **given}, names
        ),
        "PlanOptions": Target(PlanOptions, {}),
        "CartesianSegment": Target(CartesianSegment, {"kind": "line", "poses": (POSE,)}),
        "CartesianPath": Target(CartesianPath, {"start": POSE, "segments": (LINE,)}),
        "parse_goal": Target(parse_goal, {"text": "home", "cell": OPEN.cell}, {"text": "goal"}),
        "what_if": Target(
            what_if,
            {
                "cell": "open",
                "values": {"cycle_time": [0.0]},
                "options": QUICK,
                "stations": ("home",),
            },
            {"values": "value"},
        ),
        "plan_steady_cycle": Target(TENDED.plan_steady_cycle, quick),
        "set_equipment": Target(
            TENDED.set_equipment, {"name": TENDED.cell.equipment[0].name}, {"name": "equipment"}
        ),
    }


TARGETS = targets()
CASES = [(name, argument) for name, target in TARGETS.items() for argument in target.arguments()]
OPTIONS = [field.name for field in fields(PlanOptions)]


def asked(call: Callable[..., Any], arguments: dict[str, Any]) -> str:
    """The sentence that refuses a call, "" where it is answered. Requests to a planner are refused
    with its own error alone, but for a cell that can't be read.
    """
    of_planner = isinstance(getattr(call, "__self__", None), Planner)
    expected = (
        PlannerError if of_planner and call.__name__ != "set_cell" else (PlannerError, IrError)
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            call(**arguments)
    except expected as error:
        return str(error) or "no sentence"
    return ""


def faults(call: Callable[..., Any], good: dict[str, Any], argument: str, said: str) -> list[str]:
    """What is wrong with how bad values of an argument are met."""
    found = []
    for bad, value in BAD.items():
        parameter = inspect.signature(call).parameters.get(argument)
        if parameter is not None and value is parameter.default:
            continue
        try:
            sentence = asked(call, {**good, argument: value})
        except Exception as error:  # what this test looks for
            found.append(f"{bad}: {type(error).__name__}: {error}"[:200])
            continue
        if not sentence:
            if bad in NO_NUMBERS:
                found.append(f"{bad}: is answered")
        elif argument not in sentence and said not in sentence:
            found.append(f"{bad}: doesn't name {said!r}: {sentence}"[:200])
        elif not sentence.isprintable() or len(sentence) > SENTENCE_MAX:
            found.append(f"{bad}: no line of at most {SENTENCE_MAX} characters: {sentence!r}"[:200])
    return found


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_a_bad_value_of_an_argument_is_refused_in_a_sentence(name: str, argument: str) -> None:
    target = TARGETS[name]
    said = target.said.get(argument, argument)
    assert faults(target.call, target.good, argument, said) == []


@pytest.mark.parametrize("option", OPTIONS)
def test_a_bad_value_of_an_option_is_refused_in_a_sentence(option: str) -> None:
    tilt = 2.0 if option.startswith("tilt_") else NO_TILT

    def asked_with(**changes: Any) -> object:
        return OPEN.plan_regional(
            goal="park", **{"objective": "time", "max_iterations": 50, "tilt_max": tilt, **changes}
        )

    assert faults(asked_with, {}, option, option) == []
