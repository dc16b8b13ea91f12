"""Subscriptions to many topics at once, and which topics these are."""

from ir_recorder.listen.topics import TopicSelection, single_type

__all__ = ["TopicSelection", "single_type"]
