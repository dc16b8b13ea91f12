"""The cell of a recording: its robot, its mounting and what may be held."""

from __future__ import annotations

from ir_description import Cell, DescriptionError, cell_from_yaml
from ir_msgs_py.errors import InvalidValueError
from ir_recorder.errors import FitError
from ir_recorder.read.recording import Recording


def attached_cell(recording: Recording | None) -> Cell:
    """The cell that a recording carries; FitError where there is none."""
    if recording is None:
        raise FitError("the file carries no cell: name one with --cell")
    if not recording.cell_yaml:
        raise FitError(f"{recording.path}: no cell is attached: name one with --cell")
    try:
        return cell_from_yaml(recording.cell_yaml, "the attached cell")
    except (DescriptionError, InvalidValueError, RecursionError) as error:
        raise FitError(f"{recording.path}: the attached cell can't be read: {error}") from error
