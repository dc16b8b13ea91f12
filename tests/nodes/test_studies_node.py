"""The node of studies over ROS: settings of the command, progress, cancel, files below its
folder.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor, ShutdownException

from ir_msgs.action import RunStudy
from ir_msgs_py.status import StatusCode
from ir_studies import Means
from ir_studies.node import StudiesNode
from ir_studies.settings import StudiesSettings

WORKER = Path(__file__).parents[1] / "studies" / "fake_layout_worker.py"
SETTINGS = """\
format: ir_layout/1
cell: demo
base: {x: [-0.3, 0.3], y: [-0.3, 0.3]}
placements: 20
rounds: 1
keep: 1
seeds: 1
"""
PLANT = "format: ir_statistics/1\ncell: demo\nplant: {}\n"
HANGS = SETTINGS + "hang_after: 86400\n"
Goal = Callable[..., Any]


@pytest.fixture
def faults() -> list[str]:
    """What the workers do wrong."""
    return []


@pytest.fixture
def node(ros_context: Any, tmp_path: Path, faults: list[str]) -> Iterator[StudiesNode]:
    """The node with workers that plan nothing, spun by threads of its own as in production."""
    command = (sys.executable, "-S", str(WORKER), str(tmp_path), *faults)
    settings = StudiesSettings(output=str(tmp_path / "out"), roots=(str(tmp_path / "cells"),))
    made = StudiesNode(settings, Means(1, command=command), context=ros_context)
    executor = MultiThreadedExecutor(num_threads=4, context=ros_context)
    executor.add_node(made)

    def spin() -> None:
        with suppress(ExternalShutdownException, ShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    yield made
    made.destroy_node()
    executor.shutdown(timeout_sec=60.0)
    thread.join(60.0)


@pytest.fixture
def client(node: StudiesNode, ros_node: Any, ros_executor: Any, wait_for: Any) -> Any:
    made = ros_executor.run(lambda: ActionClient(ros_node, RunStudy, "/ir_studies/run_study"))
    wait_for(made.server_is_ready, what="the action is offered")
    return made


@pytest.fixture
def send(client: Any, ros_executor: Any, wait_for: Any) -> Goal:
    """Sends a goal; its handle, once it is accepted. feedback: where it goes."""

    def goal(feedback: list[Any] | None = None, **fields: str) -> Any:
        def heard(message: Any) -> None:
            if feedback is not None:
                feedback.append(message.feedback)

        request = RunStudy.Goal(
            **{"kind": "layout", "settings": SETTINGS, "output_folder": "a", **fields}
        )
        future = ros_executor.run(lambda: client.send_goal_async(request, feedback_callback=heard))
        wait_for(future.done, what="the goal is accepted")
        return future.result()

    return goal


@pytest.fixture
def result(send: Goal, ros_executor: Any, wait_for: Any) -> Goal:
    """Sends a goal and waits for its result."""

    def ask(**fields: str) -> Any:
        handle = send(**fields)
        future = ros_executor.run(handle.get_result_async)
        wait_for(future.done, what="the study ends")
        return future.result().result

    return ask


def test_a_study_is_made_with_progress_and_its_files_lie_below_the_output(
    send: Goal, ros_executor: Any, wait_for: Any, tmp_path: Path
) -> None:
    feedback: list[Any] = []
    future = ros_executor.run(send(feedback).get_result_async)
    wait_for(future.done, what="the study ends")
    result = future.result().result
    assert result.status.code == StatusCode.SUCCESS
    assert result.status.source == "ir_studies"
    assert "20 placements looked at" in result.summary
    assert list(result.files) == ["table.csv", "best_1.yaml", "index.html"]
    assert all((tmp_path / "out" / "a" / name).is_file() for name in result.files)
    assert result.table.startswith("rank,placement,")
    wait_for(
        lambda: any(one.phase.startswith("error bars") for one in feedback),
        what="the last progress",
    )
    assert all(one.done <= one.total for one in feedback)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"kind": "teleport"}, "kind 'teleport' is unknown; known are layout"),
        ({"kind": ""}, ""),
        ({"settings": ""}, "line 1: the file is empty"),
        ({"settings": "{["}, "this is not YAML"),
        ({"settings": "!!python/object/apply:os.system [id]"}, "is not allowed"),
        ({"settings": SETTINGS + "a: &a [1]\nb: *a\n"}, "aliases (& and *) are not allowed"),
        (
            {"settings": SETTINGS.replace("demo", "/etc/passwd")},
            "outside of the folders that may be used",
        ),
        (
            {"settings": SETTINGS.replace("demo", "../x.yaml")},
            "outside of the folders that may be used",
        ),
        (
            {"kind": "statistics", "settings": PLANT.format("/etc/passwd")},
            "outside of the folders that may be",
        ),
        (
            {"kind": "statistics", "settings": PLANT.format("../x.yaml")},
            "outside of the folders that may be",
        ),
        ({"settings": SETTINGS.replace("20", "1000000000")}, "placements is 1000000000"),
        ({"output_folder": "/etc"}, "outside of the folders that may be used"),
        ({"output_folder": "../b"}, "outside of the folders that may be used"),
        ({"output_folder": "x" * 5000}, "has 5000 characters: at most 200"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_is_written(
    result: Goal, tmp_path: Path, fields: dict[str, str], said: str
) -> None:
    if not said:
        assert result(**fields).status.code == StatusCode.SUCCESS  # the format says the kind
        return
    refused = result(**fields)
    assert refused.status.code != StatusCode.SUCCESS
    assert said in refused.status.message
    assert "root:" not in refused.status.message
    assert not list(tmp_path.rglob("results.jsonl"))


def test_a_folder_that_is_a_link_out_is_refused(result: Goal, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out" / "a").symlink_to(tmp_path / "elsewhere")
    assert "outside of the folders" in result().status.message
    assert not list((tmp_path / "elsewhere").iterdir())


def test_a_file_of_something_else_is_kept_and_named(result: Goal, tmp_path: Path) -> None:
    taken = tmp_path / "out" / "a" / "index.html"
    taken.parent.mkdir(parents=True)
    taken.write_text("mine")
    refused = result(settings=SETTINGS.replace("20", "2")).status
    assert refused.code == StatusCode.FAILURE
    assert "index.html" in refused.message
    assert "unexpected" not in refused.message
    assert taken.read_text() == "mine"


class TestHanging:
    @pytest.fixture
    def faults(self) -> list[str]:
        return ["hang"]

    def test_cancelled_it_ends_and_the_same_goal_goes_on(
        self, send: Goal, result: Goal, ros_executor: Any, wait_for: Any, tmp_path: Path
    ) -> None:
        feedback: list[Any] = []
        handle = send(feedback, settings=HANGS)
        wait_for(lambda: any("plans" in one.phase for one in feedback), what="plans are made")
        assert "one at a time" in result(settings=HANGS).status.message  # meanwhile
        ros_executor.run(handle.cancel_goal_async)
        future = ros_executor.run(handle.get_result_async)
        wait_for(future.done, what="the study stops")
        assert future.result().result.status.code == StatusCode.PREEMPTED
        assert "goes on from there" in future.result().result.status.message
        kept = (tmp_path / "out" / "a" / "results.jsonl").read_bytes()
        again = result(settings=SETTINGS + "hang_after: 1.0\n")
        assert again.status.code == StatusCode.SUCCESS
        assert (tmp_path / "out" / "a" / "results.jsonl").read_bytes().startswith(kept)
        assert "no answer within 1 s" in again.summary
