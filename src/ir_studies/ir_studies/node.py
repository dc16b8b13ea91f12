"""The node `ir_studies`: one study at a time by an action, with progress and cancel.

Settings are the YAML of the command. Files are written below one folder only, and cell files read
below the folders that were allowed.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from ir_description import is_path
from ir_msgs.action import RunStudy
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.diagnostics import OK, Condition, Diagnostics
from ir_msgs_py.ros.node_process import run_node
from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.ros.serving import RecordedActionServer, answered
from ir_msgs_py.ros.topics import ACTION_SERVICES
from ir_msgs_py.status import Status, StatusCode
from ir_recorder.errors import RecorderError
from ir_studies.errors import SettingsError, StoppedError, StudyError
from ir_studies.settings import StudiesSettings
from ir_studies.studies import StudyAnswer, study_of
from ir_studies.work import Means
from ir_values.errors import IrError
from ir_values.files import FileRoots


def declared_settings(node: Node) -> StudiesSettings:
    """Declares a parameter per setting, fixed at the start, and returns their values;
    InvalidValueError for a bad one.
    """
    return Parameters(node, StudiesSettings).value


_FEEDBACK_S = 0.2  # a person reads no faster
_ROWS = 1000  # of the table in the result
_LONGEST = 200  # characters of output_folder
_END_S = 10.0  # until a study that was asked to stop has stopped
_THREADS = 4  # the study, goals that are refused, cancelling, parameters


class StudiesNode(Node):
    """Runs one study at a time; `means`: what it is made with, for tests; None: as the parameters
    say.
    """

    def __init__(
        self, settings: StudiesSettings | None = None, means: Means | None = None, **options: Any
    ) -> None:
        super().__init__(names.STUDIES, **options)
        found = settings or declared_settings(self)
        self._output = FileRoots.of([found.output])
        self._roots = FileRoots.of(found.roots)
        self._means = means or Means(found.workers, found.scheduler)
        self._turn = threading.Lock()
        self._ending = threading.Event()
        self._doing = ""
        self._diagnostics = Diagnostics(self)
        self.create_timer(1.0, self._diagnose)
        self._server = RecordedActionServer(
            self,
            RunStudy,
            own(names.RUN_STUDY),
            self._run,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup(),
            **ACTION_SERVICES,
        )

    def destroy_node(self) -> None:
        """End the study that runs, then the node."""
        self._ending.set()
        if self._turn.acquire(timeout=_END_S):
            self._turn.release()
        self._server.destroy()
        super().destroy_node()

    def _run(self, goal: ServerGoalHandle) -> RunStudy.Result:
        """One goal, from its settings to its files."""
        result = RunStudy.Result()
        answered(
            result,
            names.STUDIES,
            lambda: self._study(goal, result),
            _known,
            self.get_logger().error,
        )
        code = result.status.code
        if code == StatusCode.SUCCESS:
            goal.succeed()
        elif code == StatusCode.PREEMPTED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return result

    def _study(self, goal: ServerGoalHandle, result: RunStudy.Result) -> Status:
        """The status of a study; what it found is in the result."""
        if not self._turn.acquire(blocking=False):
            return Status(
                StatusCode.FAILURE, "a study is running: one at a time; cancel it, or wait"
            )
        try:
            asked = goal.request
            study = study_of(asked.settings, asked.kind, self._placed)
            folder = self._folder(asked.output_folder or asked.kind)
            answer = study.run(folder, self._means_of(goal))
        finally:
            self._doing = ""
            self._turn.release()
        fill(result, answer, folder)
        return Status.success(answer.summary)

    def _means_of(self, goal: ServerGoalHandle) -> Means:
        """The means of a goal: progress as feedback, cancel as what stops it."""
        own = self._means
        last = [-_FEEDBACK_S]
        said = [""]

        def progress(phase: str, done: int, of: int, best: str) -> None:
            self._doing = f"{phase} {done} of {of}"
            if time.monotonic() - last[0] >= _FEEDBACK_S or done == of or phase != said[0]:
                last[0] = time.monotonic()
                said[0] = phase
                goal.publish_feedback(
                    RunStudy.Feedback(phase=phase, done=done, total=of, best=best)
                )

        def stopped() -> bool:
            return self._ending.is_set() or bool(goal.is_cancel_requested)

        return Means(own.workers, own.scheduler, progress, stopped, own.command)

    def _placed(self, name: str) -> str:
        """A cell or plant file by its path, where it may be read; a bundled name as it is."""
        return str(self._roots.inside(name)) if is_path(name) else name

    def _folder(self, name: str) -> Path:
        """A folder of the output, or one below it."""
        if len(name) > _LONGEST:
            raise SettingsError(f"output_folder has {len(name)} characters: at most {_LONGEST}")
        return self._output.inside(self._output.folders[0] / name)

    def _diagnose(self) -> None:
        sentence = self._doing or "ready"
        self._diagnostics.publish([Condition(names.STUDIES, OK, sentence, {}, "")])


def fill(result: RunStudy.Result, answer: StudyAnswer, folder: Path) -> None:
    """The answer as a message; files relative to the folder, at most _ROWS rows."""
    result.summary = answer.summary
    result.files = [str(path.relative_to(folder)) for path in answer.files]
    result.table = "".join(answer.table.splitlines(keepends=True)[: _ROWS + 1])


def _known(error: Exception) -> Status | None:
    if isinstance(error, StoppedError):
        return Status(StatusCode.PREEMPTED, "stopped; the same goal goes on from there")
    if isinstance(error, SettingsError):
        return Status(StatusCode.INVALID_GOAL_CONSTRAINTS, str(error))
    if isinstance(error, (StudyError, RecorderError, IrError, OSError)):
        return Status(StatusCode.FAILURE, str(error))
    return None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(
        names.STUDIES,
        StudiesNode,
        arguments,
        executor=lambda: MultiThreadedExecutor(num_threads=_THREADS),
        refusals=(StudyError, IrError),
        about="Studies of a cell: where things should stand, planners against each other.",
    )


if __name__ == "__main__":
    sys.exit(main())
