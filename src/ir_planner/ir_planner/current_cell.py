"""The cell as it stands now, and the scenes that requests take of it and of what the robot carries."""

from collections.abc import Callable
from dataclasses import replace

from ir_description import Cell, cell_from_yaml, cell_hash, load_cell
from ir_kernels.power import Regeneration
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, UnknownNameError
from ir_planner.heard import Heard
from ir_planner.scene import PlanningScene, load_text, scene_with


class CurrentCell:
    """Holds one immutable cell after the other; a scene that was taken never changes.

    heard: what the driver says. braking_energy: asked for each scene, what the drives' bus does with it.
    """

    def __init__(self, heard: Heard, braking_energy: Callable[[], Regeneration]) -> None:
        self._heard, self._braking_energy = heard, braking_energy
        self._cell: Cell | None = None
        self._hashed: tuple[Cell | None, str] = None, ""
        # the scene of each load; its models take a millisecond to build, and nothing in it ever changes
        self._scenes: dict[tuple[str, str, float], tuple[Cell, PlanningScene]] = {}

    @property
    def cell(self) -> Cell:
        """The cell as it stands. Raises RequestError while there is none."""
        if self._cell is None:
            raise RequestError(StatusCode.INVALID_OBJECT_NAME, "no cell is loaded: call set_cell first")
        return self._cell

    @property
    def loaded(self) -> bool:
        """Whether there is a cell."""
        return self._cell is not None

    def load(self, cell_yaml: str, cell_file: str) -> Cell:
        """Another cell, from its text, or from a path or the name of a bundled cell.

        Raises RequestError where not exactly one is given, DescriptionError for what is wrong with the cell.
        """
        if bool(cell_yaml) == bool(cell_file):
            given = "both are" if cell_yaml else "neither is"
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"exactly one of cell_yaml and cell_file must be given, {given}",
            )
        self._cell = cell_from_yaml(cell_yaml) if cell_yaml else load_cell(cell_file)
        return self._cell

    def set_equipment(self, name: str, pose: FloatArray | None, enabled: bool, state: str) -> Cell:
        """Move a machine to a pose (4, 4), switch it on or off, or change its state (None, "": unchanged)."""
        cell = self.cell
        if name not in [machine.name for machine in cell.equipment]:
            raise UnknownNameError("equipment", name, (machine.name for machine in cell.equipment))
        self._cell = cell.with_equipment(name, pose, enabled, state or None)
        return self._cell

    def hash_of(self, cell: Cell) -> str:
        """Content hash of a cell; of the same one made once."""
        known, content = self._hashed
        if known is not cell:
            content = cell_hash(cell)
            self._hashed = cell, content
        return content

    def scene(self, load: str = "") -> PlanningScene:
        """Snapshot of the cell with `load` attached; "" = what the robot carries, and while no driver says
        so the tool.
        """
        cell, power, braking = self.cell, self._heard.data, self._braking_energy()
        key = load or self._attached(cell), braking, power.motors_to_brakes_in_program
        known, scene = self._scenes.get(key, (None, None))
        if scene is None or known is not cell:
            scene = replace(scene_with(cell, key[0], power, braking), cell_hash=self.hash_of(cell))
            self._scenes[key] = cell, scene
        return scene

    def _attached(self, cell: Cell) -> str:
        """The load text of what is attached. Raises RequestError where the cell doesn't know that."""
        carried = self._heard.load
        if carried is None:
            return load_text(cell)
        tool = (cell.tool.name,) if cell.tool is not None else ()
        known = (*tool, *(part.name for part in cell.parts), NO_LOAD)
        if set(carried.text.split(LOAD_SEPARATOR)) <= set(known):
            return carried.text
        raise RequestError(
            StatusCode.INVALID_OBJECT_NAME,
            f"no load is given and the robot carries {carried.text!a} ({carried.mass:g} kg), which cell "
            f"{cell.name!a} doesn't know: its own is {load_text(cell)!r}, name one of {', '.join(known)}",
        )
