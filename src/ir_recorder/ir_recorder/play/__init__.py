"""Playback of recordings into the ROS graph: what is due when, and the node that publishes it."""

from ir_recorder.play.player import Player
from ir_recorder.play.playhead import Playhead, PlayState
from ir_recorder.play.schedule import DueMessage, PlaySettings, schedule

__all__ = ["DueMessage", "PlaySettings", "PlayState", "Player", "Playhead", "schedule"]
