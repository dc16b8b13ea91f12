"""The motion and the parts in the picture in 3D are those of the recording."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np

from ir_description import load_cell
from ir_recorder import read_recording
from ir_recorder.reading.recording import TextEvent
from ir_recorder.report.cell_scene import door_bodies


def test_the_motion_is_in_the_page_to_a_hundredth_of_a_degree(
    page: str, demo_file: Path, data_of: Any
) -> None:
    scene = data_of(page)["scene"]
    counts = np.frombuffer(base64.b64decode(scene["jointValues"]), dtype="<i2").reshape(
        scene["frames"], 6
    )
    joints = read_recording(demo_file).joints
    np.testing.assert_allclose(counts[0] * scene["jointSteps"], joints.position[0], atol=1.1e-4)
    np.testing.assert_allclose(counts[-1] * scene["jointSteps"], joints.position[-1], atol=1.1e-4)


def test_a_part_moves_from_station_to_hand_to_station(page: str, data_of: Any) -> None:
    (part,) = data_of(page)["scene"]["parts"]
    assert [where is not None for _, where in part["lies"]] == [True, False, True]


def test_doors_come_and_go_with_their_states_and_show_what_they_sweep() -> None:
    cell = load_cell("demo")
    texts = (
        (0.2, "door_open"),
        (5.0, "door_open>door_closed"),
        (6.5, "door_closed"),
        (7.0, "of another cell"),
    )
    bodies = door_bodies(cell, [TextEvent(time, "lathe", text) for time, text in texts])
    lathe = {each["name"]: each for each in bodies if each["owner"] == "lathe"}
    ends = {
        state: cell.with_equipment("lathe", state=state) for state in ("door_open", "door_closed")
    }
    for time, state in ((1.0, "door_open"), (6.9, "door_closed"), (9.0, "door_closed")):
        there = {
            name
            for name, each in lathe.items()
            if [now for at, now in each["shown"] if at <= time][-1]
        }
        assert there == {body.name for body in ends[state].machine("lathe").world_bodies()}
    swept = [each for each in lathe.values() if each["sweep"]]
    assert swept
    assert all(each["shown"] == [[-1e9, False], [5.0, True], [6.5, False]] for each in swept)
    assert all(each["shown"] == [[-1e9, True]] for each in bodies if each["owner"] != "lathe")
