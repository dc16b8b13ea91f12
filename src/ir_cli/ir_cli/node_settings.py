"""The settings classes of the nodes, each with the prefix of its parameters' names."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ir_msgs_py.modes import PREFIX, TransitionTimes
from ir_msgs_py.settings import Setting, tree
from ir_planner import PlannerSettings
from ir_program_runner import LinkSettings, ProgramSettings
from ir_recorder.recording.settings import RecorderSettings
from ir_sim_driver import (
    LINKS,
    ControllerSettings,
    ControlSettings,
    ExecutionSettings,
    IdleTimes,
    LoadCheckSettings,
    PlcSettings,
)
from ir_sim_driver.controller import SupervisionSettings
from ir_sim_driver.node.parameters import NodeSettings
from ir_studies.settings import StudiesSettings

FIXED = "fixed: "  # the node takes these at its start only
NODES: dict[str, tuple[tuple[str, Callable[[], Any]], ...]] = {
    "ir_planner": (("", PlannerSettings),),
    "ir_sim_driver": (
        ("", NodeSettings),
        ("", ControllerSettings),
        *(("", link) for link in LINKS),
        ("control.", ControlSettings),
        ("execution.", ExecutionSettings),
        ("supervision.", SupervisionSettings),
        (f"{FIXED}{PREFIX}", TransitionTimes),
        (PREFIX, IdleTimes),
        ("plc.", PlcSettings),
        ("load_check.", LoadCheckSettings),
    ),
    "ir_program_runner": (("", ProgramSettings), (PREFIX, TransitionTimes), ("", LinkSettings)),
    "ir_recorder": (("", RecorderSettings),),
    "ir_studies": (("", StudiesSettings),),
}


def parameters_of(node: str) -> dict[str, Setting]:
    """Every parameter of a node by its full name."""
    return {
        f"{prefix.removeprefix(FIXED)}{name}": each
        for prefix, make in NODES[node]
        for name, each in tree(make()).items()
    }
