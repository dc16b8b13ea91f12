"""Whose a message is on the topics that all cells share: /diagnostics, /rosout and
/parameter_events.

Each names its sender by a text; the sender's namespace is part of it, so that two cells in one
graph are kept apart. Namespaces are absolute: "/" or "/cell_1".
"""

from __future__ import annotations

from ir_msgs_py import names

NODES = (names.PLANNER, names.SIM_DRIVER, names.PROGRAM_RUNNER, names.RECORDER)
"""The nodes of a cell."""


def diagnostic_name(namespace: str, name: str) -> str:
    """Name of a status: "ir_sim_driver: plant", in a namespace "cell_1/ir_sim_driver: plant"."""
    return f"{namespace}/{name}".strip("/")


def owns_diagnostic(namespace: str, name: str) -> bool:
    """Whether the status of this name comes from a node right in the namespace."""
    return _parent(f"/{name.partition(':')[0]}") == _bare(namespace)


def owns_node(namespace: str, fully_qualified: str) -> bool:
    """Whether a node ("/cell_1/ir_planner") is right in the namespace."""
    return _parent(fully_qualified) == _bare(namespace)


def owns_logger(namespace: str, logger: str) -> bool:
    """Whether a logger ("cell_1.ir_planner") belongs to a node right in the namespace.

    A dot also parts a logger from those below it ("ir_planner.action"): those of a cell's nodes are
    known.
    """
    prefix = "".join(f"{part}." for part in _bare(namespace).split("/") if part)
    if not logger.startswith(prefix):
        return False
    node, dot, _ = logger.removeprefix(prefix).partition(".")
    return not dot or node in NODES


def _bare(namespace: str) -> str:
    return namespace.rstrip("/")


def _parent(name: str) -> str:
    return name.rpartition("/")[0]
