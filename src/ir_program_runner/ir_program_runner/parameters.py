"""The runner's settings as ROS parameters; none changes while a program runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.node import Node

from ir_msgs_py.modes import PREFIX, TransitionTimes
from ir_msgs_py.ros.parameters import Parameters
from ir_program_runner.settings import LinkSettings, ProgramSettings


@dataclass(frozen=True)
class RunnerParameters:
    """What the node is set to; transitions count where the driver doesn't report them."""

    program: Parameters[ProgramSettings]
    transitions: Parameters[TransitionTimes]
    links: Parameters[LinkSettings]


def declare_parameters(node: Node, busy: Callable[[], bool]) -> RunnerParameters:
    """Declare all; a change while `busy` is refused. Raises ParameterError for a bad value at the
    start.
    """

    def refuse(names: tuple[str, ...]) -> str:
        return (
            f"a program runs: {', '.join(names)} can be changed when it has ended" if busy() else ""
        )

    return RunnerParameters(
        Parameters(node, ProgramSettings, refuse=refuse),
        Parameters(node, TransitionTimes, prefix=PREFIX, refuse=refuse),
        Parameters(node, LinkSettings, refuse=refuse),
    )
