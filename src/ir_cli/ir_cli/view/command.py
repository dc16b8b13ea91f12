"""`ir view`: a cell in a browser of this machine, until Ctrl-C."""

from __future__ import annotations

import argparse
import math
import sys
import time

from ir_cli.planning import add_cell
from ir_cli.view.server import HOST, PORT, address, check_installed, closed, new_token, opened


def add_view(view: argparse.ArgumentParser) -> None:
    """Arguments of `ir view`."""
    add_cell(view)
    words = f"on {HOST}; 0: a free one ({PORT}, or a free one where that is taken)"
    view.add_argument("--port", type=_port, help=words)
    view.add_argument(
        "--stations", nargs="+", default=[], metavar="NAME", help="visit these instead"
    )
    view.add_argument(
        "--seconds", type=_seconds, default=math.inf, help="end after so long (with Ctrl-C)"
    )
    view.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until SIGINT, SIGTERM or the end of the given time."""
    check_installed()
    from ir_cli.view.cell_file import Watched
    from ir_cli.view.session import Session

    watched = Watched(arguments.cell)
    token = new_token()
    server = opened(arguments.port, token)
    session = None
    try:
        session = Session(server, watched, tuple(arguments.stations))
        sys.stdout.write(f"{address(HOST, server.get_port(), token)}\n")
        sys.stdout.write("open it in a browser of this machine; Ctrl-C ends it\n")
        sys.stdout.flush()
        session.run(time.monotonic() + arguments.seconds)
    finally:
        if session is not None:
            session.close()
        closed(server)
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
