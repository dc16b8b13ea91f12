"""Shared parts of the scripts that draw pictures for the documentation."""

from __future__ import annotations

import argparse
from pathlib import Path


def folder_asked(doc: str | None) -> Path:
    """The folder of the command line, made where it is missing; doc: the script's own text."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--folder", type=Path, default=Path("docs/images"), help="default: docs/images"
    )
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    return folder
