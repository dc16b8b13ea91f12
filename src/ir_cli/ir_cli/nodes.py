"""The four nodes of a cell and the parameters they are started with."""

from __future__ import annotations

from collections.abc import Mapping

from .processes import NodeCommand


def cell_nodes(
    cell: str,
    *,
    planner: Mapping[str, object] | None = None,
    driver: Mapping[str, object] | None = None,
    runner: Mapping[str, object] | None = None,
    recorder: Mapping[str, object] | None = None,
) -> tuple[NodeCommand, ...]:
    """Commands for planner, driver, program runner and recorder of one cell (a name or a path)."""
    return (
        NodeCommand("ir_planner.node", {"cell": cell, **(planner or {})}),
        NodeCommand("ir_sim_driver.node", {"cell": cell, **(driver or {})}),
        NodeCommand("ir_program_runner.node", {"cell": cell, **(runner or {})}),
        NodeCommand("ir_recorder.node", {"cell": cell, **(recorder or {})}),
    )
