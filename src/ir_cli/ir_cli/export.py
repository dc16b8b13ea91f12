"""`ir export`: a planned program as KRL, or the machines of a cell as SDF, URDF or glTF."""

from __future__ import annotations

import argparse

from ir_cli import cell_worlds, krl


def add_export(export: argparse.ArgumentParser) -> None:
    """Arguments of `ir export`."""
    krl.add_export(export)
    export.set_defaults(run=run_export)


def run_export(arguments: argparse.Namespace) -> int:
    """Write the file that its ending names."""
    if arguments.output.suffix.lower() in (".src", krl.UR):
        return krl.run_export(arguments)
    return cell_worlds.run_export(arguments)
