"""Settings of the statistics from a YAML file."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from ir_description import DescriptionError, is_path, load_cell, load_power_data
from ir_msgs_py.options import OBJECTIVES
from ir_planner import PlannerError
from ir_planner.scene import scene_with
from ir_planner.search import SEARCHES
from ir_sim_driver import DriverError
from ir_sim_driver.plant import TYPICAL, plant_named
from ir_studies.errors import SettingsError
from ir_studies.work import Placed, checked_number, settings_values

FORMAT = "ir_statistics/1"
MOST_PAIRS = 100_000
DRAWN = "drawn"
"""The plant of a pair is typical:NUMBER: robots as they come, independent of each other."""

EXAMPLE = """\
format: ir_statistics/1
cell: demo                   # bundled, or a file
pairs: 60                    # of random places, each driven with both timings
seed: 0                      # what the pairs are drawn from
load: ""                     # what is attached: "" is the tool of the cell, none nothing
planner: direct              # the straight PTP in either timing; "": the portfolio, the cheaper one
objective: time_and_energy   # or time, energy, movement_cost
plant: typical:0             # the robot that drives: nominal, typical:SEED, a file; drawn: one per pair
safety_distance: 0.02        # m; less where an end is nearer
max_iterations: 0            # work of a request; 0: the planner's default
hang_after: 300.0            # s after which a pair is cut
"""  # noqa: E501


@dataclass(frozen=True)
class StatisticsSettings:
    """EXAMPLE says what each means."""

    cell: str
    pairs: int = 60
    seed: int = 0
    load: str = ""
    planner: str = "direct"
    objective: str = "time_and_energy"
    plant: str = "typical:0"
    safety_distance: float = 0.02
    max_iterations: int = 0
    hang_after: float = 300.0

    def __post_init__(self) -> None:
        for name, low, high in _WHOLE:
            checked_number(name, getattr(self, name), low, high, whole=True)
        for name, least, most in _REAL:
            checked_number(name, getattr(self, name), least, most)
        for name in ("cell", "load", "planner", "objective", "plant"):
            if not isinstance(getattr(self, name), str):
                raise SettingsError(f"{name} is {getattr(self, name)!r:.60}: it must be a text")
        if self.objective not in OBJECTIVES:
            raise SettingsError(
                f"objective is {self.objective!r:.60}: known are {', '.join(OBJECTIVES)}"
            )
        if self.planner and self.planner not in SEARCHES:
            known = ", ".join(SEARCHES)
            raise SettingsError(
                f'planner is {self.planner!r:.60}: known are "" (the portfolio), {known}'
            )
        self._check_cell()

    @property
    def budget(self) -> dict[str, Any]:
        """What the row of a pair depends on."""
        kept = asdict(self)
        return {name: kept[name] for name in kept if name not in ("pairs", "hang_after")}

    def plant_of(self, number: int) -> str:
        """Which plant drives the pair of a number."""
        return f"{TYPICAL}:{number}" if self.plant == DRAWN else self.plant

    def _check_cell(self) -> None:
        try:
            cell = load_cell(self.cell)
        except (DescriptionError, OSError) as error:
            raise SettingsError(f"cell: {error}") from error
        try:
            if self.load:
                scene_with(cell, self.load, load_power_data())
        except (DescriptionError, PlannerError) as error:
            raise SettingsError(f"load: {error}") from error
        try:
            plant_named(self.plant_of(0), cell.robot, cell.robot.controller)
        except (DriverError, DescriptionError, OSError) as error:
            other = "" if is_path(self.plant) else f"; or {DRAWN}: one per pair"
            raise SettingsError(f"plant: {error}{other}") from error


_WHOLE = (("pairs", 1, MOST_PAIRS), ("seed", 0, 2**32 - 1), ("max_iterations", 0, 2**32 - 1))
_REAL = (("safety_distance", 0.0, 1.0), ("hang_after", 1.0, 86_400.0))


def statistics_settings(content: str, placed: Placed) -> StatisticsSettings:
    """The settings of a text. placed: where cell and plant are. Raises SettingsError for settings
    that make no sense.
    """
    values = settings_values(content, FORMAT, [field.name for field in fields(StatisticsSettings)])
    if "cell" not in values:
        raise SettingsError("cell is missing: the name of a bundled cell, or a file")
    if isinstance(values["cell"], str):
        values["cell"] = placed(values["cell"])
    plant = values.get("plant")
    if isinstance(plant, str) and is_path(plant):
        values["plant"] = placed(plant)
    return StatisticsSettings(**values)
