"""A node whose shared memory was removed says so: nothing from this host arrives any more."""

from __future__ import annotations

import subprocess
import sys

from ir_msgs_py.ros.diagnostics import unlinked

MAPPED = "7f00-7f01 rw-s 0000 00:1a 42   /dev/shm/fastrtps_port{}{}"

SCRIPT = """
import pathlib, sys, rclpy
from ir_msgs_py.ros.diagnostics import lost_ports
rclpy.init()
node = rclpy.create_node("deaf")
assert lost_ports() == (), lost_ports()
own = [p.readlink() for p in pathlib.Path("/proc/self/fd").iterdir() if p.is_symlink()]
locks = [p for p in map(str, own) if "fastrtps_port" in p and p.endswith("_el")]
for lock in locks:
    pathlib.Path(lock.removesuffix("_el")).unlink(missing_ok=True)
print(len(locks), len(lost_ports()))
rclpy.shutdown()
"""


def test_a_port_of_another_process_that_ended_is_no_loss() -> None:
    own = ["/dev/shm/fastrtps_port7411_el", "socket:[1]"]
    peers = [MAPPED.format(7413, " (deleted)"), MAPPED.format(7411, "")]
    assert unlinked(own, peers) == ()
    assert unlinked(own, [*peers, MAPPED.format(7411, " (deleted)")]) == ("fastrtps_port7411",)


def test_a_lock_that_was_removed_too_counts() -> None:
    own = ["/dev/shm/fastrtps_port7411_el (deleted)"]
    mapped = [MAPPED.format(7411, " (deleted)")]
    assert unlinked(own, mapped) == ("fastrtps_port7411",)


def test_a_process_whose_ports_are_removed_notices() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=120, check=True
    )
    locks, lost = map(int, done.stdout.split())
    assert lost == locks
    assert locks > 0
