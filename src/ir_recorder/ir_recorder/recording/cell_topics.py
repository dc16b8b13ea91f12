"""Which topics belong to the cell.

By default the shared ones and everything under the project's nodes, in the recorder's own
namespace. Hidden topics (a name part that starts with "_") stay out, but for the status of actions:
the feedback's types can't be read back without ROS.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

from ir_msgs_py import names
from ir_msgs_py.names import NODES
from ir_recorder.errors import RecorderError

# in the cell's namespace
SHARED = (
    names.JOINT_STATES,
    names.ROBOT_DESCRIPTION,
    names.TF,
    names.TF_STATIC,
)
GLOBAL = (names.DIAGNOSTICS, names.ROSOUT, names.PARAMETER_EVENTS)
MOST_TOPICS = 1000
LONGEST_TOPIC = 255  # characters, as DDS has it
ACTION_STATUS = "/_action/status"
_FEEDBACK = "_FeedbackMessage"


def checked_topics(topics: Iterable[str]) -> tuple[str, ...]:
    """Names and patterns of a request without the empty ones; RecorderError where they are no
    names.
    """
    wanted = tuple(topic for topic in topics if topic)
    if len(wanted) > MOST_TOPICS:
        raise RecorderError(
            f"{len(wanted)} names or patterns of topics: at most {MOST_TOPICS} are taken"
        )
    for topic in wanted:
        if len(topic) > LONGEST_TOPIC or not topic.isprintable():
            raise RecorderError(
                f"topic {topic[:60]!a}: at most {LONGEST_TOPIC} characters, without control "
                "characters"
            )
    return wanted


@dataclass(frozen=True)
class TopicSelection:
    """Decides for each topic of the graph whether it is recorded.

    `wanted`: names or patterns ("/ir_planner/*"; "*" is every visible topic); empty: the topics of
    the cell below `namespace` ("/" or "/cell_1").
    """

    wanted: tuple[str, ...] = ()
    namespace: str = "/"

    def __contains__(self, topic: str) -> bool:
        if _is_hidden(topic) and not topic.endswith(ACTION_STATUS):
            return False
        if self.wanted:
            return any(fnmatchcase(topic, self._absolute(pattern)) for pattern in self.wanted)
        if topic in GLOBAL:
            return True
        prefix = self.namespace.rstrip("/") + "/"
        if not topic.startswith(prefix):
            return False
        name = topic[len(prefix) :]
        return name in SHARED or name.split("/", 1)[0] in NODES

    def unmet(self, topics: Iterable[str]) -> tuple[str, ...]:
        """The wanted names and patterns, as absolute ones, that none of `topics` meets."""
        present = tuple(topics)
        patterns = (self._absolute(pattern) for pattern in self.wanted)
        return tuple(p for p in patterns if not any(fnmatchcase(topic, p) for topic in present))

    def _absolute(self, pattern: str) -> str:
        if pattern.startswith(("/", "*")):
            return pattern
        return f"{self.namespace.rstrip('/')}/{pattern}"


def single_type(topic: str, types: Sequence[str]) -> str | None:
    """The type of a topic, or None where recordings can't take it: several types, or one derived
    from an action.
    """
    if len(types) != 1 or types[0].endswith(_FEEDBACK):
        return None
    return types[0]


def _is_hidden(topic: str) -> bool:
    return any(part.startswith("_") for part in topic.split("/"))
