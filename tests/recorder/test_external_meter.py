"""A power meter of its own clock is laid onto a recording, and its joules are those of the
analysis.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ir_recorder import analyse, findings, read_recording
from ir_recorder.analysis.meter import METER, SHARE, with_meter
from ir_recorder.errors import RecorderError
from ir_recorder.report import report_html
from ir_recorder.traces import TraceMapping

# s between the clocks; what the meter reads more
SHIFT = 1234.5
FACTOR = 1.03


def meter_file(recording: Path, path: Path, start: float = 0.0) -> Path:
    """What a meter of 20 readings a second writes, from `start` on."""
    power = read_recording(recording).power
    joules = np.concatenate([[0.0], np.cumsum(power.power[1:] * np.diff(power.time))])
    time = np.arange(power.time[0] + start, power.time[-1], 0.05)
    count = FACTOR * np.interp(time, power.time, joules)
    rows = [f"{t - SHIFT!r},{j!r}" for t, j in zip(time.tolist(), count.tolist(), strict=True)]
    path.write_text("time,energy\n" + "\n".join(rows) + "\n")
    return path


def test_a_meters_clock_is_found_and_its_joules_are_analysed(
    demo_file: Path, tmp_path: Path
) -> None:
    recording = read_recording(demo_file)
    measured = with_meter(recording, meter_file(demo_file, tmp_path / "meter.csv"))
    share = float(measured.fact(SHARE).split()[0])
    assert share == pytest.approx(FACTOR, abs=0.002)
    assert (measured.origin, measured.plant) == ("measured", "measured")
    before = analyse(recording)
    after = analyse(measured)
    for one, other in zip(before.movements, after.movements, strict=True):
        assert other.energy == pytest.approx(FACTOR * one.energy, rel=0.01)
    page = report_html(after, findings(after))
    assert "meter.csv" in page
    assert measured.fact(METER) == "meter.csv"


def test_what_a_meter_does_not_cover_keeps_the_recorded_watts(
    demo_file: Path, tmp_path: Path
) -> None:
    recording = read_recording(demo_file)
    file = meter_file(demo_file, tmp_path / "late.csv", start=4.0)
    power = with_meter(recording, file, TraceMapping(clock_offset=SHIFT)).power
    early = recording.power.time < recording.power.time[0] + 3.9
    assert np.array_equal(power.power[early], recording.power.power[early])
    assert power.energy[-1] > recording.power.energy[-1]
    with pytest.raises(RecorderError, match="covers none of the recording"):
        with_meter(recording, file, TraceMapping(clock_offset=1e6))


def test_a_file_without_power_is_refused(demo_file: Path, tmp_path: Path) -> None:
    (tmp_path / "none.csv").write_text("time,load\n0.0,none\n1.0,none\n")
    with pytest.raises(RecorderError, match="neither power nor energy"):
        with_meter(read_recording(demo_file), tmp_path / "none.csv", TraceMapping(clock_offset=0.0))
