"""The content hash of a cell: another for anything that a plan depends on, and for nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import bundled_cells, cell_from_yaml, cell_hash, cell_to_yaml, load_cell

DEMO = load_cell("demo")


@pytest.mark.parametrize("name", bundled_cells())
def test_a_cell_that_is_written_and_read_again_has_the_same_hash(name: str) -> None:
    cell = load_cell(name)
    assert cell_hash(cell_from_yaml(cell_to_yaml(cell))) == cell_hash(cell)


def test_cells_differ() -> None:
    assert len({cell_hash(load_cell(name)) for name in bundled_cells()}) == len(bundled_cells())


def test_what_is_said_and_asked_does_not_count() -> None:
    machines = tuple(replace(machine, switch=None) for machine in DEMO.equipment)
    still = replace(DEMO, equipment=machines)
    other = replace(still, description="the same", program=(), signals=(), tasks=())
    assert cell_hash(other) == cell_hash(still)


def test_a_door_that_a_signal_moves_does_not_count_a_door_of_another_kind_does() -> None:
    door = DEMO.machine("lathe")
    assert door.switch is not None
    assert cell_hash(DEMO.with_equipment("lathe", state=door.switch.off)) == cell_hash(DEMO)
    fixed = replace(
        DEMO, equipment=tuple(replace(machine, switch=None) for machine in DEMO.equipment)
    )
    shut = fixed.with_equipment("lathe", state=door.switch.off)
    assert cell_hash(shut) != cell_hash(fixed)


def test_texts_do_not_count() -> None:
    other = replace(DEMO, description="the same", program=(), tasks=())
    assert cell_hash(other) == cell_hash(DEMO)


@given(
    st.sampled_from([machine.name for machine in DEMO.equipment]),
    st.sampled_from(["pose", "enabled"]),
    st.floats(1e-9, 1.0),
)
@settings(deadline=None, max_examples=40)
def test_moving_or_switching_a_machine_counts(name: str, what: str, by: float) -> None:
    machine = DEMO.machine(name)
    pose = machine.pose.copy()
    pose[0, 3] += by
    changed = (
        DEMO.with_equipment(name, pose)
        if what == "pose"
        else DEMO.with_equipment(name, enabled=False)
    )
    assert cell_hash(changed) != cell_hash(DEMO)
    back = changed.with_equipment(name, machine.pose, enabled=machine.enabled)
    assert cell_hash(back) == cell_hash(DEMO)


def test_loads_places_and_the_tcp_count() -> None:
    tool = DEMO.tool
    assert tool is not None
    tcp = np.array(DEMO.tcp)
    tcp[2, 3] += 0.001
    changed = [
        replace(DEMO, tool=replace(tool, mass=tool.mass + 0.1)),
        replace(DEMO, tool=replace(tool, watts_always=tool.watts_always + 1.0)),
        replace(DEMO, parts=tuple(replace(part, station="") for part in DEMO.parts), program=()),
        replace(DEMO, tcp=tcp),
    ]
    assert len({cell_hash(cell) for cell in [DEMO, *changed]}) == len(changed) + 1
