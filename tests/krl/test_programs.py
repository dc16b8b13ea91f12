"""Programs as shops have them: each is read, followed and driven as its first comments expect, or refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ir_krl import KrlError, SetOutput, Wait, follow, parse
from ir_planner import Planner, tool_in_flange
from ir_planner.krl.driven import drive

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.src"))


def expected(text: str, pattern: str) -> list[str]:
    return re.findall(pattern, text)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_does_what_its_comments_expect(path: Path, planner: Planner) -> None:
    cell, text = planner.cell, path.read_text(encoding="utf-8")
    files = [path, *([path.with_suffix(".dat")] if path.with_suffix(".dat").exists() else [])]
    inputs = {int(n): v == "true" for n, v in expected(text, r";input (\d+) (\w+)")}
    refused = re.search(r";refused ?(.*)", text)

    def run() -> tuple:
        sources = [parse(one.read_text(encoding="utf-8"), one.name) for one in files]
        program = follow(sources, cell.machine_home, tool_in_flange(cell.tcp), inputs=inputs)
        return program, drive(program, planner.scene("none"), cell.machine_home)[0]

    if refused:
        with pytest.raises(KrlError) as error:
            run()
        assert refused[1].strip() in str(error.value)
        assert re.match(rf"{path.stem}.src(:\d+)?|there is no", str(error.value)), str(error.value)
        return
    program, steps = run()
    moves = [step.trajectory for step in steps if step.moves]
    assert [str(len(moves))] == expected(text, r";expects (\d+) movements")
    for count in expected(text, r";expects (\d+) outputs"):
        assert sum(isinstance(one, SetOutput) for one in program.commands) == int(count)
    for seconds in expected(text, r";expects ([\d.]+) seconds of waits"):
        waits = sum(one.seconds for one in program.commands if isinstance(one, Wait))
        assert waits == pytest.approx(float(seconds))
    for seconds in expected(text, r";expects ([\d.]+) seconds of motion"):
        assert sum(one.duration for one in moves) == pytest.approx(float(seconds))
    for one in moves:  # a motion begins and ends at rest, within the axes' ranges
        assert np.abs(one.velocities[[0, -1]]).max() == 0.0
        assert (one.positions >= cell.robot.position_min - 1e-9).all()
        assert (one.positions <= cell.robot.position_max + 1e-9).all()


def test_the_corpus_has_forty_programs_with_the_constructs_of_the_language() -> None:

    cases = (Path(__file__).parent / "test_language.py").read_text(encoding="utf-8").count(': ("')
    assert len(PROGRAMS) + cases >= 40
    assert len(PROGRAMS) >= 25
