"""A node that ends with the process that started it: `python -m ir_cli.child MODULE ARGUMENTS`.

Standard input is a pipe that the parent holds open and never writes to. The kernel closes it when
the parent ends, by whatever signal; then the node is interrupted, and ended for good when it does
not follow.
"""

from __future__ import annotations

import os
import runpy
import signal
import sys
import threading
import time

GRACE_SECONDS = 10.0
"""For a node to finish what it writes after its parent has gone."""


def main() -> None:
    """Run the module of the command line as if it had been started itself."""
    del sys.argv[0]
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


def _end_with_parent() -> None:
    while os.read(sys.stdin.fileno(), 1):
        pass
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE_SECONDS)
    os._exit(1)


if __name__ == "__main__":
    main()
