"""Lifeline of a worker process: it ends with its starter, also while it hangs in compiled code.

The starter holds the writing end of a pipe and never writes. When it ends, however it does, the
kernel sends SIGIO to the process that holds the other end; nothing handles that, so it ends.
"""

from __future__ import annotations

import fcntl
import os

VARIABLE = "IR_STUDIES_LIFELINE"
"""Of the environment: the descriptor of the reading end."""


def tie() -> None:
    """End with the process that passed the descriptor; without one nothing happens."""
    given = os.environ.pop(VARIABLE, "")
    if not given:
        return
    descriptor = int(given)
    fcntl.fcntl(descriptor, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_ASYNC)
