"""`ir-play`: publishes a recording's messages again, byte by byte, with their timing.

The qualities of service are those that were offered; what was latched is latched again.
"""

from __future__ import annotations

import argparse
import sys
import threading
import time
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock

from ir_msgs_py.ros.running import run_node
from ir_recorder.errors import RecorderError
from ir_recorder.format.qos import offers_from_yaml
from ir_recorder.play.player import Player
from ir_recorder.play.schedule import DueMessage, PlaySettings
from ir_recorder.read.raw import RawRecording, read_raw

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
        super().__init__("ir_play", **options)
        self._settings = settings
        self._stop = threading.Event()
        self._feeds: dict[str, Publisher] = {}
        self._clock = self.create_publisher(Clock, "/clock", 10) if clock else None
        self._delay = delay
        self.published = 0
        self._messages: list[tuple[int, str, bytes]] = []
        for channel in recording.channels:
            if channel.message_encoding == "cdr" and channel.messages and settings.plays(channel.topic):
                self._open(channel.topic, channel.type, channel.qos)
            if channel.topic in self._feeds:
                times = channel.log_time.tolist()
                self._messages += zip(times, [channel.topic] * len(times), channel.messages, strict=True)
        self._thread = threading.Thread(target=self._play, name="ir_play", daemon=True)

    def start(self) -> None:
        """Begins to play, after `delay` seconds in which subscribers find the publishers."""
        self._thread.start()

    def stop(self) -> None:
        """Ends playback before the next message."""
        self._stop.set()
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

    def _open(self, topic: str, type_name: str, qos: str) -> None:
        if topic in self._feeds:
            return
        try:
            package, kind, own = type_name.split("/")
            message_type = getattr(import_module(f"{package}.{kind}"), own)
        except (ValueError, ImportError, AttributeError):
            self.get_logger().warning(f"{topic} isn't played: type {type_name[:200]} isn't installed")
            return
        offers = offers_from_yaml(qos)
        reliable = all(offer.reliable for offer in offers)
        latched = bool(offers) and all(offer.transient_local for offer in offers)
        profile = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        self._feeds[topic] = self.create_publisher(message_type, topic, profile)

    def _play(self) -> None:
        if self._stop.wait(self._delay):
            return
        tick = self._tick if self._clock is not None else None
        player = Player(time.monotonic, self._stop.wait, self._publish, tick)
        self.published = player.play(self._messages, self._settings)

    def _publish(self, message: DueMessage) -> None:
        self._feeds[message.topic].publish(message.data)

    def _tick(self, recorded_ns: int) -> None:
        if self._clock is not None:
            clock = Clock()
            clock.clock.sec, clock.clock.nanosec = divmod(recorded_ns, 1_000_000_000)
            self._clock.publish(clock)


def main(arguments: Sequence[str] | None = None) -> int:
    """`ir-play FILE [--rate R] [--loop] [--topics ...] [--clock]`."""
    everything = sys.argv[1:] if arguments is None else list(arguments)
    parser = argparse.ArgumentParser(prog="ir-play", description="Publishes a recording's messages again.")
    parser.add_argument("file")
    parser.add_argument("--rate", type=float, default=1.0, help="2 plays twice as fast")
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    parser.add_argument("--topics", nargs="+", default=[], help="names or patterns; none: all visible topics")
    parser.add_argument("--clock", action="store_true", help="publish recorded time on /clock")
    parser.add_argument("--delay", type=float, default=0.5, help="s before the first message")
    options = parser.parse_args(remove_ros_args(["ir-play", *everything])[1:])
    try:
        settings = PlaySettings(options.rate, options.loop, tuple(options.topics))
        recording = read_raw(options.file)
    except RecorderError as error:
        sys.stderr.write(f"ir-play: {error}\n")
        return 1
    for problem in recording.problems:
        sys.stderr.write(f"ir-play: {problem}\n")

    def start() -> PlayNode:
        node = PlayNode(recording, settings, options.clock, options.delay)
        node.start()
        return node

    return run_node("ir-play", start, everything, goes_on=lambda node: node.playing)


if __name__ == "__main__":
    sys.exit(main())
