"""`ir-play`: publishes a recording's messages again, byte by byte, with their timing.

The qualities of service are those that were offered; what was latched is latched again. Topics that
command a robot or a machine are left out unless asked for by their full name, and then not beside a
driver. A topic that a running node of a cell takes in or publishes is left out while it is there:
which ones these are, the graph says.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import time
import traceback
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from ir_msgs.srv import ControlPlayback
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.messages import interface_type
from ir_msgs_py.ros.node_process import own_words, run_node
from ir_msgs_py.ros.serving import BoundedService, answered
from ir_msgs_py.status import Status, StatusCode
from ir_recorder.arguments import play_parser, roots_of
from ir_recorder.errors import RecorderError, SchemaError
from ir_recorder.format.qos import offers_from_yaml
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.play.playback import (
    DueMessage,
    Player,
    Playhead,
    PlaySettings,
    checked_delay,
    is_command,
)
from ir_recorder.reading.mcap_file import RawChannel, RawRecording, read_raw
from ir_values.errors import IrError, UnknownTypeError

# Keys of a terminal that control playback: space pauses, arrows seek and change the rate.

HELP = (
    "space: pause; left, right: 5 s back and on; up, down: twice and half the rate; 0: from "
    "the start"
)
_STEP = 5.0  # s of the recording
_PATIENCE = 0.1  # s between two looks whether playback has ended
_SLOWEST = 0.001
_FASTEST = 1000.0


def press(key: bytes, head: Playhead) -> None:
    """What a key does; keys without a meaning do nothing."""
    state = head.state
    if key == b" ":
        head.control(not state.paused)
    elif key == b"0":
        head.control(state.paused, seek=0.0)
    elif key in (b"\x1b[C", b"\x1b[D"):
        step = _STEP if key == b"\x1b[C" else -_STEP
        head.control(state.paused, seek=min(max(state.position + step, 0.0), state.duration))
    elif key in (b"\x1b[A", b"\x1b[B"):
        rate = state.rate * (2.0 if key == b"\x1b[A" else 0.5)
        head.control(state.paused, rate=min(max(rate, _SLOWEST), _FASTEST))


@contextmanager
def keys_of_terminal(pressed: Callable[[bytes], None]) -> Iterator[bool]:
    """Hand on keys while the block runs; whether there is a terminal. It is left as it was."""
    if not sys.stdin.isatty():
        yield False
        return
    terminal = sys.stdin.fileno()
    ended = threading.Event()
    before = termios.tcgetattr(terminal)

    def read() -> None:
        while not ended.is_set():
            if select.select([terminal], [], [], _PATIENCE)[0]:
                pressed(os.read(terminal, 8))

    tty.setcbreak(terminal)
    thread = threading.Thread(target=read, name="keys", daemon=True)
    thread.start()
    try:
        yield True
    finally:
        ended.set()
        thread.join()
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


LOOK_PERIOD = 0.1  # s between two looks for a driver: less than discovery takes
LEAST_DELAY = 0.5  # s from the publishers to the first message, in which running nodes are found
_CLOCK = "/clock"
_CLOCK_NS = 2**31 * 1_000_000_000  # seconds of a message have 32 bits
DEPTH = 1000  # messages per topic: 2 s of joint states while a subscriber is busy


class PlayNode(Node):
    """Publishers for all topics of a recording, and a thread that feeds them."""

    def __init__(
        self,
        recording: RawRecording,
        settings: PlaySettings,
        clock: bool = False,
        delay: float = 0.5,
        **options: Any,
    ) -> None:
        super().__init__(names.PLAY, **options)
        self._settings = settings
        self._stop = threading.Event()
        self._wake = threading.Event()
        self._latched: set[str] = set()
        self._feeds: dict[str, Publisher] = {}
        self._ticks = self.create_publisher(Clock, _CLOCK, 10) if clock else None
        self._delay = delay
        self.published = 0
        self._schemas = SchemaLibrary()
        self._commands: list[str] = []
        self._left_out: set[str] = set()
        self._next_look = 0.0
        self.failure = ""
        self._messages: list[tuple[int, str, bytes]] = []
        for channel in recording.channels:
            self._add(channel)
        times = [message[0] for message in self._messages]
        duration = (max(times) - min(times)) * 1e-9 if times else 0.0
        self.head = Playhead(time.monotonic, duration, settings.rate)
        self._check_clock(max(times, default=0))
        self._thread = threading.Thread(target=self._play, name="ir_play", daemon=True)
        BoundedService(self, ControlPlayback, own(names.CONTROL_PLAYBACK), self._on_control)

    def _check_clock(self, last_ns: int) -> None:
        if self._ticks is not None and last_ns >= _CLOCK_NS:
            raise RecorderError(
                f"the recording ends {last_ns * 1e-9:.6g} s after 1970, which /clock can't say: "
                f"at most {_CLOCK_NS * 1e-9:.10g} s; play it without --clock"
            )

    def start(self) -> None:
        """Begins to play, after `delay` seconds in which subscribers find the publishers; at least
        LEAST_DELAY.
        """
        self._thread.start()

    def stop(self) -> None:
        """Ends playback before the next message."""
        self._stop.set()
        self._wake.set()
        if self._thread.is_alive():
            self._thread.join()

    def destroy_node(self) -> None:
        """Stop playing, then end the node."""
        self.stop()
        super().destroy_node()

    @property
    def playing(self) -> bool:
        """Whether messages are still to come."""
        return self._thread.is_alive()

    def press(self, key: bytes) -> None:
        """A key of the terminal."""
        press(key, self.head)
        self._wake.set()

    def _on_control(self, request: Any, response: Any) -> Any:
        def control() -> Status:
            self.head.control(request.pause, request.rate, request.seek)
            self._wake.set()
            state = self.head.state
            response.paused = state.paused
            response.rate = state.rate
            response.position = state.position
            response.duration = state.duration
            return Status.success()

        return answered(response, self.get_name(), control, _known, self.get_logger().error)

    def _wait(self, seconds: float) -> bool:
        """Wait, no longer than until somebody controls playback; whether it shall end."""
        self._wake.wait(seconds)
        self._wake.clear()
        return self._stop.is_set()

    def _add(self, channel: RawChannel) -> None:
        """Opens a channel's topic and takes its messages, where it can and may be played."""
        if channel.message_encoding != "cdr" or not channel.messages:
            return
        if not self._settings.plays(channel.topic, channel.type):
            if is_command(channel.topic, channel.type):
                self.get_logger().info(
                    f"{channel.topic[:200]} is a command: it is played only by its name"
                )
            return
        self._open(channel.topic, channel.type, channel.qos)
        if channel.topic in self._feeds:
            times = channel.log_time.tolist()
            self._messages += zip(
                times, [channel.topic] * len(times), channel.messages, strict=True
            )

    def _open(self, topic: str, type_name: str, qos: str) -> None:
        """A publisher as the topic was offered when recorded, if its type is installed."""
        if topic in self._feeds:
            return
        try:
            # an installed type: a name from a file imports nothing else
            self._schemas.schema(type_name)
            message_type = interface_type(type_name, "msg")
        except (SchemaError, UnknownTypeError):
            self.get_logger().warning(
                f"{topic[:200]} isn't played: type {type_name[:200]} isn't installed"
            )
            return
        offers = offers_from_yaml(qos)
        reliable = all(offer.reliable for offer in offers)
        latched = bool(offers) and all(offer.transient_local for offer in offers)
        profile = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        try:
            self._feeds[topic] = self.create_publisher(message_type, topic, profile)
        except (InvalidTopicNameException, ValueError) as error:
            self.get_logger().warning(f"{topic[:200]!r} isn't played: {error}")
            return
        if latched:
            self._latched.add(topic)
        if is_command(topic, type_name):
            self._commands.append(topic)

    def _play(self) -> None:
        if self._stop.wait(max(self._delay, LEAST_DELAY)) or self._is_refused():
            return
        tick = self._tick if self._ticks is not None else None
        player = Player(
            time.monotonic, self._wait, self._publish, tick, head=self.head, latched=self._latched
        )
        try:
            player.play(self._messages, self._settings)
        except Exception as error:  # whatever it was, not all was played
            self.get_logger().error(traceback.format_exc())
            self.failure = f"playback failed: {error!r}"

    def _is_refused(self) -> bool:
        """Whether playback ends, because a driver would follow its commands or nothing is left to
        play; looks at the graph every LOOK_PERIOD.
        """
        now = time.monotonic()
        if now >= self._next_look:
            self._next_look = now + LOOK_PERIOD
            self._look(self.get_node_names())
        return bool(self.failure)

    def _look(self, nodes: Sequence[str]) -> None:
        followers = {
            end.node_name
            for topic in self._commands
            for end in self.get_subscriptions_info_by_topic(topic)
        }
        if self._commands:
            followers |= {name for name in nodes if name == names.SIM_DRIVER}
        if followers:
            who = ", ".join(sorted(followers))
            what = ", ".join(self._commands)
            self._end(f"{what} would command {who}: a recording is not played to a live robot")
            return
        if any(map(names.acts, nodes)):
            self._leave_out()

    def _leave_out(self) -> None:
        """Play no topic any more that a running node of a cell takes in or publishes."""
        clock = [_CLOCK] if self._ticks is not None else []
        topics = [*self._feeds, *clock]
        live = {topic: self._live(topic) for topic in topics if topic not in self._left_out}
        found = {topic: who for topic, who in live.items() if who}
        if not found:
            return
        who = ", ".join(sorted(set().union(*found.values())))
        self.get_logger().warning(
            f"{', '.join(sorted(found))[:2000]}: not played beside {who}, which takes it in or "
            "publishes it; end that node, or play in another ROS_DOMAIN_ID"
        )
        self._left_out |= found.keys()
        if self._left_out.issuperset(topics):
            self._end(f"nothing is left to play beside {who}")

    def _live(self, topic: str) -> set[str]:
        """Running nodes of a cell that take the topic in or publish it."""
        ends = [
            *self.get_subscriptions_info_by_topic(topic),
            *self.get_publishers_info_by_topic(topic),
        ]
        return {end.node_name for end in ends if names.acts(end.node_name)}

    def _end(self, failure: str) -> None:
        self.failure = failure
        self._stop.set()

    def _publish(self, message: DueMessage) -> None:
        if self._is_refused() or message.topic in self._left_out:
            return
        self._feeds[message.topic].publish(message.data)
        self.published += 1

    def _tick(self, recorded_ns: int) -> None:
        if self._ticks is None or self._is_refused() or _CLOCK in self._left_out:
            return
        clock = Clock()
        clock.clock.sec, clock.clock.nanosec = divmod(recorded_ns, 1_000_000_000)
        self._ticks.publish(clock)


def _known(error: Exception) -> Status | None:
    return Status(StatusCode.FAILURE, str(error)) if isinstance(error, RecorderError) else None


def main(arguments: Sequence[str] | None = None) -> int:
    """`ir-play FILE [--rate R] [--loop] [--topics ...] [--clock]`."""
    everything = sys.argv[1:] if arguments is None else list(arguments)
    try:
        options = play_parser().parse_args(own_words("ir-play", everything))
        settings = PlaySettings(options.rate, options.loop, tuple(options.topics))
        delay = checked_delay(options.delay)
        recording = read_raw(options.file, roots_of(options.roots))
    except (RecorderError, IrError) as error:
        sys.stderr.write(f"ir-play: {error}\n")
        return 1
    for problem in recording.problems:
        sys.stderr.write(f"ir-play: {problem}\n")

    players: list[PlayNode] = []

    def start() -> PlayNode:
        node = PlayNode(recording, settings, options.clock, delay)
        players.append(node)
        node.start()
        return node

    def pressed(key: bytes) -> None:
        for player in players:
            player.press(key)

    with keys_of_terminal(pressed) as terminal:
        if terminal:
            sys.stderr.write(f"{HELP}\n")
        code = run_node(
            "ir-play",
            start,
            everything,
            goes_on=lambda node: node.playing,
            refusals=(RecorderError,),
        )
    for player in players:
        if player.failure:
            sys.stderr.write(f"ir-play: {player.failure}\n")
            return 1
    return code


if __name__ == "__main__":
    sys.exit(main())
