"""A name is waited for while it may still come, and no longer."""

from __future__ import annotations

import pytest

from ir_cli.errors import CommandError
from ir_cli.lookup import checked_type, type_of


def test_a_name_that_comes_late_is_found() -> None:
    graphs = iter([{}, {"/a": "x/srv/A"}, {"/a": "x/srv/A", "/b": "x/srv/B"}])
    assert type_of(lambda: next(graphs), "/b", "service") == "x/srv/B"


def test_an_empty_graph_hints_at_the_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    with pytest.raises(CommandError, match="do the nodes run, and in this domain\\? ROS_DOMAIN_ID is 42"):
        type_of(dict, "/a", "service", seconds=0.05)


@pytest.mark.parametrize("typed", ["", "ir_msgs/srv/SetLoad", "ir_msgs/SetLoad"])
def test_the_type_may_be_left_out_or_short(typed: str) -> None:
    assert checked_type(typed, "ir_msgs/srv/SetLoad", "/a", "service") == "ir_msgs/srv/SetLoad"


def test_another_type_is_named() -> None:
    with pytest.raises(CommandError, match="has the type ir_msgs/srv/SetLoad, not ir_msgs/srv/GetCell"):
        checked_type("ir_msgs/srv/GetCell", "ir_msgs/srv/SetLoad", "/a", "service")
