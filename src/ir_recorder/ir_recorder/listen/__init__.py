"""Subscriptions to many topics at once, and which topics these are."""

from ir_recorder.listen.topics import TopicSelection, checked_topics, single_type

__all__ = ["TopicSelection", "checked_topics", "single_type"]
