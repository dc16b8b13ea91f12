"""Energies between two times are exact at the meter's readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_recorder import analyse, read_recording
from ir_recorder.analysis.meter import Meter

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


def test_the_meter_integrates_a_constant_power_exactly(
    new_run: Callable[[], Any], tmp_path: Path
) -> None:
    run = new_run()
    run.rest(1.0, Mode.BUS_POWER_OFF, HOME, "gripper")
    meter = Meter(read_recording(run.record(tmp_path / "a.mcap")).power)
    assert meter.energy(0.2, 0.7) == pytest.approx(205.0 * 0.5)
    assert meter.base(0.2, 0.7) == pytest.approx(205.0 * 0.5)
    assert meter.peak(0.2, 0.7) == pytest.approx(205.0)


def test_what_readings_at_the_ends_hold_may_belong_to_another_step(
    new_run: Callable[[], Any], tmp_path: Path
) -> None:
    run = new_run()
    run.rest(1.0, Mode.BUS_POWER_OFF, HOME, "gripper")
    meter = Meter(read_recording(run.record(tmp_path / "a.mcap")).power)
    length = float(np.diff(meter.time).max())
    first, second = meter.time[20:22]
    middle = 0.5 * (first + second)
    reading = 205.0 * length
    assert meter.straddling(first, second) == pytest.approx(0.0, abs=1e-6)
    assert meter.straddling(middle, middle + 10.0 * length) == pytest.approx(
        reading
    )  # half of one at each end
    assert meter.straddling(middle, middle + 0.1 * length) == pytest.approx(0.9 * reading)
    assert meter.straddling(meter.time[-1] + 1.0, meter.time[-1] + 2.0) == pytest.approx(
        0.0, abs=1e-6
    )


def test_the_rectifiers_loss_is_counted_and_the_capacitors_by_the_plants_own_mains(
    demo_file: Path,
) -> None:
    """A plant of 540 V holds nothing at 540 V, and what it holds at 560 V is no error of the
    movement.
    """
    recording = read_recording(demo_file)
    power = replace(recording.power, rectifier_loss=np.full(len(recording.power.time), 20.0))
    plant = (
        "dc_link: {capacitance_f: 0.002, mains_v: 540.0, chopper_on_v: 688.0, chopper_off_v: 680.0}"
    )
    volts = replace(power, bus_voltage=np.full(len(power.time), 560.0))
    result = analyse(replace(recording, power=volts, plant_yaml=plant)).steps[0]
    assert result.rectifier_energy == pytest.approx(20.0 * result.seconds, rel=0.02)
    assert result.stored_energy == pytest.approx(0.5 * 0.002 * (560.0**2 - 540.0**2))
    assert analyse(replace(recording, power=volts)).steps[0].stored_energy == 0.0
    damaged = analyse(
        replace(recording, power=volts, power_yaml="nonsense", plant_yaml="dc_link: 3")
    )
    assert damaged.steps[0].stored_energy == 0.0
    assert any("power.yaml can't be read" in problem for problem in damaged.problems)


@pytest.mark.parametrize(("lag", "slip"), [(0.0, 0.0), (0.3, 0.3), (-0.3, 0.3), (60.0, 1.0)])
def test_the_plant_slips_by_what_it_falls_behind_or_makes_up_for(
    new_run: Callable[[], Any], tmp_path: Path, lag: float, slip: float
) -> None:
    run = new_run()
    run.rest(2.0, Mode.BUS_POWER_OFF, HOME, "gripper")
    power = read_recording(run.record(tmp_path / "a.mcap")).power
    assert power is not None
    behind = 0.5 + lag * np.clip(power.time - 0.5, 0.0, 1.0)
    meter = Meter(replace(power, heard=power.time + behind))
    assert meter.slip(0.4, 1.6) == pytest.approx(slip)
    assert meter.slip(1.6, 1.9) == pytest.approx(0.0, abs=1e-9)
