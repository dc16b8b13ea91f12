"""A node of the project as a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

ENDED = 60.0  # s; a busy machine takes long to end a node
DOMAIN = "83"  # ROS_DOMAIN_ID where the caller has none: nobody else listens there


@contextmanager
def running(module: str, **parameters: str | int) -> Iterator[subprocess.Popen[bytes]]:
    """The node of a module with these parameters, ended with SIGINT."""
    os.environ.setdefault("ROS_DOMAIN_ID", DOMAIN)
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    command = [sys.executable, "-m", module, "--ros-args", *given]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(ENDED)
