"""`ir view`: a cell in a browser of this machine, planned, replayed or driven, until Ctrl-C."""

from __future__ import annotations

import argparse
import math
import sys
import time

from ir_cli.errors import InputError
from ir_cli.ports import TCP, free_port, is_free
from ir_recorder.live.server import ADDRESS

PORT = 8880
OPEN_IT = "open it in a browser of this machine; who has the address may use its controls; Ctrl-C ends it\n"  # noqa: E501


def add_view(view: argparse.ArgumentParser) -> None:
    """Arguments of `ir view`."""
    view.add_argument(
        "cell",
        nargs="?",
        default="",
        metavar="CELL",
        help="a cell file, the name of a bundled one, or a recording (.mcap)",
    )
    words = f"on {ADDRESS}; 0: a free one ({PORT}, or a free one where that is taken)"
    view.add_argument("--port", type=_port, help=words)
    view.add_argument("--live", action="store_true", help="the cell whose nodes run, as they drive")
    view.add_argument(
        "--namespace", default="", help="with --live: of the cell's nodes: cell_1 (none)"
    )
    view.add_argument(
        "--stations", nargs="+", default=[], metavar="NAME", help="visit these instead"
    )
    view.add_argument(
        "--seconds", type=_seconds, default=math.inf, help="end after so long (with Ctrl-C)"
    )
    view.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until SIGINT, SIGTERM or the end of the given time."""
    if bool(arguments.cell) == arguments.live:
        raise InputError("give a CELL or a recording, or --live for the cell whose nodes run")
    port = arguments.port
    if port is None:
        port = PORT if is_free(PORT, TCP, ADDRESS) else free_port(TCP)
    if arguments.live:
        if arguments.stations or arguments.seconds != math.inf:
            raise InputError(
                "--stations and --seconds are of a cell that is planned: not of --live"
            )
        from ir_cli.ros.live import run_live

        return run_live(port, arguments.namespace)
    from ir_cli.view.cell_file import Recorded, Watched
    from ir_cli.view.session import Session

    name = arguments.cell
    shown = Recorded(name) if name.endswith(".mcap") else Watched(name)
    session = Session(shown, tuple(arguments.stations), port)
    try:
        sys.stdout.write(f"{session.server.address}\n{OPEN_IT}")
        sys.stdout.flush()
        session.run(time.monotonic() + arguments.seconds)
    finally:
        session.close()
    return 0


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) <= 65535):
        raise argparse.ArgumentTypeError(
            f"{text[:60]!r} must be a whole number 0 .. 65535; 0 is a free one"
        )
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"{text[:60]!r} must be a number of seconds, 0 or more")
    return value
