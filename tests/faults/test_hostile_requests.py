"""Hostile requests to every service of the planner: a status with a sentence, and nothing has
changed.

Each case is a request that makes sense, with one to four of its fields replaced by what somebody
could send.
The judge looks at the answer alone: it converts, no figure of a SUCCESS is NaN (inf is no pair to
be near to, or a mode that the pause is too short for), a refusal has a sentence that can be
printed, and the cell is the one of before.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_description.library import read_cell_apart
from ir_msgs import srv
from ir_msgs.msg import PlanOptions, Status
from ir_msgs_py.names import JOINT_NAMES
from ir_planner.node.inputs import LastState
from ir_planner.node.requests import Requests
from ir_planner.planner import Planner
from ir_planner.settings import PlannerSettings

HOME = [0.0, -math.pi / 2, math.pi / 2, 0.0, 0.0, 0.0]
NUMBERS = (
    math.nan,
    math.inf,
    -math.inf,
    1e308,
    -1e308,
    5e-324,
    -1.0,
    0.0,
    -0.0,
    1.0,
    1e-9,
    3.2,
    1e6,
)
WHOLE = (0, 1, 2, 1000, 2**31 - 1, 2**32 - 1, 2**63, 2**64 - 1)
TEXTS = (
    "", "\0", "a\0b", "‮\U0001f9be", "<script>alert(1)</script>", "\x1b[31m", "a\nb\r", "../../etc/passwd",  # noqa: E501
    "/etc/shadow", "/dev/zero", "x" * 300, "x" * 10_000_000, "none", "gripper", "gripper+gripper", "demo",  # noqa: E501
    "open", "lathe", "lathe_work", "infeed_pick", "home", "park", "A1 0 A2 -90 A3 90 A4 0 A5 0 "
"A6 0",
    "A1 nan", "X 1e308 Y 0 Z 0 A 0 B 0 "
"C 0", "X 1.8 Y 0 Z 1.2 A 0 B 90 C 0", "X", "%s%n{0}", "exit", "entry",
    "ccd", "genetic", "movement_cost", "time", "asynchronous", "cell", "base_link", "world", "a: &x [*x, *x]",  # noqa: E501
    "format: ir_cell/1\nname: x\nrobot: kr210_r2700_extra", "[" * 5000, "joint_a1",
)  # fmt: skip
QUICK = PlanOptions(planning_time=0.2, max_iterations=30)
SENTENCE_MAX = 4000  # characters: what fits a screen


def state(values: list[float] | None = None) -> JointState:
    return JointState(name=list(JOINT_NAMES), position=values or HOME)


def line(count: int = 3) -> JointTrajectory:
    """From home, standing, a little to the side."""
    points = []
    for k in range(count):
        part = k / max(count - 1, 1)
        q = [HOME[0] + 0.2 * part * part * (3 - 2 * part), *HOME[1:]]
        point = JointTrajectoryPoint(positions=q, velocities=[0.0] * 6, accelerations=[0.0] * 6)
        point.time_from_start.sec = 2 * k
        points.append(point)
    return JointTrajectory(joint_names=list(JOINT_NAMES), points=points)


REQUESTS: dict[str, Any] = {
    "set_cell": srv.SetCell.Request(cell_file="open"),
    "get_cell": srv.GetCell.Request(),
    "set_equipment": srv.SetEquipment.Request(name="lathe"),
    "check_state": srv.CheckState.Request(state=state()),
    "compute_ik": srv.ComputeIk.Request(goal="lathe_work", near=state(), starts=2),
    "get_trajectory": srv.GetTrajectory.Request(trajectory_id="0"),
    "get_program": srv.GetProgram.Request(program_id="0"),
    "plan_standby": srv.PlanStandby.Request(pause=60.0, state=state()),
    "evaluate_trajectory": srv.EvaluateTrajectory.Request(trajectory=line()),
    "plan_regional": srv.PlanRegionalMovement.Request(start=state(), goal="home", options=QUICK),
    "plan_service": srv.PlanServiceMovement.Request(
        station="lathe_work", max_candidates=1, options=QUICK
    ),
    "plan_trajectory": srv.PlanTrajectory.Request(reference=line(), options=QUICK),
    "optimize_trajectory": srv.OptimizeTrajectory.Request(trajectory=line(), options=QUICK),
    "plan_program": srv.PlanProgram.Request(stations=["home"], savings=False, options=QUICK),
    "plan_steady_cycle": srv.PlanSteadyCycle.Request(savings=False, options=QUICK),
    "plan_robots": srv.PlanRobots.Request(cell_file="open", options=QUICK),
}
RESPONSES = {
    name: getattr(srv, type(request).__name__.split("_")[0]).Response
    for name, request in REQUESTS.items()
}
CHANGES = ("set_cell", "set_equipment")
EXPECTED = {
    "get_trajectory": Status.INVALID_OBJECT_NAME,
    "get_program": Status.INVALID_OBJECT_NAME,
    "plan_steady_cycle": Status.INVALID_GOAL_CONSTRAINTS,  # the demonstration has no route
    "plan_robots": Status.INVALID_GOAL_CONSTRAINTS,  # it has one robot
}
"""Codes of requests that make sense and yet are no success in the demonstration cell."""


def places(message: Any, kind: str = "") -> Iterator[tuple[Any, str, str]]:
    """Every field of a message and of the messages in it: owner, name, type."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        yield message, name, kind
        inner = value if isinstance(value, list) else [value]
        for part in inner[:3]:
            if hasattr(part, "get_fields_and_field_types"):
                yield from places(part, kind)


def hostile(kind: str, present: Any, rng: np.random.Generator) -> Any:
    """A value for a field of this type."""
    if kind.startswith("sequence<"):
        inner = kind[len("sequence<") : -1]
        if "/" in inner:
            return list(present)[: rng.integers(0, 3)] * int(rng.choice([0, 1, 2, 1200]))
        count = int(
            rng.choice([0, 1, 2, 5, 6, 7, 12, 20_000], p=[0.1, 0.1, 0.1, 0.1, 0.4, 0.1, 0.09, 0.01])
        )
        values = (
            list(present)
            if rng.random() < 0.5 and len(present)
            else [hostile(inner, 0, rng)] * count
        )
        if values and rng.random() < 0.7:
            values[int(rng.integers(len(values)))] = hostile(inner, 0, rng)
        return values
    if kind == "boolean":
        return not present
    if kind == "string":
        return str(rng.choice(np.array(TEXTS, dtype=object)))
    if kind in ("double", "float"):
        return float(rng.choice(NUMBERS))
    bits = int(kind.removeprefix("u").removeprefix("int"))
    low, high = (
        (0, 2**bits - 1) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    )
    return min(max(int(WHOLE[rng.integers(len(WHOLE))]) * int(rng.choice([1, -1])), low), high)


def disturbed(request: Any, rng: np.random.Generator) -> tuple[Any, str]:
    """The request with one to four fields replaced, and which."""
    request = deepcopy(request)
    names = []
    for _ in range(int(rng.integers(1, 5))):
        simple = [
            (owner, name, kind)
            for owner, name, kind in places(request)
            if "/" not in kind or "<" in kind
        ]
        if not simple:
            break
        owner, name, kind = simple[int(rng.integers(len(simple)))]
        value = hostile(kind, getattr(owner, name), rng)
        setattr(owner, name, value)
        names.append(f"{name}={str(value)[:50]!r}")
    return request, ", ".join(names)


def numbers(message: Any) -> Iterator[float]:
    """All floating-point numbers of a message."""
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        for part in value if isinstance(value, list) else [value]:
            if hasattr(part, "get_fields_and_field_types"):
                yield from numbers(part)
            elif isinstance(part, float):
                yield part
        if hasattr(value, "typecode"):
            yield from (float(number) for number in value)


def wrong(name: str, response: Any) -> str:
    """What is wrong with an answer; "" = nothing."""
    try:
        serialize_message(response)
    except Exception as error:
        return f"the answer can't be sent: {error}"
    status = response.status
    if status.code == Status.SUCCESS:
        odd = [number for number in numbers(response) if math.isnan(number) or number == -math.inf]
        return f"SUCCESS with {odd[0]}" if odd else ""
    if not status.message or len(status.message) > SENTENCE_MAX or not status.message.isprintable():
        return f"its sentence is {status.message[:200]!r} ({len(status.message)} characters)"
    return f"it is {status.message[:300]}" if "unexpected" in status.message else ""


class Asked:
    """The planner's handlers without ROS, with the demonstration cell and a robot at home."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.planner = Planner(
            clock=clock, settings=PlannerSettings(cell="demo"), read_cell=read_cell_apart
        )
        self.planner.set_cell("demo")
        known = LastState()
        known.take(np.array(HOME), 0.0)
        self.logged: list[str] = []
        self.requests = Requests(
            planner=self.planner,
            last_state=known,
            now=lambda: 0.0,
            draw_seed=lambda: 1,
            log=self.logged.append,
        )

    def answer(self, name: str, request: Any) -> Any:
        handler: Callable[[Any, Any], Any] = self.requests.guarded(getattr(self.requests, name))
        return handler(request, RESPONSES[name]())


def judged(cases: int, seed: int) -> list[str]:
    """What was wrong with the answers to so many hostile requests: case, service, fields,
    sentence.
    """
    asked = Asked()
    found = []
    rng = np.random.default_rng(seed)
    for case in range(cases):
        name = list(REQUESTS)[case % len(REQUESTS)]
        request, said = disturbed(REQUESTS[name], rng)
        before = asked.planner.cell
        with warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always", RuntimeWarning)
            response = asked.answer(name, request)
        problem = wrong(name, response)
        if warned and not problem:
            problem = f"{warned[0].filename}:{warned[0].lineno} {warned[0].message}"
        changed = asked.planner.cell is not before
        if (
            changed
            and not (name in CHANGES and response.status.code == Status.SUCCESS)
            and not problem
        ):
            problem = "the cell has changed"
        if problem:
            found.append(f"case {case} {name}({said}): {problem}")
        if changed:
            asked.planner.set_cell("demo")
    return found


def still() -> float:
    """A clock that cuts nothing: how far 0.2 s reach is a matter of the machine."""
    return 0.0


@pytest.mark.parametrize("name", REQUESTS)
def test_each_request_makes_sense_before_it_is_disturbed(name: str) -> None:
    response = Asked(still).answer(name, REQUESTS[name])
    expected = EXPECTED.get(name, Status.SUCCESS)
    assert response.status.code == expected, response.status.message


def found_before() -> list[tuple[str, Any, str]]:
    """Requests that this generator found: proofs for hours, overflows, and programs without a
    movement.
    """
    far = line()
    fast = line()
    far.points[1].positions[2] = 1e6
    fast.points[1].velocities[2] = 1e308
    huge = state([1e308, *HOME[1:]])
    program = {"stations": ["home"], "savings": False, "options": QUICK}
    evaluate = srv.EvaluateTrajectory.Request
    standing = srv.PlanProgram.Request
    return [
        ("evaluate_trajectory", evaluate(trajectory=far), "1e+06 rad: it must be within 100 rad"),
        (
            "evaluate_trajectory",
            evaluate(trajectory=fast),
            "1e+308 rad/s: it must be within 10000 rad/s",
        ),
        ("check_state", srv.CheckState.Request(state=huge), "it must be within 100 rad"),
        ("compute_ik", srv.ComputeIk.Request(goal="home", near=huge), "it must be within 100 rad"),
        (
            "plan_regional",
            srv.PlanRegionalMovement.Request(
                start=state(), goal="home", options=PlanOptions(duration=5e-324)
            ),
            "it must be in [0.001, 3600] s",
        ),
        ("plan_program", standing(cycle_time=1.0, **program), "cycle_time (is 1 s)"),
        ("plan_program", standing(front_points=3, **program), "front_points (is 3) must be 0"),
    ]


@pytest.mark.parametrize(("name", "request_", "sentence"), found_before())
def test_what_was_found_is_refused_with_its_bound(name: str, request_: Any, sentence: str) -> None:
    response = Asked(still).answer(name, request_)
    assert response.status.code != Status.SUCCESS
    assert sentence in response.status.message


def test_hostile_requests_are_refused_in_words() -> None:
    assert judged(300, seed=1) == []


@pytest.mark.long
def test_many_hostile_requests_are_refused_in_words() -> None:
    assert judged(6000, seed=2) == []
