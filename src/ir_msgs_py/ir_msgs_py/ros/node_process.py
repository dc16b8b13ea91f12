"""A node as a process: its command line, its signals, and spinning until it ends.

rclpy's own signal handlers end the context under the executor and the clean-up, which then fail
in many ways (ExternalShutdownException, RCLError, KeyboardInterrupt in any line). Here a signal
only ends the spinning, a second one finds nothing to cut short, and the node is cleaned up while
its context is still whole.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TypeVar

import rclpy
from rcl_interfaces.msg import Log
from rclpy.executors import (
    Executor,
    SingleThreadedExecutor,
)
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from ir_msgs_py.ros.network import LEASE, apply_network
from ir_msgs_py.ros.parameters import check_names, introspect_services
from ir_msgs_py.ros.rclpy_inside import UNREADABLE_ARGUMENTS, heed_times_only, survive_clients
from ir_msgs_py.ros.spinning import LOOK, Spinning
from ir_values.errors import InvalidValueError, one_line

N = TypeVar("N", bound=Node)
FAILURES_MAX = 50
FAILURES_WITHIN = 60.0
"""So many callbacks may fail within so many seconds: a node that fails more often does nothing
useful.
"""
_PULSE = 1.0  # s between two looks whether the process was suspended
_HELP = """usage: {name} [--ros-args [-p NAME:=VALUE ...] [--params-file FILE] [-r __ns:=/NAMESPACE]]

{about}

It runs until SIGINT or SIGTERM. Its parameters, with units and ranges, are in docs/parameters.md;
`ros2 param describe /{name} NAME` says the same while it runs. `ir ros up` starts all nodes of a cell.
"""  # noqa: E501


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
    """rclpy.init without its signal handlers; InvalidValueError with one line for words that it
    can't read.
    """
    try:
        rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
    except UNREADABLE_ARGUMENTS as error:
        raise _unreadable(error) from error


def own_words(program: str, words: Sequence[str]) -> list[str]:
    """The words that are not for ROS; InvalidValueError for such that ROS can't read."""
    try:
        return remove_ros_args([program, *words])[1:]
    except UNREADABLE_ARGUMENTS as error:
        raise _unreadable(error) from error


def _unreadable(error: Exception) -> InvalidValueError:
    """What the C library says, without its places in its own source."""
    if type(error).__name__ == "UnknownROSArgsError":
        return InvalidValueError(f"unknown arguments after --ros-args: {one_line(str(error), 300)}")
    what = str(error).partition(": ")[2].partition(", at /")[0].removesuffix(".")
    return InvalidValueError(one_line(what or str(error), 300))


def run_node(
    name: str,
    make: Callable[[], N],
    arguments: Sequence[str] | None = None,
    *,
    executor: Callable[[], Executor] = SingleThreadedExecutor,
    refusals: tuple[type[Exception], ...] = (),
    goes_on: Callable[[N], bool] | None = None,
    look: float = LOOK,
    about: str = "",
) -> int:
    """Make a node, spin it until a signal or until `look` [s] after goes_on(node) is False; the
    exit code.

    Each look holds the interpreter for about a millisecond. about: what the node does, for --help;
    "" where its own words were read before. refusals: what `make` or the clean-up raises for
    reasons that a sentence on stderr explains (exit code 1). Call it in the main thread, last of
    all: its signals stay taken.
    """
    words = sys.argv[1:] if arguments is None else arguments
    if about and (answer := answer_before_start(name, words, about)) is not None:
        return answer
    expected: tuple[type[Exception], ...] = (InvalidValueError, *refusals)
    spinning = Spinning()
    tell: list[Callable[[], object]] = []  # the others that the node is there

    def forgotten(seconds: float) -> None:
        get_logger(name).error(_forgotten(seconds))
        for each in tell:
            each()

    _on_signals(spinning.end, forgotten)
    try:
        apply_network()
        give_back_memory()
        init_ros(arguments)
        node = make()
        try:
            introspect_services(node)
            check_names(node, words)
            spins = executor()
            spins.add_node(node)
            tell.append(lambda: spins.create_task(lambda: _name_again(node)))
            spin(spinning, spins, node, None if goes_on is None else lambda: goes_on(node), look)
            spins.remove_node(node)
        finally:
            node.destroy_node()
    except expected as error:
        sys.stderr.write(f"{name}: {_printable(error)}\n")
        return 1
    finally:
        rclpy.try_shutdown()
    return 0


def _printable(error: Exception) -> str:
    """What it says, line by line."""
    return "\n".join(one_line(line) for line in str(error).splitlines())


def spin(
    spinning: Spinning,
    executor: Executor,
    node: Node,
    goes_on: Callable[[], bool] | None,
    look: float = LOOK,
) -> None:
    """Spin to the end; what a callback raises is logged, and ends the node only when it comes too
    often.
    """
    failures: deque[float] = deque(maxlen=FAILURES_MAX)
    heed_times_only(node)
    survive_clients(node)
    while True:
        try:
            return spinning.run(executor, goes_on, look)
        except Exception as error:  # one callback must not end the node for all others
            now = time.monotonic()
            if len(failures) == FAILURES_MAX and now - failures[0] < FAILURES_WITHIN:
                raise
            failures.append(now)
            node.get_logger().error(one_line(f"a callback failed: {error!r}"))


_M_MMAP_THRESHOLD = -3  # of mallopt
_LARGE = 2**18  # bytes


def give_back_memory() -> None:
    """Let what takes more than _LARGE bytes go back to the system when it is freed.

    Otherwise glibc raises that bound to 32 MiB with what a process frees, and keeps in each arena
    what lies below what is still used. Nothing where the C library is another one.
    """
    choose = getattr(ctypes.CDLL(None), "mallopt", None)
    if choose is not None:
        choose(_M_MMAP_THRESHOLD, _LARGE)


def _forgotten(seconds: float) -> str:
    """What to say of a process that was suspended for so many seconds."""
    return (
        f"this process was suspended for {seconds:.1f} s. The middleware forgets who is silent for "
        f"{LEASE:g} s: what was sent to this node meanwhile may be lost, and where nobody finds it "
        "or gets its answers, start it anew"
    )


def _name_again(node: Node) -> None:
    """Let the others hear the names of this participant's nodes: whoever forgot it has forgotten
    them, and hears them only when its endpoints change. Each node may publish /rosout.
    """
    node.destroy_publisher(node.create_publisher(Log, "/rosout", 1))


def _on_signals(act: Callable[[], None], forgotten: Callable[[float], None]) -> None:
    """Call `act` in a thread of its own at each SIGINT or SIGTERM, also while the main thread is in
    C, and `forgotten` with the seconds of a suspension that is longer than LEASE.
    """
    reading, writing = os.pipe()
    os.set_blocking(writing, False)

    def listen() -> None:
        looked = time.monotonic()
        while True:
            came, _, _ = select.select([reading], [], [], _PULSE)
            now = time.monotonic()
            if now - looked > LEASE:
                forgotten(now - looked)
            looked = now
            if came and not os.read(reading, 1):
                return
            if came:
                act()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _ignore)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    threading.Thread(target=listen, name="signals", daemon=True).start()


def _ignore(number: int, frame: object) -> None:
    """What Python does in the main thread when it comes to it: nothing more."""
