"""Energies between two times are exact at the meter's readings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_recorder import read_recording
from ir_recorder.analysis.meter import Meter

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


def test_the_meter_integrates_a_constant_power_exactly(new_run: Callable[[], Any], tmp_path: Path) -> None:
    run = new_run()
    run.rest(1.0, Mode.BUS_POWER_OFF, HOME, "gripper")
    meter = Meter(read_recording(run.record(tmp_path / "a.mcap")).power)
    assert meter.energy(0.2, 0.7) == pytest.approx(205.0 * 0.5)
    assert meter.base(0.2, 0.7) == pytest.approx(205.0 * 0.5)
    assert meter.peak(0.2, 0.7) == pytest.approx(205.0)
