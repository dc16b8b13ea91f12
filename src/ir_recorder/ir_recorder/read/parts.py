"""A recording in several files read as one: what a further file repeats is left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ir_recorder.errors import ReadError
from ir_recorder.format import contents
from ir_recorder.format.parts import part_path, repeated_messages
from ir_recorder.read.raw_values import RawChannel, RawRecording

MOST_PARTS = 10_000


def with_further_parts(first: RawRecording, read: Callable[[Path], RawRecording]) -> RawRecording:
    """The recording with the further files beside its first one; any other file as it is.

    read: reads one file. A file that is missing or can't be read becomes a problem.
    """
    if first.fact(contents.PART) != "0":
        return first
    parts = [first]
    problems = list(first.problems)
    for number in range(1, MOST_PARTS):
        path = part_path(first.path, number)
        if not path.exists():
            if not part_path(first.path, number + 1).exists():
                break
            problems.append(f"{path.name} is missing: what it held is not read")
            continue
        try:
            part = read(path)
        except ReadError as error:
            problems.append(str(error))
            continue
        if part.fact(contents.RECORDING) == first.fact(contents.RECORDING):
            parts.append(_without_repeated(part))
            problems += [f"{path.name}: {problem}" for problem in part.problems]
    return replace(
        first,
        channels=_joined([channel for part in parts for channel in part.channels]),
        attachments=tuple(attachment for part in parts for attachment in part.attachments),
        facts=tuple(dict.fromkeys(fact for part in parts for fact in part.facts)),
        problems=tuple(problems),
    )


def _without_repeated(part: RawRecording) -> RawRecording:
    repeated = repeated_messages(part.fact(contents.REPEATED))
    channels = []
    for channel in part.channels:
        count = repeated.get(channel.topic, 0)
        channels.append(
            replace(channel, log_time=channel.log_time[count:], messages=channel.messages[count:])
        )
    return replace(part, channels=tuple(channels))


def _joined(channels: list[RawChannel]) -> tuple[RawChannel, ...]:
    """One channel for those of a topic and a type, in the order of the files."""
    groups: dict[tuple[str, str, str], list[RawChannel]] = {}
    for channel in channels:
        groups.setdefault((channel.topic, channel.type, channel.message_encoding), []).append(
            channel
        )
    return tuple(
        replace(
            group[0],
            log_time=np.concatenate([channel.log_time for channel in group]),
            messages=tuple(message for channel in group for message in channel.messages),
        )
        for group in groups.values()
    )
