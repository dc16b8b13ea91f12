"""Files of an earlier version are read: a recording, a cell, its robot, power parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ir_description import load_cell
from ir_description.library import load_power_parameters
from ir_recorder.reading.reader import read_recording

EARLIER = Path(__file__).parent / "earlier"


def test_a_recording_of_an_earlier_version_is_read_in_full() -> None:
    """20 positions and powers at 100 Hz."""
    recording = read_recording(EARLIER / "recording.mcap")
    joints = recording.joints
    power = recording.power
    assert joints is not None
    assert power is not None
    assert all("isn't in the recording" in problem for problem in recording.problems)
    assert np.array_equal(joints.position[:, 0], 0.01 * np.arange(20))
    assert np.array_equal(power.power, 500.0 + np.arange(20))


def test_a_cell_with_its_robot_of_an_earlier_version_is_what_the_bundled_one_is() -> None:
    cell = load_cell(EARLIER / "cell.yaml")
    bundled = load_cell("kr6_bench")
    assert [each.name for each in cell.equipment] == [each.name for each in bundled.equipment]
    assert np.array_equal(cell.machine_home, bundled.machine_home)
    assert len(cell.program) == len(bundled.program)
    assert cell.robot.joint_names == bundled.robot.joint_names


def test_power_parameters_of_an_earlier_version_are_read() -> None:
    parameters = load_power_parameters(str(EARLIER / "power.yaml"))
    assert np.allclose(parameters.mean, load_power_parameters().mean, rtol=1e-6)
