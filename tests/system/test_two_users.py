"""A second user of the machine, in the same domain with the same names: everybody has a cell of
their own.

Where this process may become other users, it does; elsewhere the two have homes, temporary folders
and namespaces of their own.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from ir_msgs_py.ros.testing import PATIENCE

pytestmark = pytest.mark.long

USERS = (65534, 65533)
READS = "-all,+dac_read_search"  # the interpreter may lie where only its owner looks
ANSWERED = 180.0  # s; each command starts an interpreter on a busy machine


class User:
    """Runs commands as this user, where that is possible, with a home of its own."""

    def __init__(self, number: int, home: Path, domain: int) -> None:
        self.home = home
        self._words = [sys.executable, "-m"]
        self.namespace = "" if _may_change() else f"/user_{number}"
        home.mkdir()
        if _may_change():
            os.chown(home, number, number)
            rights = f"--reuid={number} --regid={number} --clear-groups --bounding-set={READS}"
            caps = "--inh-caps=+dac_read_search --ambient-caps=+dac_read_search"
            self._words = ["setpriv", *rights.split(), *caps.split(), *self._words]
        homes = {name: str(home) for name in ("HOME", "TMPDIR", "ROS_LOG_DIR")}
        self._environment = {**os.environ, **homes, "ROS_DOMAIN_ID": str(domain)}

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start a module with its words."""
        return subprocess.Popen(
            [*self._words, *words],
            env=self._environment,
            cwd="/",
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )


def _may_change() -> bool:
    return os.getuid() == 0 and shutil.which("setpriv") is not None


@pytest.fixture
def users(tmp_path: Path, ros_domain_id: int) -> Iterator[list[tuple[User, subprocess.Popen[str]]]]:
    """Two users, each with a driver, the second one started when the first one is there."""
    for folder in (tmp_path, *tmp_path.parents[:2]):
        folder.chmod(0o755)
    parameters = ["cell:=open", "backend:=ideal", "wake_port:=0"]
    with ExitStack() as stack:
        started = []
        for number in USERS:
            user = User(number, tmp_path / str(number), ros_domain_id)
            words = [word for parameter in parameters for word in ("-p", parameter)]
            if user.namespace:
                words += ["-r", f"__ns:={user.namespace}"]
            process = user.start("ir_sim_driver.node", "--ros-args", *words)
            stack.callback(process.wait)
            stack.callback(process.kill)
            started.append((user, process))
        yield started


def test_each_user_reaches_the_own_robot_and_both_go_on(users: Any, wait_for: Any) -> None:
    for user, process in users:

        def answered(user: User = user) -> bool:
            words = ["call", f"{user.namespace}/ir_sim_driver/query_modes"]
            asked = user.start("ir_cli.main", *words)
            said, _ = asked.communicate(timeout=ANSWERED)
            assert "Traceback" not in said
            return asked.returncode == 0 and "STAND_ON" in said

        wait_for(answered, timeout=ANSWERED, what="the user's own driver answers")
        assert process.poll() is None
    for _, process in users:
        process.terminate()
        said, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, said
        assert "Traceback" not in said
