"""Senders on shared topics are kept apart by their namespace, nested ones included."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.names import NODES, diagnostic_name, owns_diagnostic, owns_logger, owns_node

NAMESPACES = st.lists(st.from_regex(r"[a-z][a-z0-9_]{0,5}", fullmatch=True), max_size=3).map(
    lambda parts: "/" + "/".join(parts)
)
NODE_NAMES = st.sampled_from(NODES) | st.from_regex(r"[a-z][a-z0-9_]{0,8}", fullmatch=True)


@given(NAMESPACES, NODE_NAMES, NAMESPACES)
def test_a_node_owns_what_it_says_and_nobody_else_does(
    namespace: str, node: str, other: str
) -> None:
    status = diagnostic_name(namespace, f"{node}: plant 1/2")
    full = re.sub("^/+", "/", f"{namespace}/{node}")
    logger = full.strip("/").replace("/", ".")
    assert owns_diagnostic(namespace, status)
    assert owns_node(namespace, full)
    assert owns_logger(namespace, logger)
    if other != namespace:
        assert not owns_diagnostic(other, status)
        assert not owns_node(other, full)
        assert not owns_logger(other, logger) or other_could_be_meant(other, logger)


def other_could_be_meant(other: str, logger: str) -> bool:
    """A dot parts namespaces and loggers alike: "ir_planner.x" is a logger of the planner, or a
    node's.
    """
    rest = logger.removeprefix("".join(f"{part}." for part in other.split("/") if part))
    return rest.partition(".")[0] in NODES


@pytest.mark.parametrize(
    ("namespace", "logger", "owned"),
    [
        ("/", "ir_planner", True),
        ("/", "ir_planner.action_server", True),
        ("/", "cell_1.ir_planner", False),
        ("/cell_1", "cell_1.ir_planner", True),
        ("/cell_1", "cell_1.ir_planner.rcl", True),
        ("/cell_1", "cell_10.ir_planner", False),
        ("/cell_1", "ir_planner", False),
        ("/cell", "cell.left.ir_planner", False),
    ],
)
def test_loggers(namespace: str, logger: str, owned: bool) -> None:
    assert owns_logger(namespace, logger) is owned


def test_the_root_namespace_leaves_names_as_they_are() -> None:
    assert diagnostic_name("/", "ir_sim_driver: plant") == "ir_sim_driver: plant"
    assert diagnostic_name("/cell_1", "ir_sim_driver: plant") == "cell_1/ir_sim_driver: plant"
