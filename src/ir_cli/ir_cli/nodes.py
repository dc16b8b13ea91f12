"""The four nodes of a cell and the parameters they are started with."""

from __future__ import annotations

from collections.abc import Mapping

from .processes import NodeCommand


def cell_nodes(
    cell: str,
    *,
    namespace: str = "",
    planner: Mapping[str, object] | None = None,
    driver: Mapping[str, object] | None = None,
    runner: Mapping[str, object] | None = None,
    recorder: Mapping[str, object] | None = None,
) -> tuple[NodeCommand, ...]:
    """Commands for planner, driver, program runner and recorder of one cell (a name or a path)."""
    nodes = {
        "ir_planner": planner,
        "ir_sim_driver": driver,
        "ir_program_runner": runner,
        "ir_recorder": recorder,
    }
    return tuple(
        NodeCommand(f"{name}.node", {"cell": cell, **(parameters or {})}, namespace)
        for name, parameters in nodes.items()
    )
