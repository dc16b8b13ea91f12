"""Playback of recordings into the ROS graph: what is due when, and the node that publishes it."""

from ir_recorder.play.playback import (
    DueMessage,
    Player,
    Playhead,
    PlaySettings,
    PlayState,
    schedule,
)

__all__ = ["DueMessage", "PlaySettings", "PlayState", "Player", "Playhead", "schedule"]
