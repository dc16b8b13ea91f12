"""Arguments that the recorder's commands share."""

from __future__ import annotations

import argparse

from ir_msgs_py.file_roots import ENVIRONMENT


def add_roots(parser: argparse.ArgumentParser) -> None:
    """Adds --root: the folders below which files are read and written."""
    where = f"folder below which files may be (repeatable; else {ENVIRONMENT}, else the working folder)"
    parser.add_argument("--root", action="append", default=[], dest="roots", metavar="DIR", help=where)
