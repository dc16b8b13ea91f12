"""Every test process talks in a ROS domain of its own, finds its peers fast and leaves no logs
behind.

Two sessions on one machine, and the workers of one session (pytest-xdist), must not hear each
other. The settings are environment variables because the tests' own subprocesses inherit them.
"""

from __future__ import annotations

import dataclasses
import gc
import math
import os
import sys

import pytest
from hypothesis import HealthCheck, settings

import ir_cli  # noqa: F401 - one thread of linear algebra; before anything loads NumPy
from ir_msgs_py.ros.network import apply_network
from ir_msgs_py.ros.testing import own_domain

# The same examples in every run, however long it takes to make and to try one: a red test is a
# change of the code, never luck or a busy machine.
# To look for new examples:
# pytest --hypothesis-profile=default --hypothesis-seed=N
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")


def pytest_configure(config: pytest.Config) -> None:
    """Choose domain and discovery before any test module imports rclpy."""
    os.environ["ROS_DOMAIN_ID"] = str(own_domain())
    apply_network()
    os.environ["RCUTILS_COLORIZED_OUTPUT"] = "0"
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)


@pytest.hookimpl(trylast=True)  # of what -k, -m and paths leave
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the first and the last case of each `sampled` test, where long tests are left out."""
    if config.option.markexpr != "not long":
        return
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("sampled"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    left = {id(item) for each in cases.values() for item in each[1:-1]}
    config.hook.pytest_deselected(items=[item for item in items if id(item) in left])
    items[:] = [item for item in items if id(item) not in left]


def pytest_collection_finish() -> None:
    """What was collected lives as long as the session: the garbage collector need not walk it."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _no_suspension(monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver in this process catches up, however long the machine gave it no processor.

    A process that gets none for two seconds takes that for a suspension, says so, and brakes; tests
    of that are in tests/driver/test_real_time.py.
    """
    node = sys.modules.get("ir_sim_driver.node.node")
    if node is not None:
        patient = dataclasses.replace(node.SYSTEM, gap=math.inf)
        monkeypatch.setattr(node, "SYSTEM", patient)


@pytest.fixture(scope="session", autouse=True)
def _ros_logs(tmp_path_factory: pytest.TempPathFactory) -> None:
    os.environ["ROS_LOG_DIR"] = str(tmp_path_factory.mktemp("ros_log"))
