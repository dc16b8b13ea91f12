"""The `ir` command: reads the command line and hands over."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence
from importlib import import_module

from .environment import apply, ros_defaults
from .errors import CommandError

COMMAND_MODULES = {
    "demo": "ir_cli.demo.command",
    "up": "ir_cli.up_command",
    "call": "ir_cli.graph_commands",
    "echo": "ir_cli.graph_commands",
    "list": "ir_cli.graph_commands",
    "cell": "ir_cli.cell_commands",
    "report": "ir_cli.report_command",
}
"""Only the module that is needed is imported: `ir cell check` does not wait for rclpy."""

INTERRUPTED = 130
"""Exit code of a command that SIGINT ended, as shells use it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code, 1 with one sentence on stderr when it failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    apply(ros_defaults())
    chosen = next((word for word in words if not word.startswith("-")), "")
    parser = _parser(chosen)
    parsed = parser.parse_args(words)
    # a background job of a shell ignores SIGINT, and SIGTERM would leave child processes behind
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code: int = parsed.run(parsed)
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
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    wanted = [chosen] if chosen in COMMAND_MODULES else list(COMMAND_MODULES)
    for module in dict.fromkeys(COMMAND_MODULES[command] for command in wanted):
        import_module(module).add_commands(commands)
    return parser


def _expected_errors() -> tuple[type[Exception], ...]:
    """Errors that carry a sentence for people; anything else is a fault of ours and shows its trace."""
    from ir_description.errors import DescriptionError
    from ir_msgs_py.errors import MsgsError
    from ir_recorder.errors import RecorderError

    return (CommandError, DescriptionError, MsgsError, RecorderError)


if __name__ == "__main__":
    sys.exit(main())
