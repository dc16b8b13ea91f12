"""Arguments that the recorder's commands share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from ir_values.files import ANYWHERE, FileRoots


def add_roots(parser: argparse.ArgumentParser) -> None:
    """Adds --root: the folders below which files are read and written."""
    where = "folder below which files must be (repeatable; none: wherever you may read and write)"
    parser.add_argument(
        "--root", action="append", default=[], dest="roots", metavar="DIR", help=where
    )


def roots_of(folders: Sequence[str]) -> FileRoots:
    """Files that a local command may touch: its user's, anywhere; with --root below these
    folders only. Roots by default are for nodes, whose requests come from elsewhere.
    """
    return FileRoots.of(folders) if folders else ANYWHERE


def record_parser() -> argparse.ArgumentParser:
    """Arguments of `ir-record`."""
    parser = argparse.ArgumentParser(
        prog="ir-record", description="Records a cell into one MCAP file."
    )
    parser.add_argument("path", nargs="?", default="", help="file to write; none: wait for ~/start")
    parser.add_argument("--overwrite", action="store_true", help="replace a recording")
    parser.add_argument(
        "--topics", nargs="+", default=[], help='names or patterns; "*": all visible'
    )
    parser.add_argument(
        "--cell", default="", help="cell to attach, name or file; none: ask the planner"
    )
    parser.add_argument("--namespace", default="", help="of the cell to record (none)")
    further = "after which a further file begins: PATH_1.mcap (0: one file)"
    parser.add_argument("--split-size", type=int, default=0, metavar="BYTES", help=further)
    parser.add_argument("--split-duration", type=float, default=0.0, metavar="S", help=further)
    add_roots(parser)
    return parser


def play_parser() -> argparse.ArgumentParser:
    """Arguments of `ir-play`."""
    parser = argparse.ArgumentParser(
        prog="ir-play", description="Publishes a recording's messages again."
    )
    parser.add_argument("file")
    parser.add_argument("--rate", type=float, default=1.0, help="2 plays twice as fast")
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    which = (
        "names or patterns; none: all visible topics; commands only by full name, never "
        "beside a driver"
    )
    parser.add_argument("--topics", nargs="+", default=[], help=which)
    parser.add_argument("--clock", action="store_true", help="publish recorded time on /clock")
    parser.add_argument("--delay", type=float, default=0.5, help="s before the first message")
    add_roots(parser)
    return parser
