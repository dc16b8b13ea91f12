"""The `ir` command: reads the command line and hands over."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from importlib import import_module

from ir_cli.errors import CommandError, unknown_name

COMMAND_MODULES = {
    "demo": "ir_cli.ros.demo",
    "up": "ir_cli.ros.up",
    "call": "ir_cli.ros.graph",
    "echo": "ir_cli.ros.graph",
    "list": "ir_cli.ros.graph",
    "send_goal": "ir_cli.ros.graph",
    "cancel": "ir_cli.ros.graph",
    "front": "ir_cli.ros.front",
    "live": "ir_cli.ros.live",
    "report": "ir_cli.reports",
    "fleet": "ir_cli.reports",
    "replan": "ir_cli.ros.replan",
    "plan": "ir_cli.plan",
    "move": "ir_cli.ask",
    "path": "ir_cli.ask",
    "ik": "ir_cli.ask",
    "check": "ir_cli.ask",
    "standby": "ir_cli.ask",
    "evaluate": "ir_cli.trace_commands",
    "optimize": "ir_cli.trace_commands",
    "energy": "ir_cli.energy",
    "krl": "ir_cli.krl",
    "arena": "ir_cli.studies",
    "study": "ir_cli.studies",
    "compare": "ir_cli.compare",
    "cell": "ir_cli.cells",
    "view": "ir_cli.view.command",
    "robot": "ir_cli.robots",
    "completion": "ir_cli.completion",
}
"""Only the module that is needed is imported: `ir cell check` does not wait for rclpy."""

HELP = {
    "demo": "plan, drive, record and explain a cell",
    "up": "start planner, driver, runner and recorder until Ctrl-C",
    "call": "call a service: call /ir_planner/get_cell '{}'",
    "echo": "print a topic's messages: echo /ir_sim_driver/power_state",
    "list": "list services, topics or actions with their types",
    "send_goal": "send a goal: send_goal /ir_planner/plan '{}'; Ctrl-C cancels",
    "cancel": "cancel all goals of an action: cancel /ir_planner/plan",
    "front": "energy over cycle time: front home infeed_pick park",
    "live": "watch the running cell in a browser, until Ctrl-C",
    "report": "write the HTML report of a recording, or compare several",
    "fleet": "recordings of many robots and shifts on one page, summed up",
    "replan": "plan a recording's requests again and compare the ids",
    "plan": "plan a cell's program: seconds, joules, clearance; needs no ROS",
    "move": "plan one movement from START to GOAL; needs no ROS",
    "path": "drive the tool along a path at a given speed; needs no ROS",
    "ik": "all configurations that reach a pose or a station; needs no ROS",
    "check": "whether a configuration is free, and its nearest pairs; needs no ROS",
    "standby": "the power mode of least energy for a pause; needs no ROS",
    "evaluate": "joules, limits and clearance of a trajectory in a file; needs no ROS",
    "optimize": "make the motion of a trace cheaper between its ends; needs no ROS",
    "energy": "compare measurements, fit power parameters, plan what identifies them; needs no ROS",
    "krl": "KUKA programs: what one costs in a cell, and planned ones as KRL",
    "arena": "planners against each other over cells, tasks and seeds; needs no ROS",
    "study": "where things should stand, statistics: many plans of one cell; needs no ROS",
    "compare": "today's program (KRL, a trace, or PTP at 100 %%) against the planner's",
    "cell": "begin and check cell files, list the bundled cells",
    "view": "look at a cell in a browser, move it about, plan it; needs no ROS",
    "robot": "check robot files, make one from a URDF, list the bundled ones",
    "completion": "completion for bash: source <(ir completion)",
}
"""What `ir --help` prints without importing any of the modules."""

WITHOUT_ROS = (
    "report",
    "fleet",
    "plan",
    "move",
    "path",
    "ik",
    "check",
    "standby",
    "evaluate",
    "optimize",
    "energy",
    "krl",
    "arena",
    "study",
    "compare",
    "cell",
    "view",
    "robot",
    "completion",
)
"""Commands that need no middleware, whatever its environment is."""

MISUSED = 2
"""Exit code for a command line that makes no sense, as argparse uses it."""

INTERRUPTED = 130
"""Exit code of a command that SIGINT ended, as shells use it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code, 1 with one sentence on stderr when it failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    chosen = next((word for word in words if not word.startswith("-")), "")
    if chosen and chosen not in COMMAND_MODULES:
        sys.stderr.write(
            f"ir: {unknown_name('command', chosen[:80], COMMAND_MODULES, 'ir --help')}\n"
        )
        return MISUSED
    parsed = _parser(chosen).parse_args(words)
    # a background job of a shell ignores SIGINT, and SIGTERM would leave child processes behind
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if chosen not in WITHOUT_ROS:
            from ir_cli.ros.domain import apply, ros_defaults

            apply(ros_defaults())
        code: int = parsed.run(parsed)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        return 0
    except _expected_errors() as error:
        sys.stderr.write(f"ir: {_sentence(error)}\n")
        return getattr(error, "exit_code", 1)
    return code


def _sentence(error: Exception) -> str:
    """What an error says; of the operating system with the file first, as all sentences have it."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{os.fsdecode(error.filename)} can't be used: {error.strerror}"
    return str(error)


def _parser(chosen: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="ir", description="Energy-aware planning for industrial robots."
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    if chosen in COMMAND_MODULES:
        import_module(COMMAND_MODULES[chosen]).add_commands(commands)
        return parser
    for command in COMMAND_MODULES:
        commands.add_parser(command, help=HELP[command])
    return parser


class _Version(argparse.Action):
    """Looks the version up only where somebody asks: that takes longer than all else."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        sys.stdout.write(f"ir {_version()}\n")
        parser.exit()


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("ir_cli")
    except PackageNotFoundError:
        return "unknown (not installed)"


def _expected_errors() -> tuple[type[Exception], ...]:
    """Errors that carry a sentence for people; anything else is a fault of ours and shows its
    trace.
    """
    from ir_msgs_py.errors import MsgsError
    from ir_recorder.errors import RecorderError
    from ir_studies.errors import StudyError
    from ir_values.errors import DescriptionError

    # OSError: a full disk, no permission, no descriptor left
    return (CommandError, DescriptionError, MsgsError, OSError, RecorderError, StudyError)


if __name__ == "__main__":
    sys.exit(main())
