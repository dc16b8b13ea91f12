"""The cell as it stands, and scenes of it with what the driver says."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from threading import Lock

from ir_description import Cell, PowerData, RobotModel, cell_from_yaml, cell_hash, load_cell
from ir_description.cell import cell_in
from ir_msgs_py.announcements import DATA, DRIVER, CarriedLoad, ControllerTimers, MachineState
from ir_msgs_py.modes import TransitionTimes
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, unknown_name
from ir_planner.program import Doors
from ir_planner.scene import Drives, PlanningScene, load_text, scene_with
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, PoseError, UnknownNameError


class DriverReports:
    """timers, load, machines: what the driver says, None while no driver does. settings: asked for
    the transition times where no driver says them.
    """

    def __init__(self, settings: Callable[[], TransitionTimes]) -> None:
        self._settings = settings
        self.timers: ControllerTimers | None = None
        self.load: CarriedLoad | None = None
        self.machines: tuple[MachineState, ...] | None = None

    def of(self, data: PowerData) -> PowerData:
        """A controller's figures as its file has them, with the timer that counts."""
        if self.timers is None or not data.has_table:
            return data
        return replace(data, motors_to_brakes_in_program=self.timers.brakes_after)

    @property
    def transitions(self) -> TransitionTimes:
        """Transition times that count."""
        return self._settings() if self.timers is None else self.timers.transitions

    @property
    def source(self) -> str:
        """Where timer and transition times are from."""
        return DATA if self.timers is None else DRIVER

    def doors(self, cell: Cell) -> Doors:
        """Machines of a cell with a switch that are not as the cell has them, as the driver
        says.
        """
        return tuple(self._doors(cell))

    def _doors(self, cell: Cell) -> Iterator[tuple[str, tuple[str, ...]]]:
        heard = {each.equipment: each for each in self.machines or ()}
        for machine in cell.equipment:
            said = heard.get(machine.name)
            if said is None or machine.switch is None or not machine.enabled:
                continue
            states = (said.state, said.next) if said.next else (said.state,)
            known = {state.name for state in machine.states}
            if known.issuperset(states) and states != (machine.state,):
                yield machine.name, states


ReadCell = Callable[[str, str], Cell]
"""Gives the cell of a text, or else of a path or a bundled name."""
_Key = tuple[str, Doors, Drives, float]


def read_cell_here(cell_yaml: str, cell_file: str) -> Cell:
    """The cell of a text, or else of a path or a bundled name; raises DescriptionError."""
    return cell_from_yaml(cell_yaml) if cell_yaml else load_cell(cell_file)


def exactly_one(cell_yaml: str, cell_file: str) -> None:
    """Raise RequestError unless either the text of a cell or its file is given."""
    if bool(cell_yaml) == bool(cell_file):
        given = "both are" if cell_yaml else "neither is"
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"exactly one of cell_yaml and cell_file must be given, {given}",
        )


class CurrentCell:
    """Holds one immutable cell after the other; a scene that was taken never changes.

    heard: what the driver says. drives: asked for each scene, what is assumed of those of a robot.
    power: the controller's figures, None: those of the cell's robot. Changes wait for each other,
    readers for none: a cell is replaced when it is read and its models are built.
    """

    def __init__(
        self,
        heard: DriverReports,
        drives: Callable[[RobotModel], Drives],
        power: PowerData | None = None,
        read: ReadCell = read_cell_here,
    ) -> None:
        self._heard = heard
        self._drives = drives
        self._power = power
        self._read = read
        self._cell: Cell | None = None
        self._changing = Lock()
        self._hashed: tuple[Cell | None, str] = None, ""
        # the scene of each load and of machines as they stand; its models take a millisecond to
        # build, and nothing in it ever changes
        self._scenes: dict[_Key, tuple[Cell, PlanningScene]] = {}

    @property
    def cell(self) -> Cell:
        """The cell as it stands. Raises RequestError while there is none."""
        if self._cell is None:
            raise RequestError(
                StatusCode.INVALID_OBJECT_NAME, "no cell is loaded: call set_cell first"
            )
        return self._cell

    @property
    def loaded(self) -> bool:
        """Whether there is a cell."""
        return self._cell is not None

    def load(self, cell_yaml: str, cell_file: str) -> Cell:
        """Another cell, from its text, or from a path or the name of a bundled cell.

        Raises RequestError where not exactly one is given, DescriptionError for what is wrong with
        the cell.
        """
        exactly_one(cell_yaml, cell_file)
        with self._changing:
            return self._replaced_by(self._read(cell_yaml, cell_file))

    def take(self, cell: Cell) -> Cell:
        """Another cell, given as a value."""
        with self._changing:
            return self._replaced_by(cell)

    def set_equipment(
        self, name: str, pose: FloatArray | None, enabled: bool | None, state: str
    ) -> Cell:
        """Move a machine to a pose (4, 4), switch it on or off, or change its state (None, "":
        unchanged). Raises RequestError for a machine, pose or state that the cell can't have.
        """
        with self._changing:
            cell = self.cell
            if name not in [machine.name for machine in cell.equipment]:
                raise unknown_name("equipment", name, (machine.name for machine in cell.equipment))
            try:
                changed = cell.with_equipment(name, pose, enabled, state or None)
            except UnknownNameError as error:
                raise RequestError(StatusCode.INVALID_OBJECT_NAME, str(error)) from error
            except PoseError as error:
                raise RequestError(StatusCode(error.code), str(error)) from error
            except InvalidValueError as error:
                raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, str(error)) from error
            return self._replaced_by(changed)

    def hash_of(self, cell: Cell) -> str:
        """Content hash of a cell; of the same one made once."""
        known, content = self._hashed
        if known is not cell:
            content = cell_hash(cell)
            self._hashed = cell, content
        return content

    def scene(self, load: str = "") -> PlanningScene:
        """Snapshot of the cell with `load` attached; "" = what the robot carries, and while no
        driver says so the tool. Machines with a switch are as the driver says, and while none does
        as the cell has them.
        """
        cell = self.cell
        key = self._key(load or self._attached(cell), cell)
        known, scene = self._scenes.get(key, (None, None))
        if scene is None or known is not cell:
            scene = self._scene_of(cell, key[0], key[1])
            self._scenes[key] = cell, scene
        return scene

    def power(self, cell: Cell) -> PowerData:
        """The figures of a cell's controller as planned with, with the timer that counts."""
        return self._heard.of(self._drives(cell.robot).power(self._power or cell.robot.controller))

    def _key(self, load: str, cell: Cell) -> _Key:
        return (
            load,
            self._heard.doors(cell),
            self._drives(cell.robot),
            self.power(cell).motors_to_brakes_in_program,
        )

    def _scene_of(self, cell: Cell, load: str, doors: Doors) -> PlanningScene:
        drives = self._drives(cell.robot)
        scene = scene_with(cell_in(cell, dict(doors)), load, self.power(cell), drives)
        return replace(scene, cell_hash=self.hash_of(cell), doors=doors)

    def _replaced_by(self, cell: Cell) -> Cell:
        """Take this cell from now on. Its models of all pairs are built first, which takes a second
        in a large one.
        """
        try:
            load = self._attached(cell)
        except RequestError:  # of requests without a load, as long as the driver carries that
            load = load_text(cell)
        key = self._key(load, cell)
        scene = self._scene_of(cell, load, key[1])
        scene.thresholds(0.0)
        self._scenes = {key: (cell, scene)}  # nothing of former cells is kept
        self._cell = cell
        return cell

    def _attached(self, cell: Cell) -> str:
        """The load text of what is attached. Raises RequestError where the cell doesn't know
        that.
        """
        carried = self._heard.load
        if carried is None:
            return load_text(cell)
        tool = (cell.tool.name,) if cell.tool is not None else ()
        known = (*tool, *(part.name for part in cell.parts), NO_LOAD)
        if set(carried.text.split(LOAD_SEPARATOR)) <= set(known):
            return carried.text
        raise RequestError(
            StatusCode.INVALID_OBJECT_NAME,
            f"no load is given and the robot carries {carried.text!a} ({carried.mass:g} kg), "
            f"which cell {cell.name!a} doesn't know: its own is {load_text(cell)!r}, name one of "
            f"{', '.join(known)}",
        )
