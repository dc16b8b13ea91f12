"""Bundled and own data by name or path: robots, power data, cells, paths.

`read_cell_apart` reads a large cell in a process of its own, with bounds of memory and processor
time, so that the caller can do other things meanwhile.
"""

from __future__ import annotations

import copyreg
import io
import math
import os
import pickle
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ir_description.cell import Cell, RobotCells
from ir_description.files import (
    ROBOT_MARK,
    bundled_controller,
    bundled_controllers,
    cell_errors,
    is_path,
    path_from_yaml,
    power_parameters_from_yaml,
    read_cell,
    read_regular_file,
    read_robot,
    read_robot_cells,
    robot_from_yaml,
    subject_line,
    text_of,
)
from ir_description.robot import DATA_SHEET, PowerData, PowerParameters, RobotModel, prior
from ir_msgs_py.cartesian import CartesianPath
from ir_values.errors import (
    CellFileError,
    DescriptionError,
    InvalidValueError,
    RobotFileError,
    UnknownNameError,
    shown,
)

_DATA = files("ir_description") / "data"

CELL_BYTES_MAX = 8_000_000
"""Largest cell file [bytes]."""

PARAMETER_BYTES_MAX = 1_000_000
"""Largest file of power parameters [bytes]."""


def _bundled(folder: str) -> tuple[str, ...]:
    names = (entry.name for entry in (_DATA / folder).iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in names if name.endswith(".yaml")))


def bundled_robots() -> tuple[str, ...]:
    """Return the names that load_robot knows."""
    return _bundled("robots")


@cache
def load_robot(name: str = "kr210_r2700_extra") -> RobotModel:
    """Return a bundled robot; the same object for the same name. Raises UnknownNameError for
    another name.
    """
    if name not in bundled_robots():
        raise UnknownNameError("robot", name, bundled_robots())
    path = _DATA / "robots" / f"{name}.yaml"
    robot = robot_from_yaml(path.read_text(encoding="utf-8"), path.name, Path(str(path)).parent)
    return replace(robot, document="")  # its name is enough


def robot_named(name_or_path: str) -> RobotModel:
    """Return a bundled robot by its name, or the robot of a file by its path. Raises RobotFileError
    for what is neither.
    """
    if not is_path(name_or_path):
        return load_robot(name_or_path)
    try:
        return read_robot(Path(name_or_path))
    except InvalidValueError as error:
        raise RobotFileError(shown(name_or_path)[1:-1], 0, str(error)) from error


def load_power_data(name: str = "kr_c4") -> PowerData:
    """Return the power figures of a bundled controller; the same object for the same name."""
    return bundled_controller(name)


def load_power_parameters(
    name_or_path: str = DATA_SHEET, robot: RobotModel | None = None
) -> PowerParameters:
    """Return the parameters of a file by its path; "data_sheet" or "": those of the data of the
    robot, None: the bundled KR 210's. A file of a robot that is not bundled needs that robot.
    """
    if name_or_path in ("", DATA_SHEET):
        return data_sheet() if robot is None else data_sheet_of(robot, robot.controller)
    return power_parameters_of(read_power_parameters(name_or_path), name_or_path, robot)


def read_power_parameters(name_or_path: str) -> str:
    """Return the text of a file of power parameters, not yet understood. Raises UnknownNameError
    where there is none.
    """
    if not is_path(name_or_path):
        raise UnknownNameError(
            "power parameters", name_or_path, (DATA_SHEET, "the path of a .yaml file")
        )
    try:
        content = read_regular_file(Path(name_or_path), PARAMETER_BYTES_MAX)
    except InvalidValueError as error:
        raise RobotFileError(shown(name_or_path)[1:-1], 0, str(error)) from error
    return text_of(content, name_or_path, RobotFileError)


def power_parameters_of(text: str, source: str, robot: RobotModel | None) -> PowerParameters:
    """Return the parameters that a text describes of a robot, or (None, or another robot's) of a
    bundled one; errors name source and line.
    """

    def start(name: str, controller: str) -> PowerParameters:
        if robot is None or (name in bundled_robots() and name != robot.name):
            return data_sheet(name, controller)
        if name != robot.name:
            raise InvalidValueError(
                f"its parameters are of robot {name}: the cell has {robot.name}"
            )
        if controller == robot.controller.name:
            return data_sheet_of(robot, robot.controller)
        if controller not in bundled_controllers():
            raise InvalidValueError(
                f"its parameters are of {name} with controller {controller}: the cell's has "
                f"{robot.controller.name}"
            )
        return data_sheet_of(robot, load_power_data(controller))

    return power_parameters_from_yaml(text, source, start)


@cache
def data_sheet(robot: str = "kr210_r2700_extra", controller: str = "") -> PowerParameters:
    """Return the parameters as the data of a bundled robot and controller ("": the robot's own)
    have them, with the deviations that their marks of confidence give.
    """
    model = load_robot(robot)
    if controller in ("", model.controller.name):
        return data_sheet_of(model, model.controller)
    return data_sheet_of(model, load_power_data(controller))


def data_sheet_of(robot: RobotModel, power: PowerData) -> PowerParameters:
    """Return the same of any robot and controller."""
    return prior(robot, power, {**robot.marks, **power.marks})


def bundled_cells() -> tuple[str, ...]:
    """Return the names of cells with one robot that load_cell knows."""
    return _bundled("cells")


def bundled_robot_cells() -> tuple[str, ...]:
    """Return the names of cells with several robots that load_robot_cells knows."""
    return _bundled("robot_cells")


def load_cell(name_or_path: str | Path) -> Cell:
    """Return a bundled cell by its name, or the cell of a file by its path; of a cell with several
    robots that of one of them, with its name behind: "two_robots@left".

    A text with a folder or with the ending .yaml or .yml is a path. Only regular files of at most
    CELL_BYTES_MAX are read; their meshes come from their own folder. Raises UnknownNameError for a
    name that is none, CellFileError for a file with mistakes.
    """
    name = os.fspath(name_or_path)
    if isinstance(name_or_path, str) and name in bundled_cells():
        return _bundled_cell(name)
    cell, robot = robot_in(name)
    if robot:
        several = load_robot_cells(cell)
        if several is None:
            raise UnknownNameError(f"robot (the cell {cell} has one)", robot, ())
        return several.of_robot(robot)
    return read_cell(*_cell_text(name_or_path))


def load_robot_cells(name_or_path: str | Path) -> RobotCells | None:
    """Return the cells of all robots of a bundled cell or a file; None: it has one robot."""
    return read_robot_cells(*_cell_text(name_or_path))


def robot_in(name: str) -> tuple[str, str]:
    """Return the cell and the robot that "two_robots@left" names; "" where no robot is named."""
    cell, mark, robot = name.rpartition(ROBOT_MARK)
    named = bool(mark) and os.sep not in robot and not is_path(robot)
    return (cell, robot) if named else (name, "")


def _cell_text(name_or_path: str | Path) -> tuple[str, str, Callable[[str], RobotModel], Path]:
    """The text of a cell, its source, the bundled robots, and the folder of its meshes."""
    name = os.fspath(name_or_path)
    for folder in ("cells", "robot_cells"):
        if isinstance(name_or_path, str) and name in _bundled(folder):
            path = Path(str(_DATA / folder / f"{name}.yaml"))
            return path.read_text(encoding="utf-8"), path.name, load_robot, path.parent
    if isinstance(name_or_path, str) and not is_path(name):
        raise UnknownNameError("cell", name, (*bundled_cells(), *bundled_robot_cells()))
    path = Path(name)
    try:
        content = read_regular_file(path, CELL_BYTES_MAX)
    except InvalidValueError as error:
        raise CellFileError(shown(name, 200)[1:-1], 0, str(error)) from error
    return text_of(content, str(path), CellFileError), str(path), load_robot, path.parent


def load_path(name: str) -> CartesianPath:
    """Return the path of the tool that a file holds. Raises CellFileError."""
    try:
        content = read_regular_file(Path(name), CELL_BYTES_MAX)
    except InvalidValueError as error:
        raise CellFileError(shown(name, 200)[1:-1], 0, str(error)) from error
    return path_from_yaml(text_of(content, name, CellFileError), name)


def cell_file_errors(path: str | Path) -> tuple[CellFileError, ...]:
    """Return everything that is wrong with a cell file, by line; where load_cell reads it, nothing
    is.
    """
    try:
        content = read_regular_file(Path(path), CELL_BYTES_MAX)
        text = text_of(content, str(path), CellFileError)
    except InvalidValueError as error:
        return (CellFileError(shown(str(path))[1:-1], 0, str(error)),)
    except CellFileError as error:
        return (error,)
    return cell_errors(text, str(path), load_robot, Path(path).parent)


def cell_file_line(path: str | Path, subject: str) -> int:
    """Return the line of a cell file on which a machine, a station, a signal, "step 3", "home", ..
    stands; 0: it is not there.
    """
    try:
        text = text_of(read_regular_file(Path(path), CELL_BYTES_MAX), str(path), CellFileError)
    except (InvalidValueError, CellFileError):
        return 0
    return subject_line(text, subject)


def cell_from_yaml(text: str, source: str = "<text>") -> Cell:
    """Return the cell of a text; errors name `source` and line. Mesh files can't be named in a
    text.
    """
    return read_cell(text, source, load_robot, None)


@cache
def _bundled_cell(name: str) -> Cell:
    return read_cell(*_cell_text(name))


# Reading in a process of its own. Its answer is the cell, or the error that reading here raises.

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
    cell = _read_apart(text, name_or_path, several=False)
    assert isinstance(cell, Cell)
    return cell


def read_robot_cells_apart(text: str, name_or_path: str) -> RobotCells | None:
    """The same of the cells of all robots; None: the cell has one robot."""
    cells = _read_apart(text, name_or_path, several=True)
    assert not isinstance(cells, Cell)
    return cells


def _read_here(text: str, name_or_path: str, *, several: bool) -> Cell | RobotCells | None:
    if several:
        source = (text, "<text>", load_robot, None) if text else _cell_text(name_or_path)
        return read_robot_cells(*source)
    return cell_from_yaml(text) if text else load_cell(name_or_path)


def _read_apart(text: str, name_or_path: str, *, several: bool) -> Cell | RobotCells | None:
    quick = 0 < len(text) <= CHARACTERS_HERE
    if quick or (not text and name_or_path in (*bundled_cells(), *bundled_robot_cells())):
        return _read_here(text, name_or_path, several=several)
    process = subprocess.run(
        [sys.executable, "-c", f"from {__name__} import main; main()"],
        input=pickle.dumps((text, name_or_path, several)),
        capture_output=True,
    )
    if process.returncode != 0:
        raise CellFileError(shown(name_or_path)[1:-1] or "<text>", 0, _failure(process))
    answer = pickle.loads(process.stdout)  # written by this module's main
    if isinstance(answer, DescriptionError):
        raise answer
    read: Cell | RobotCells | None = answer
    return read


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
    text, name_or_path, several = pickle.load(sys.stdin.buffer)
    answer: Cell | RobotCells | DescriptionError | None
    try:
        answer = _read_here(text, name_or_path, several=several)
    except DescriptionError as error:
        answer = error
    sys.stdout.buffer.write(pickled(answer))


def pickled(value: Cell | RobotCells | DescriptionError | None) -> bytes:
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
