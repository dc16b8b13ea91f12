"""Power at rest comes out of a recording alone, and Table II where the load is the paper's."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import pytest

from ir_recorder import Analysis, analyse
from ir_recorder.analysis.production import idle_watts
from ir_recorder.format import contents
from ir_recorder.recording.cell_files import data_of_cell, files_of_cell


def test_all_eight_values_of_table_2_come_out_of_the_recording_alone(analysis: Analysis) -> None:
    assert len(analysis.plateaus) == 8
    for row in analysis.plateaus:
        assert row.power == pytest.approx(row.table_2, rel=1e-3)
        assert row.expected == pytest.approx(row.table_2, rel=1e-3)


def test_the_controller_of_the_cell_counts_where_no_other_data_are_attached(
    analysis: Analysis, tmp_path: Path
) -> None:
    """A robot file with a changed copy of the bundled controller, under the same name."""
    data = files("ir_description") / "data"
    power = (data / "power" / "kr_c4.yaml").read_text(encoding="utf-8")
    robot = (data / "robots" / "kr210_r2700_extra.yaml").read_text(encoding="utf-8")
    cell = (data / "cells" / "open.yaml").read_text(encoding="utf-8")
    changed = power.replace("controller_w: {value: 15,", "controller_w: {value: 22,")
    assert changed != power
    (tmp_path / "own.yaml").write_text(changed, encoding="utf-8")
    (tmp_path / "robot.yaml").write_text(
        robot.replace("controller: kr_c4", "controller: own.yaml"), encoding="utf-8"
    )
    (tmp_path / "cell.yaml").write_text(
        cell.replace("robot: kr210_r2700_extra", "robot: robot.yaml"), encoding="utf-8"
    )

    def idle(path: str) -> dict[str, float]:
        text = files_of_cell(path)[0].cell_yaml
        attached = data_of_cell(text).get(contents.POWER, "")
        return idle_watts(analyse(replace(analysis.recording, cell_yaml=text, power_yaml=attached)))

    own = idle(str(tmp_path / "cell.yaml"))
    bundled = idle("open")
    assert own == {**bundled, "HIBERNATION": pytest.approx(bundled["HIBERNATION"] + 7.0)}
