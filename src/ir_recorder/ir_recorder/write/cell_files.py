"""The cell as a recording carries it, so that the file can be read on its own."""

from __future__ import annotations

from ir_description import DescriptionError, cell_to_yaml, load_cell, robot_urdf
from ir_recorder.errors import PathError
from ir_recorder.write.session import CellFiles


def files_of_cell(name_or_path: str) -> CellFiles:
    """Files of a bundled cell or of one on disk; PathError when there is none or it is broken."""
    try:
        cell = load_cell(name_or_path)
    except DescriptionError as error:
        raise PathError(f"cell {name_or_path[:200]!r} can't be attached: {error}") from error
    return CellFiles(
        cell_to_yaml(cell), robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose)
    )
