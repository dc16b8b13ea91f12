"""Writes what was dragged as a new file beside the cell's own, or here where the cell is
bundled.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from ir_description import Cell, DescriptionError, cell_to_yaml, load_cell

from .moved import Moves, cell_with, edited
from .watched import Watched

MOST_FILES = 1_000


class SavingError(Exception):
    """Why nothing was written."""


def save(watched: Watched, cell: Cell, moves: Moves) -> Path:
    """The new file: the text of the old one, comments and all, with the moves. Raises SavingError.

    cell: as the file has it. No file is ever overwritten, and what was written is read back and
    compared.
    """
    try:
        text = edited(_text(watched), cell, moves)
        path = _written(watched, text)
        if cell_to_yaml(load_cell(path)) != cell_to_yaml(cell_with(cell, moves)):
            path.unlink()
            raise SavingError(
                "the file has changed meanwhile, or its poses can't be replaced one by one"
            )
    except (OSError, UnicodeError, ValueError, DescriptionError) as error:
        raise SavingError(str(error)) from error
    return path


def _text(watched: Watched) -> str:
    if watched.path is not None:
        return watched.path.read_text(encoding="utf-8")
    return (files("ir_description") / "data" / "cells" / f"{watched.name}.yaml").read_text(
        encoding="utf-8"
    )


def _written(watched: Watched, text: str) -> Path:
    stem = watched.path.stem if watched.path is not None else watched.name
    for number in range(1, MOST_FILES):
        path = watched.folder / f"{stem}_moved{'' if number == 1 else f'_{number}'}.yaml"
        try:
            with path.open("x", encoding="utf-8", newline="") as file:
                file.write(text)
        except FileExistsError:
            continue
        return path.resolve()
    raise SavingError(f"there are {MOST_FILES - 1} files {stem}_moved already")
