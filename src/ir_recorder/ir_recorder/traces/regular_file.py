"""Files of measurements as a user names them: regular ones of a bounded size."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ir_recorder.errors import TraceError

BYTES_MAX = 500_000_000


def opened(path: Path) -> int:
    """A descriptor of a file of at most BYTES_MAX; never waits on a FIFO or a device. Raises
    TraceError.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise TraceError(f"{path}: can't be opened: {reason}") from error
    status = os.fstat(descriptor)
    fault = "is not a regular file" if not stat.S_ISREG(status.st_mode) else ""
    if not fault and status.st_size > BYTES_MAX:
        fault = f"has {status.st_size} bytes, at most {BYTES_MAX} are read"
    if fault:
        os.close(descriptor)
        raise TraceError(f"{path}: {fault}")
    return descriptor
