"""Reads a cell in a process of its own: however large it is, whoever called can do other things
meanwhile.

The process has bounds of memory and processor time. Its answer is the cell, or the error that
reading it here would have raised.
"""

from __future__ import annotations

import copyreg
import io
import math
import pickle
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ir_description.cell import Cell
from ir_description.errors import CellFileError, DescriptionError, shown
from ir_description.library import (
    bundled_cells,
    bundled_robots,
    cell_from_yaml,
    load_cell,
    load_robot,
)
from ir_description.robot import RobotModel

CHARACTERS_HERE = 50_000
"""A text of at most so many characters is read in a tenth of a second: too little for a process."""
PROCESSOR_SECONDS = 60
MEMORY_BYTES = 4_000_000_000
"""Address space of the process; reading the largest cell takes about half of it."""
_SHOWN = 200  # characters of what the process said last


def read_cell_apart(text: str, name_or_path: str) -> Cell:
    """The cell of a text, or else of a path or bundled name, read elsewhere unless that is quick.

    Raises what cell_from_yaml and load_cell raise, and CellFileError where it takes too much to
    read.
    """
    if text and len(text) <= CHARACTERS_HERE:
        return cell_from_yaml(text)
    if name_or_path in bundled_cells():
        return load_cell(name_or_path)
    process = subprocess.run(
        [sys.executable, "-c", f"from {__name__} import main; main()"],
        input=pickle.dumps((text, name_or_path)),
        capture_output=True,
    )
    if process.returncode != 0:
        raise CellFileError(shown(name_or_path)[1:-1] or "<text>", 0, _failure(process))
    answer = pickle.loads(process.stdout)  # written by this module's main
    if isinstance(answer, DescriptionError):
        raise answer
    cell: Cell = answer
    return cell


def _failure(process: subprocess.CompletedProcess[bytes]) -> str:
    """Why the process has no answer."""
    last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
    if process.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"reading it takes more than {PROCESSOR_SECONDS} s of processor time"
    if "MemoryError" in "".join(last):
        return f"reading it takes more than {MEMORY_BYTES / 1e9:g} GB of memory"
    return f"the process that reads it ended with {process.returncode}: {''.join(last)[:_SHOWN]}"


def main() -> None:
    """Read what standard input names, and write the cell or the error to standard output."""
    used = resource.getrusage(resource.RUSAGE_SELF)  # by what was imported, which is no reading
    most = math.ceil(used.ru_utime + used.ru_stime) + PROCESSOR_SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (most, most))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    text, name_or_path = pickle.load(sys.stdin.buffer)
    answer: Cell | DescriptionError
    try:
        answer = cell_from_yaml(text) if text else load_cell(name_or_path)
    except DescriptionError as error:
        answer = error
    sys.stdout.buffer.write(pickled(answer))


def pickled(value: Cell | DescriptionError) -> bytes:
    """The value as bytes from which its arrays come back read-only, and a bundled robot as the one
    object.
    """
    stream = io.BytesIO()
    pickler = pickle.Pickler(stream, protocol=pickle.HIGHEST_PROTOCOL)
    reducers: dict[type, Callable[[Any], Any]] = {
        np.ndarray: _reduce_array,
        RobotModel: _reduce_robot,
    }
    pickler.dispatch_table = {**copyreg.dispatch_table, **reducers}
    pickler.dump(value)
    return stream.getvalue()


def _reduce_array(array: NDArray[np.generic]) -> tuple[object, ...]:
    return _array, (array.tobytes(), array.dtype.str, array.shape)


def _array(content: bytes, dtype: str, shape: tuple[int, ...]) -> NDArray[np.generic]:
    return np.frombuffer(content, dtype).reshape(shape)  # of bytes: read-only


def _reduce_robot(robot: RobotModel) -> tuple[object, ...] | str:
    for name in bundled_robots():
        if load_robot(name) is robot:
            return load_robot, (name,)
    return robot.__reduce_ex__(pickle.HIGHEST_PROTOCOL)
