"""The cell as it stands now, and the scenes that requests take of it."""

from collections.abc import Callable

from ir_description import Cell, PowerData, cell_from_yaml, load_cell
from ir_kernels.power import Regeneration
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, UnknownNameError
from ir_planner.scene import PlanningScene, load_text, scene_with


class CurrentCell:
    """Holds one immutable cell after the other; a scene that was taken never changes.

    braking_energy: asked for each scene, what the drives' bus does with it.
    """

    def __init__(self, power: PowerData, braking_energy: Callable[[], Regeneration]) -> None:
        self._power, self._braking_energy = power, braking_energy
        self._cell: Cell | None = None
        # the scene of each load; its models take a millisecond to build, and nothing in it ever changes
        self._scenes: dict[tuple[str, str], tuple[Cell, PlanningScene]] = {}

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

    def scene(self, load: str = "") -> PlanningScene:
        """Snapshot of the cell with `load` attached; "" = what is attached when its program starts: the
        tool.
        """
        cell, braking = self.cell, self._braking_energy()
        key = load or load_text(cell), braking
        known, scene = self._scenes.get(key, (None, None))
        if scene is None or known is not cell:
            scene = scene_with(cell, key[0], self._power, braking)
            self._scenes[key] = cell, scene
        return scene
