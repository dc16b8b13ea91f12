"""Names of what a recording holds beside its messages, and of its further files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from ir_recorder.errors import RecorderError

# Names of what a recording holds beside its messages: attachments and the record of facts.

CELL: Final = "cell.yaml"
URDF: Final = "robot.urdf"
ROBOT: Final = "robot.yaml"  # data of the robot that the cell names
POWER: Final = "power.yaml"  # data of its controller
POWER_PARAMETERS: Final = "power_parameters.yaml"  # the file that the planner's parameter names
PARAMETERS: Final = "{node}.parameters.yaml"
FACTS: Final = "ir_recorder"  # metadata record
VERSION: Final = "version"
STARTED: Final = "started_ns"  # node clock at the start [ns]
# fact: versions of the project's packages and of those that decide numbers
PACKAGES: Final = "packages"
ARITHMETIC: Final = "arithmetic"  # fact: digest of numbers whose bits may differ elsewhere
RECORDING: Final = "recording"  # of a recording in several files: the same in all of them
PART: Final = "part"  # which of them, from 0
REPEATED: Final = "repeated"  # JSON: messages by topic that a part has again at its begin
LOST: Final = "ir_recorder_lost"  # metadata record of the next
MESSAGES_LOST: Final = "messages_lost"  # that never arrived at the recorder
PARTS: Final = "ir_recorder_part"  # metadata record of these three
# all others come from the recorder's parameter
OWN_FACTS: Final = (
    VERSION,
    STARTED,
    PACKAGES,
    ARITHMETIC,
    RECORDING,
    PART,
    REPEATED,
)

# facts with a meaning for the analysis; all others are only shown
SAFETY_DISTANCE: Final = "safety_distance"  # S_m [m] that movements are planned with: "0.02 m"
PLAN: Final = "plan"  # "never driven": a plan, found or not, without a robot
# full lengths of the pauses in power modes: "180 s, 1800 s"
UNSHORTENED_PAUSES: Final = "unshortened_pauses"
COMMON_SECONDS: Final = "common_program"  # what it takes where that is longer: "115.34 s"
# its largest mean power of a quarter of an hour, of a plan that nobody drove: "408.2 W"
COMMON_DEMAND: Final = "common_program_demand"
# how many power modes with a load it visits at machine home: "8"
MODES_AT_REST: Final = "modes_at_rest"
CYCLES: Final = "cycles"  # how many whole cycles the program of each robot is made of: "3"


def attached(namespace: str, name: str) -> str:
    """Name of an attachment of the cell in a namespace: "left/cell.yaml"; "cell.yaml" in none."""
    return f"{namespace}/{name}".strip("/")


# A recording in several files: when the next begins, its name, and what shows that they belong
# together.

LEAST_SIZE = 1_000_000  # bytes: four chunks
LEAST_DURATION = 1.0  # s: no file is shorter than what a kill may cost


@dataclass(frozen=True)
class Split:
    """size [bytes] and duration [s] of a file from which on the next begins; 0: there is none by
    it.
    """

    size: int = 0
    duration: float = 0.0

    def __post_init__(self) -> None:
        if self.size and self.size < LEAST_SIZE:
            raise RecorderError(
                f"split_size is {self.size} bytes: it must be 0 or at least {LEAST_SIZE:,}"
            )
        if not (self.duration == 0.0 or LEAST_DURATION <= self.duration < float("inf")):
            raise RecorderError(
                f"split_duration is {self.duration:g} s: it must be 0 or at least "
                f"{LEAST_DURATION:g}"
            )

    @property
    def wanted(self) -> bool:
        """Whether there are several files."""
        return bool(self.size or self.duration)

    def due(self, size: int, seconds: float) -> bool:
        """Whether a file of that size and duration is long enough."""
        return bool(
            (self.size and size >= self.size) or (self.duration and seconds >= self.duration)
        )


def part_path(first: Path, part: int) -> Path:
    """The file of a part: shift.mcap, shift_1.mcap, shift_2.mcap."""
    return first if part == 0 else first.with_name(f"{first.stem}_{part}{first.suffix}")


def is_further_part(path: Path, part: str) -> bool:
    """Whether a file with the fact `part` goes on what a first file beside it begins."""
    first = path.with_name(f"{path.stem.removesuffix(f'_{part}')}{path.suffix}")
    return part not in ("", "0") and first != path and first.exists()


def part_facts(recording: str, part: int, repeated: Mapping[str, int]) -> dict[str, str]:
    """The metadata record of a part; repeated: how many messages of a topic it has again at its
    begin.
    """
    return {
        RECORDING: recording,
        PART: str(part),
        REPEATED: json.dumps(dict(repeated)),
    }


def repeated_messages(text: str) -> dict[str, int]:
    """How many messages by topic a part has again; none where the text is damaged."""
    try:
        found = json.loads(text) if text else {}
    except (json.JSONDecodeError, RecursionError):
        return {}
    items = found.items() if isinstance(found, dict) else ()
    return {topic: count for topic, count in items if isinstance(count, int) and count > 0}
