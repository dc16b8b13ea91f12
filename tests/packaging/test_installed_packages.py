"""One installed package serves every port: each is asked for by its name, and nothing else asks."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from ir_description import UnknownNameError, load_cell, load_power_data, load_robot
from ir_description.cell import shape_register
from ir_description.files import bundled_controllers
from ir_description.files.worlds import read_world
from ir_planner import Planner, PlanOptions
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search import Ends, Found
from ir_planner.search.registry import made_search
from ir_planner.service import EXIT_SEARCHES
from ir_recorder.errors import RecorderError
from ir_recorder.traces import read_traces
from ir_sim_driver import SimulationSettings
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant import make_backend
from ir_sim_driver.plc import LINKS, WRITERS, usable_links
from ir_values.errors import InvalidValueError

MODULE = '''
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar
import numpy as np
from ir_description.files.worlds import World, WorldMachine
from ir_description.shapes import Body
from ir_planner.service import ModifiedGa
from ir_recorder.traces import Trace
from ir_sim_driver.plant import Plant
from ir_sim_driver.plc import Link
from ir_values.settings import setting

class Mine(ModifiedGa):
    """The withdrawal of the paper under another title."""
    title = "mine"

def backend(cell, dt, control, plant):
    from ir_sim_driver.plant.ideal_backend import IdealBackend
    return IdealBackend(cell.robot, dt, cell.base_pose)

@dataclass(frozen=True)
class Bus:
    """Bits over nothing."""
    name: ClassVar[str] = "my_bus"
    sets_inputs: ClassVar[bool] = True
    my_bus_host: str = setting("127.0.0.1", "Address.", read_only=True)
    my_bus_port: int = setting(5999, "Port.", minimum=0, maximum=65535, read_only=True)
    my_bus: bool = setting(False, "Whether it serves.", read_only=True)
    @property
    def wanted(self):
        return self.my_bus
    def open(self, controller):
        raise OSError('there is no bus')

KR_X = Path(__file__).with_name("kr_x.yaml")

def world(path):
    ball = Body("b", "sphere", np.eye(4), np.array([0.1, 0, 0]))
    return World("w", (WorldMachine("m", np.eye(4), (ball,)),), ())

def log(path):
    return [Trace(str(path), np.arange(3.0), {"joint_a1": np.zeros(3)})]
'''
ENTRIES = """
[ir_planner.exit_searches]
mine = everything_mine:Mine
[ir_sim_driver.backends]
mine = everything_mine:backend
[ir_sim_driver.links]
my_bus = everything_mine:Bus
[ir_description.controllers]
kr_x = everything_mine:KR_X
[ir_description.worlds]
blob = everything_mine:world
[ir_recorder.traces]
blob = everything_mine:log
"""


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package, as pip would install it."""
    info = tmp_path / "everything-2.0.dist-info"
    info.mkdir()
    (tmp_path / "everything_mine.py").write_text(MODULE)
    table = Path(str(files("ir_description") / "data" / "power" / "kr_c4.yaml"))
    shutil.copy(table, tmp_path / "kr_x.yaml")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: everything\nVersion: 2.0\n")
    (info / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(str(tmp_path))


@dataclass(frozen=True)
class Demanding:
    """A search whose method wants more than the port gives."""

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
        return Found([])


def test_a_search_that_wants_more_than_the_port_gives_is_refused_before_it_is_asked() -> None:
    with pytest.raises(InvalidValueError, match=r"takes ends, space and seed: .*'work'"):
        made_search("demanding", Demanding)


def test_an_exit_search_is_asked_by_name_and_says_whose_it_is() -> None:
    planner = Planner("demo", clock=lambda: 0.0)
    near = np.array(planner.cell.park)
    options = PlanOptions(planner_id="mine")
    plan = planner.plan_service("lathe_work", near=near, max_candidates=1, options=options)
    assert plan.status.ok, plan.status.message
    assert plan.candidates[0].method == "mine"
    assert any(stage.note.startswith("everything 2.0; ") for stage in plan.info.stages)
    usual = planner.plan_service("lathe_work", near=near, max_candidates=1)
    assert usual.candidates[0].method in EXIT_SEARCHES.own


def test_a_backend_is_made_by_its_name() -> None:
    cell = load_cell("open")
    settings = SimulationSettings()
    assert make_backend("mine", cell, settings.dt, settings.control).standing
    with pytest.raises(SettingsError, match="known are pybullet, ideal, mine"):
        make_backend("yours", cell, settings.dt, settings.control)


def test_a_link_has_parameters_and_opens_nothing_by_itself() -> None:
    assert LINKS["my_bus"] in usable_links()
    assert not LINKS["my_bus"]().wanted
    assert "my_bus" not in WRITERS  # of a process that began without the package


def test_a_controllers_table_is_read_by_its_name() -> None:
    assert "kr_x" in bundled_controllers()
    assert load_power_data("kr_x").modes
    with pytest.raises(UnknownNameError):
        load_power_data("kr_y")


def test_worlds_and_logs_are_read_by_their_endings(tmp_path: Path) -> None:
    file = tmp_path / "thing.blob"
    file.write_text("?")
    assert read_world(file, shape_register(load_robot())).machines[0].name == "m"
    (trace,) = read_traces(file, None, ("joint_a1",))
    assert len(trace.time) == 3
    with pytest.raises(RecorderError, match=r"\.pb, \.blob"):
        read_traces(tmp_path / "thing.else", None, ("joint_a1",))
