"""Programs as shops have them: each is read, followed and driven as its first comments expect, or
refused.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from ir_krl import KrlError
from ir_krl.run import SetOutput, StandStill
from ir_planner import Planner

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from _shop_corpus import programs, read, round_trip

PROGRAMS = programs()
# that a point may be off when it has been written and read
POINT_DEG = 1e-4
POINT_MM = 1e-3


def expected(text: str, pattern: str) -> list[str]:
    return re.findall(pattern, text)


@pytest.mark.sampled
@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_does_what_its_comments_expect(path: Path, planner: Planner) -> None:
    cell = planner.cell
    text = path.read_text(encoding="utf-8")
    refused = re.search(r";refused ?(.*)", text)

    if refused:
        with pytest.raises(KrlError) as error:
            read(path, planner)
        assert refused[1].strip() in str(error.value)
        assert re.match(rf"{path.stem}.src(:\d+)?|there is no", str(error.value)), str(error.value)
        return
    program, steps = read(path, planner)
    moves = [step.trajectory for step in steps if step.moves]
    assert [str(len(moves))] == expected(text, r";expects (\d+) movements")
    for count in expected(text, r";expects (\d+) outputs"):
        assert sum(isinstance(one, SetOutput) for one in program.commands) == int(count)
    for seconds in expected(text, r";expects ([\d.]+) seconds of waits"):
        waits = sum(one.seconds for one in program.commands if isinstance(one, StandStill))
        assert waits == pytest.approx(float(seconds))
    for seconds in expected(text, r";expects ([\d.]+) seconds of motion"):
        assert sum(one.duration for one in moves) == pytest.approx(float(seconds))
    for count, axis, degrees in expected(text, r";reaches (\d+) A(\d) (-?[\d.]+)"):
        end = np.degrees(moves[int(count) - 1].positions[-1])
        assert end[int(axis) - 1] == pytest.approx(float(degrees), abs=0.1)
    for one in moves:  # a motion begins and ends at rest, within the axes' ranges
        assert np.abs(one.velocities[[0, -1]]).max() == 0.0
        assert (one.positions >= cell.robot.position_min - 1e-9).all()
        assert (one.positions <= cell.robot.position_max + 1e-9).all()
    _, degrees, millimetres = round_trip(steps, planner)
    assert degrees <= POINT_DEG
    assert millimetres <= POINT_MM


def test_the_corpus_has_forty_programs() -> None:
    assert len(PROGRAMS) >= 40
