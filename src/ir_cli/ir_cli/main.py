"""The `ir` command: reads the command line and hands over."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

from .environment import apply, ros_defaults
from .errors import CommandError
from .suggestions import unknown_name

COMMAND_MODULES = {
    "demo": "ir_cli.demo.command",
    "up": "ir_cli.up_command",
    "call": "ir_cli.graph_commands",
    "echo": "ir_cli.graph_commands",
    "list": "ir_cli.graph_commands",
    "send_goal": "ir_cli.action_commands",
    "cancel": "ir_cli.action_commands",
    "front": "ir_cli.front_command",
    "cell": "ir_cli.cell_commands",
    "report": "ir_cli.report_command",
}
"""Only the module that is needed is imported: `ir cell check` does not wait for rclpy."""

WITHOUT_ROS = ("cell", "report")
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
        sys.stderr.write(f"ir: {unknown_name('command', chosen[:80], COMMAND_MODULES, 'ir --help')}\n")
        return MISUSED
    parsed = _parser(chosen).parse_args(words)
    # a background job of a shell ignores SIGINT, and SIGTERM would leave child processes behind
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if chosen not in WITHOUT_ROS:
            apply(ros_defaults())
        code: int = parsed.run(parsed)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        return 0
    except _expected_errors() as error:
        sys.stderr.write(f"ir: {error}\n")
        return 1
    return code


def _parser(chosen: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="ir", description="Energy-aware planning for industrial robots.")
    parser.add_argument("--version", action="version", version=f"ir {_version()}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    wanted = [chosen] if chosen in COMMAND_MODULES else list(COMMAND_MODULES)
    for module in dict.fromkeys(COMMAND_MODULES[command] for command in wanted):
        import_module(module).add_commands(commands)
    return parser


def _version() -> str:
    try:
        return version("ir_cli")
    except PackageNotFoundError:
        return "unknown (not installed)"


def _expected_errors() -> tuple[type[Exception], ...]:
    """Errors that carry a sentence for people; anything else is a fault of ours and shows its trace."""
    from ir_description.errors import DescriptionError
    from ir_msgs_py.errors import MsgsError
    from ir_recorder.errors import RecorderError

    # OSError: a full disk, no permission, no descriptor left
    return (CommandError, DescriptionError, MsgsError, OSError, RecorderError)


if __name__ == "__main__":
    sys.exit(main())
