"""Settings of a layout study from a YAML file: what moves, in which ranges, at which cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from itertools import product
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from ir_description import Cell, DescriptionError, load_cell
from ir_description.cell import POSTURES
from ir_msgs_py.options import ROBOTS_TIME_VALUE
from ir_studies.errors import SettingsError
from ir_studies.layout.placement import (
    JOINTS,
    TURNS,
    PlacementCondition,
    Placing,
    Range,
    Variable,
    variables,
)
from ir_studies.work import (
    Placed,
    beside,
    checked_known,
    checked_number,
    checked_numbers,
    read_text,
    settings_values,
)

EXAMPLE = """\
format: ir_layout/1
cell: demo                   # bundled, or a file beside this one

# What may move, and how far from where it stands in the cell file. x, y, z: m along the axes of the cell;
# turn_deg: about its own vertical. A key that is left out does not move.
base: {x: [-0.3, 0.3], y: [-0.3, 0.3], z: [0, 0.2], turn_deg: [-20, 20]}
carried: []                  # machines that move with the base, as the pedestal below it
equipment:
  gauge: {x: [-0.3, 0.2], y: [-0.4, 0.4], turn_deg: [-20, 20]}
  outfeed: {x: [-0.2, 0.3], y: [-0.3, 0.3]}
park: {a1_deg: [-40, 40], a2_deg: [-5, 30]}   # joint angles, from those of the posture park
tool: {}                     # x, y, z in m, a_deg, b_deg, c_deg: its mounting, in the last link's frame

# What every placement is planned for; its cost is the mean over all of them.
cycle_times: [0]             # s; 0: free
payloads: {}                 # masses of parts in kg: {gear: [10, 20]}; {}: as in the cell file
stations: []                 # visited instead of the cell's program

method: spread               # or grid: `steps` values of every variable, all combined
placements: 200              # looked at: half of them spread over the ranges, the others near the best so far
steps: 5
rounds: 3                    # the ranges around the best are halved from round to round
keep: 5                      # of the best: written as cell files, planned with all seeds
seeds: 3
seed: 0                      # of the placements that are looked at
plans: 0                     # placements that are planned in full, at most; 0: as many as could be the best
margin: 0.01                 # share of the cost by which a placement may be better than its bound says

time_value: 500.0            # W in J = energy of the drives + time_value x T, without a cycle time; left out: the robot's own
safety_distance: 0.02        # m
max_iterations: 0            # work of a plan; 0: the planner's default
hang_after: 600.0            # s after which a job is cut
"""  # noqa: E501

FORMAT = "ir_layout/1"
METHODS = ("spread", "grid")
MOST_PLACEMENTS = 100_000
MOST_CONDITIONS = 50
MOST_NAMES = 1000
Ranges: TypeAlias = "Mapping[str, Range]"
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class LayoutSettings:
    """EXAMPLE says what each key means."""

    cell: str
    base: Ranges = field(default_factory=dict)
    carried: tuple[str, ...] = ()
    equipment: Mapping[str, Ranges] = field(default_factory=dict)
    park: Ranges = field(default_factory=dict)
    tool: Ranges = field(default_factory=dict)
    payloads: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    cycle_times: tuple[float, ...] = (0.0,)
    stations: tuple[str, ...] = ()
    method: str = "spread"
    placements: int = 200
    steps: int = 5
    rounds: int = 3
    keep: int = 5
    seeds: int = 3
    seed: int = 0
    plans: int = 0
    margin: float = 0.01
    time_value: float = ROBOTS_TIME_VALUE
    safety_distance: float = 0.02
    max_iterations: int = 0
    hang_after: float = 600.0

    def __post_init__(self) -> None:
        if self.time_value == ROBOTS_TIME_VALUE:
            object.__setattr__(self, "time_value", _cell(self.cell).robot.time_value)
        checked_numbers(self, _WHOLE, _REAL)
        if self.method not in METHODS:
            raise SettingsError(f"method is {self.method!r:.60}: known are {', '.join(METHODS)}")
        cell = _cell(self.cell)
        self._check_names(cell)
        self._check_conditions()
        for name, value in _in_order(self, cell).items():
            object.__setattr__(self, name, value)
        if not self.variables:
            raise SettingsError("nothing may move: give ranges to base, equipment, park or tool")
        if self.method == "grid" and self.steps ** len(self.variables) > MOST_PLACEMENTS:
            points = f"{self.steps} steps of {len(self.variables)} variables"
            raise SettingsError(f"a grid of {points} has more than {MOST_PLACEMENTS} placements")

    @property
    def placing(self) -> Placing:
        """How values become a cell."""
        return Placing(self.carried)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """What may move: base, park, tool, then machines in the order of the cell."""
        groups = {"base": self.base, "park": self.park, "tool": self.tool}
        machines = {f"equipment.{name}": ranges for name, ranges in self.equipment.items()}
        return variables({**groups, **machines})

    @property
    def conditions(self) -> tuple[PlacementCondition, ...]:
        """All cycle times with all masses."""
        masses = product(*self.payloads.values())  # few: _check_conditions counts them first
        payloads = [tuple(zip(self.payloads, one, strict=True)) for one in masses]
        return tuple(
            PlacementCondition(cycle, payload) for payload in payloads for cycle in self.cycle_times
        )

    @property
    def in_cycles(self) -> bool:
        """Whether joules in a cycle time count, which are not in the unit of coarse movements,
        J.
        """
        return any(self.cycle_times)

    @property
    def budget(self) -> dict[str, Any]:
        """What a row depends on beside its placement, condition and seed."""
        names = ("carried", "stations", "time_value", "safety_distance", "max_iterations")
        return {name: getattr(self, name) for name in names}

    def _check_names(self, cell: Cell) -> None:
        machines = [machine.name for machine in cell.equipment]
        checked_known("equipment", self.equipment, machines)
        checked_known("carried", self.carried, machines)
        stations = [one.name for one in cell.stations]
        paths = [one.name for one in cell.paths]
        checked_known("stations", self.stations, [*stations, *paths, *POSTURES])
        checked_known("payloads", self.payloads, [part.name for part in cell.parts])
        checked_known("park", self.park, JOINTS[: cell.robot.n])
        for name in ("base", "tool"):
            checked_known(name, getattr(self, name), TURNS[name])
        for machine, ranges in self.equipment.items():
            checked_known(f"equipment: {machine}", ranges, TURNS["equipment"])
        if self.tool and cell.tool is None:
            raise SettingsError(f"tool: the cell {cell.name} has none")
        if not (self.stations or cell.program):
            raise SettingsError(f"the cell {cell.name} has no program: name its stations")

    def _check_conditions(self) -> None:
        count = math.prod([len(self.cycle_times), *map(len, self.payloads.values())])
        if not 0 < count <= MOST_CONDITIONS:
            said = f"cycle_times and payloads make {count} conditions"
            raise SettingsError(f"{said}: 1 to {MOST_CONDITIONS}")
        for cycle in self.cycle_times:
            checked_number("cycle_times", cycle, 0.0, 604_800.0)
        for part, masses in self.payloads.items():
            for mass in masses:
                checked_number(f"payloads: {part}", mass, 0.001, 2000.0)


def _in_order(settings: LayoutSettings, cell: Cell) -> dict[str, Any]:
    """The names of settings in the order of the cell: in which order a file has them says
    nothing.
    """

    def ordered(values: Mapping[str, _Value], names: Iterable[str]) -> dict[str, _Value]:
        return {name: values[name] for name in dict.fromkeys(names) if name in values}

    machines = [one.name for one in cell.equipment]
    turns = TURNS["equipment"]
    equipment = ordered(settings.equipment, machines)
    return {
        "base": ordered(settings.base, TURNS["base"]),
        "park": ordered(settings.park, JOINTS),
        "tool": ordered(settings.tool, TURNS["tool"]),
        "carried": tuple(name for name in machines if name in settings.carried),
        "equipment": {name: ordered(own, turns) for name, own in equipment.items()},
        "payloads": ordered(settings.payloads, [part.name for part in cell.parts]),
    }


_WHOLE = (
    ("placements", 1, MOST_PLACEMENTS),
    ("steps", 2, 1000),
    ("rounds", 1, 20),
    ("keep", 1, 100),
    ("seeds", 1, 100),
    ("seed", 0, 2**32 - 1),
    ("plans", 0, MOST_PLACEMENTS),
    ("max_iterations", 0, 100_000_000),
)
_REAL = (
    ("margin", 0.0, 1e3),
    ("time_value", 0.0, 1e6),
    ("safety_distance", 0.0, 1.0),
    ("hang_after", 1.0, 86_400.0),
)


def read_layout(path: str | Path) -> LayoutSettings:
    """The settings of a YAML file; a cell file counts from its folder. SettingsError names the
    key.
    """
    content = read_text(path)
    try:
        return layout_settings(content, beside(path))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from error


def layout_settings(content: str, placed: Placed) -> LayoutSettings:
    """The settings of a text. placed: where a cell is. Raises SettingsError for settings that make
    no sense.
    """
    values = settings_values(content, FORMAT, [each.name for each in fields(LayoutSettings)])
    if not isinstance(values.get("cell"), str):
        raise SettingsError("cell is missing: the name of a bundled cell, or a file")
    values["cell"] = placed(values["cell"])
    for name in ("base", "park", "tool"):
        if name in values:
            values[name] = _ranges(name, values[name])
    if "equipment" in values:
        machines = _mapping("equipment", values["equipment"])
        values["equipment"] = {
            name: _ranges(f"equipment: {name}", one) for name, one in machines.items()
        }
    if "payloads" in values:
        payloads = _mapping("payloads", values["payloads"])
        values["payloads"] = {
            name: _list(f"payloads: {name}", one) for name, one in payloads.items()
        }
    for name in ("carried", "stations", "cycle_times"):
        if name in values:
            values[name] = _list(name, values[name])
    return LayoutSettings(**values)


def _mapping(key: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(name, str) for name in value):
        raise SettingsError(f"{key} is {value!r:.60}: it must be names with values")
    return value


def _list(key: str, value: Any) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise SettingsError(f"{key} is {value!r:.60}: it must be a list")
    if len(value) > MOST_NAMES:
        raise SettingsError(f"{key} has {len(value)} values: at most {MOST_NAMES}")
    if key != "stations" and any(value.count(one) > 1 for one in value):
        raise SettingsError(f"{key} names one twice")
    return tuple(value)


def _ranges(key: str, value: Any) -> dict[str, Range]:
    found = {}
    for name, ends in _mapping(key, value).items():
        if not isinstance(ends, list) or len(ends) != 2:
            raise SettingsError(f"{key}: {name} is {ends!r:.60}: it must be [lowest, highest]")
        most = 360.0 if name.endswith("_deg") else 100.0
        for end in ends:
            checked_number(f"{key}: {name}", end, -most, most)
        if ends[0] > ends[1]:
            raise SettingsError(f"{key}: {name} is {ends}: the lowest comes first")
        found[name] = float(ends[0]), float(ends[1])
    return found


def _cell(name: str) -> Cell:
    try:
        return load_cell(name)
    except (DescriptionError, OSError) as error:
        raise SettingsError(f"cell: {error}") from error


__all__ = [
    "EXAMPLE",
    "FORMAT",
    "LayoutSettings",
    "PlacementCondition",
    "layout_settings",
    "read_layout",
]
