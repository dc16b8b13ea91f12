"""The one place where what goes wrong in a request becomes its status, so that the node lives on.

No descriptor left, a full disk, 1e308 in a field, a bug: whatever is raised, the request is
answered.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from typing import Any

from ir_msgs_py.ros.conversions import status_to_msg
from ir_msgs_py.status import Status, StatusCode

StatusOf = Callable[[Exception], Status | None]

ANY = (Exception, SystemExit)
"""What must not end a node. SystemExit: somebody's registered search may call exit()."""


def answered(
    response: Any,
    source: str,
    work: Callable[[], Status],
    status_of: StatusOf,
    log: Callable[[str], object] = lambda text: None,
) -> Any:
    """The response with the status that `work` returns, or that of what it raises.

    source: the node. status_of: the status of an error that a request may end with, None for all
    others, which are logged with their traceback.
    """
    try:
        status = work()
    except ANY as error:  # whatever it is: one request must not end the node for all others
        known = None if isinstance(error, SystemExit) else status_of(error)
        if known is None:
            log(traceback.format_exc())
        status = known or unexpected(error)
    response.status = status_to_msg(Status(status.code, status.message, source))
    return response


def unexpected(error: BaseException) -> Status:
    """The status of an error that nobody thought of."""
    return Status(StatusCode.FAILURE, f"unexpected {type(error).__name__}: {error}")
