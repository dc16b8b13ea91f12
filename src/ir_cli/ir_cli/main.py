"""The `ir` command: reads the command line and hands over."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence

from ir_cli.commands import (
    BY_PATH,
    COMMANDS,
    GROUPS,
    NAMES,
    OLD,
    first_page,
    group_page,
    renamed,
    with_cell,
    without_name,
)
from ir_cli.errors import CommandError, unknown_name

HELP = ("-h", "--help")
MISUSED = 2
"""Exit code for a command line that makes no sense, as argparse uses it."""

INTERRUPTED = 130
"""Exit code of a command that SIGINT ended, as shells use it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code, 1 with one sentence on stderr when it failed."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    path, count, notice = renamed(words)
    if not path:
        return _without_command(words)
    sys.stderr.write(notice)
    command = BY_PATH[path]
    parser = command.parser()
    parsed = parser.parse_args(with_cell(without_name(words, count), parser))
    # a background job of a shell ignores SIGINT, and SIGTERM would leave child processes behind
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        if command.ros:
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


def _without_command(words: Sequence[str]) -> int:
    """Help, the version, or what is wrong; the exit code."""
    first, *rest = words or [""]
    second = rest[0] if rest else ""
    if first in GROUPS and (not second or second in HELP):
        sys.stdout.write(group_page(first))
        return 0 if second else MISUSED
    if first in GROUPS:
        known = [each.path for each in COMMANDS if each.group == first]
        name = f"{first} {second}"[:80]
        sys.stderr.write(f"ir: {unknown_name('command', name, known, f'ir {first} --help')}\n")
        return MISUSED
    if first in HELP:
        sys.stdout.write(first_page())
        return 0
    if first == "--version":
        sys.stdout.write(f"ir {_version()}\n")
        return 0
    if not first:
        sys.stderr.write(first_page())
        return MISUSED
    known = [*NAMES, *OLD]
    sys.stderr.write(f"ir: {unknown_name('command', first[:80], known, 'ir --help')}\n")
    return MISUSED


def _sentence(error: Exception) -> str:
    """What an error says; of the operating system with the file first, as all sentences have it."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{os.fsdecode(error.filename)} can't be used: {error.strerror}"
    return str(error)


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
    from ir_recorder.errors import RecorderError
    from ir_studies.errors import StudyError
    from ir_values.errors import IrError

    # OSError: a full disk, no permission, no descriptor left
    return (CommandError, IrError, OSError, RecorderError, StudyError)


if __name__ == "__main__":
    sys.exit(main())
