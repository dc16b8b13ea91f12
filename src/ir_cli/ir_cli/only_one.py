"""Only one process of this host at a time may start the nodes of a domain and namespace.

Discovery takes tenths of a second, so two that start together do not see each other in the graph. A
socket with a name of the kernel's own name space is taken by one of them, needs no file, and ends
with its process.
"""

from __future__ import annotations

import hashlib
import socket
import sys
from pathlib import Path

from .errors import CommandError


def claim(domain: str, namespace: str) -> socket.socket | None:
    """The claim, which lasts until it is closed; None where the system has no such sockets.

    Raises CommandError when another process has it.
    """
    if not sys.platform.startswith("linux"):
        return None
    held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        held.bind(f"\0{_name(domain, namespace)}")
    except OSError as error:
        held.close()
        where = f"in {namespace}" if namespace else "without a namespace"
        raise CommandError(
            f"another `ir up` or `ir demo` starts or runs the nodes {where} of domain "
            f"{domain or '0'}: end it, or choose another domain (ROS_DOMAIN_ID) or --namespace"
        ) from error
    return held


def claimed(domain: str, namespace: str) -> bool:
    """Whether a process of this host has the claim now; False where nobody can know."""
    try:
        names = Path("/proc/net/unix").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    wanted = f"@{_name(domain, namespace)}"
    return any(line.endswith(wanted) for line in names.splitlines())


def _name(domain: str, namespace: str) -> str:
    what = hashlib.sha256(f"{domain or '0'}\0{namespace}".encode()).hexdigest()[:32]
    return f"ir_up.{what}"
