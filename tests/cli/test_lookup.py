"""A name is waited for while it may still come, and no longer."""

from __future__ import annotations

import os
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from ir_cli.errors import CommandError
from ir_cli.ros import graph as lookup
from ir_cli.ros.domain import claim
from ir_cli.ros.graph import (
    DISCOVERY_SECONDS,
    SETTLED_SECONDS,
    START_SECONDS,
    checked_type,
    settled,
    type_of,
)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[], float]:
    """The time that `lookup` sees [s]: it passes while it sleeps."""
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(lookup, "time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep))
    return lambda: now[0]


def test_a_name_that_comes_late_is_found() -> None:
    graphs = iter([{}, {"/a": "x/srv/A"}, {"/a": "x/srv/A", "/b": "x/srv/B"}])
    assert type_of(lambda: next(graphs), "/b", "service") == "x/srv/B"


def test_a_typo_is_answered_when_the_graph_has_settled(clock: Callable[[], float]) -> None:
    with pytest.raises(CommandError, match=r"did you mean /machine\?"):
        type_of(lambda: {"/machine": "x/srv/A"}, "/machin", "service")
    assert SETTLED_SECONDS < clock() < SETTLED_SECONDS + 0.1
    with pytest.raises(CommandError, match="no service /other"):
        type_of(lambda: {"/machine": "x/srv/A"}, "/other", "service")
    assert clock() > SETTLED_SECONDS + DISCOVERY_SECONDS


@pytest.mark.parametrize("namespace", ["", "/cell_1"])
def test_a_node_that_has_its_parameters_only_is_still_starting(
    clock: Callable[[], float], namespace: str
) -> None:
    """However long the rest takes: its own names are no typos of those of its parameters."""
    node = f"{namespace}/ir_sim_driver"

    def seen() -> dict[str, str]:
        late = {f"{node}/query_modes": "x/srv/B"} if clock() > DISCOVERY_SECONDS - 1.0 else {}
        return {f"{node}/get_parameters": "x/srv/A", f"{node}/list_parameters": "x/srv/A", **late}

    assert type_of(seen, f"{node}/query_modes", "service") == "x/srv/B"
    began = clock()
    with pytest.raises(CommandError, match="did you mean"):
        type_of(seen, f"{node}/query_mode", "service")
    assert clock() - began < SETTLED_SECONDS + 0.1


def test_a_node_that_is_in_another_namespace_is_named(clock: Callable[[], float]) -> None:
    with pytest.raises(CommandError, match="did you mean /cell_1/ir_planner/get_cell"):
        type_of(
            lambda: {"/cell_1/ir_planner/get_cell": "x/srv/A"}, "/ir_planner/get_cell", "service"
        )
    assert clock() < DISCOVERY_SECONDS + 0.1


def test_nodes_that_somebody_starts_on_this_host_get_a_minute(clock: Callable[[], float]) -> None:
    """Four processes that start at once on a slow machine: nothing is seen of them for half of
    it.
    """
    namespace = f"/starting_{os.getpid()}"
    name = f"{namespace}/ir_planner/set_cell"

    def seen() -> dict[str, str]:
        return {name: "x/srv/A"} if clock() > START_SECONDS - 1.0 else {}

    held = claim(os.environ.get("ROS_DOMAIN_ID", ""), namespace)
    assert held is not None
    with held:
        assert type_of(seen, name, "service") == "x/srv/A"
        began = clock()
        with pytest.raises(CommandError, match="no service"):
            type_of(dict, name, "service")
        assert START_SECONDS < clock() - began < START_SECONDS + 0.1
        began = clock()
        with pytest.raises(CommandError, match="no service"):
            type_of(dict, name, "service", seconds=2.0)
        assert clock() - began < 2.1
    began = clock()
    with pytest.raises(CommandError, match="no service"):
        type_of(dict, name, "service")
    assert clock() - began < DISCOVERY_SECONDS + 0.1


def test_a_process_that_was_held_up_has_not_seen_that_nothing_came(
    clock: Callable[[], float],
) -> None:
    """3 s between two looks: what discovery had to say in them is heard a moment later."""
    looks: list[float] = []

    def seen() -> dict[str, str]:
        looks.append(clock())
        if len(looks) == 5:
            lookup.time.sleep(3.0)
        return {"/machine": "x/srv/A", **({"/machines": "x/srv/B"} if len(looks) > 10 else {})}

    assert type_of(seen, "/machines", "service") == "x/srv/B"
    looks.clear()
    assert "/machines" in settled(seen)


def test_a_graph_that_grows_slowly_is_given_as_long_again(clock: Callable[[], float]) -> None:
    """Half of a node's services after 3 s, the rest 2 s later: what comes late is no typo."""

    def seen() -> dict[str, str]:
        half = {"/node/plan_a": "x/srv/A"} if clock() > 3.0 else {}
        return {**half, "/node/plan_b": "x/srv/B"} if clock() > 5.0 else half

    assert type_of(seen, "/node/plan_b", "service") == "x/srv/B"
    assert 5.0 < clock() < 5.1


def test_a_graph_has_settled_when_it_has_not_grown_for_a_second(clock: Callable[[], float]) -> None:
    seen = {"/late": "x/srv/B"}
    assert settled(lambda: seen if clock() > 0.9 else {}) == seen
    assert 0.9 + SETTLED_SECONDS < clock() < 1.0 + SETTLED_SECONDS
    begin = clock()
    assert settled(lambda: {f"/{clock()}": "x/srv/B"})
    assert DISCOVERY_SECONDS <= clock() - begin < DISCOVERY_SECONDS + 0.1


def test_an_empty_graph_hints_at_the_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    with pytest.raises(
        CommandError, match="do the nodes run, and in this domain\\? ROS_DOMAIN_ID is 42"
    ):
        type_of(dict, "/a", "service", seconds=0.05)


@pytest.mark.parametrize("typed", ["", "ir_msgs/srv/SetLoad", "ir_msgs/SetLoad"])
def test_the_type_may_be_left_out_or_short(typed: str) -> None:
    assert checked_type(typed, "ir_msgs/srv/SetLoad", "/a", "service") == "ir_msgs/srv/SetLoad"


def test_another_type_is_named() -> None:
    with pytest.raises(
        CommandError, match="has the type ir_msgs/srv/SetLoad, not ir_msgs/srv/GetCell"
    ):
        checked_type("ir_msgs/srv/GetCell", "ir_msgs/srv/SetLoad", "/a", "service")
