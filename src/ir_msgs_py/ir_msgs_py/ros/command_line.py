"""The command line of a node's executable: --help helps, and words that nothing reads are named."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import rclpy
from rclpy._rclpy_pybind11 import RCLError, RCLInvalidROSArgsError, UnknownROSArgsError
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from ir_msgs_py.checks import one_line

_UNREADABLE = (RCLError, RCLInvalidROSArgsError, UnknownROSArgsError)
_HELP = """usage: {name} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r __ns:=/NAMESPACE]]

{about}

It runs until SIGINT or SIGTERM. Its parameters, with units and ranges, are in docs/parameters.md;
`ros2 param describe /{name} NAME` says the same while it runs. `ir up` starts all nodes of a cell.
"""  # noqa: E501


class CommandLineError(Exception):
    """Words that make no sense; the node is not started."""


def answer_before_start(name: str, words: Sequence[str], about: str) -> int | None:
    """Exit code where the words ask for help or are no words of a node, None where it shall
    start.
    """
    own = list(words[: words.index("--ros-args")] if "--ros-args" in words else words)
    if {"-h", "--help"} & set(own):
        sys.stdout.write(_HELP.format(name=name, about=about))
        return 0
    if own:
        sentence = (
            f"unknown argument {own[0][:100]!a}; parameters are given by --ros-args -p NAME:=VALUE"
        )
        sys.stderr.write(f"{name}: {sentence} ({name} --help)\n")
        return 2
    return None


def init_ros(words: Sequence[str] | None) -> None:
    """rclpy.init without its signal handlers; CommandLineError with one line for words that it
    can't read.
    """
    try:
        rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    except _UNREADABLE as error:
        raise _unreadable(error) from error


def own_words(program: str, words: Sequence[str]) -> list[str]:
    """The words that are not for ROS; CommandLineError for such that ROS can't read."""
    try:
        return remove_ros_args([program, *words])[1:]
    except _UNREADABLE as error:
        raise _unreadable(error) from error


def _unreadable(error: Exception) -> CommandLineError:
    """What the C library says, without its places in its own source."""
    if isinstance(error, UnknownROSArgsError):
        return CommandLineError(f"unknown arguments after --ros-args: {one_line(str(error), 300)}")
    what = str(error).partition(": ")[2].partition(", at /")[0].removesuffix(".")
    return CommandLineError(one_line(what or str(error), 300))
