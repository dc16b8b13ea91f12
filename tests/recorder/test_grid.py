"""Joint states lie on a grid; gaps are counted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_recorder import Analysis, read_recording
from ir_recorder.analysis.results import check_grid


def test_joint_states_lie_on_a_grid_but_for_hibernation(analysis: Analysis) -> None:
    assert analysis.grid.clean
    assert analysis.grid.excused == 2


def test_gaps_and_stray_stamps_are_counted(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    joints = recording.joints
    kept = np.ones(len(recording.joints.time), dtype=bool)
    kept[[10, 11]] = False
    stamps = joints.stamp_ns[kept].copy()
    stamps[50] += 1000
    fields = {
        name: getattr(joints, name)[kept] for name in ("time", "position", "velocity", "effort")
    }
    check = check_grid(replace(joints, stamp_ns=stamps, **fields), recording.power)
    assert len(check.gaps) >= 1
    assert check.gaps[0][1] == pytest.approx(0.006)
    assert check.off_grid >= 1
    assert not check.clean
