"""No saving comes from cutting a process short: what the tool works along is driven by every
program.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from ir_cli.main import main
from ir_description.cell import CellPath
from ir_krl import follow, parse
from ir_msgs_py.report import MovementKind
from ir_msgs_py.savings import BeforeAfter, Side
from ir_planner import Planner, RequestError
from ir_planner.before_after import before_after, today_of_krl
from ir_planner.before_after.changes import Costed, changes
from ir_planner.before_after.today_steps import asked_program
from ir_planner.krl import EvaluatedProgram, evaluate_krl, tool_in_flange

SEAM = """PTP XHOME
PTP {A1 30,A5 30}
LIN_REL {Z -100}
$OUT[1]=TRUE
$VEL.CP=0.1
$APO.CDIS=10
LIN_REL {X 60} C_DIS
LIN_REL {Y 90} C_DIS
LIN_REL {X -50}
$OUT[1]=FALSE
$VEL.CP=1
LIN_REL {Z 100}
PTP XHOME"""
# m/s, m
SPEED = 0.1
CORNER = 0.01
POINTS = np.array(
    [[0.0, 0.0], [0.06, 0.0], [0.06, 0.09], [0.01, 0.09]]
)  # m, of the seam from its beginning


def evaluated(planner: Planner, lines: str) -> EvaluatedProgram:
    cell = planner.cell
    sources = [parse(f"DEF TEST( )\n{lines}\nEND\n", "test.src")]
    return evaluate_krl(planner, follow(sources, cell.machine_home, tool_in_flange(cell.tcp)))


@pytest.fixture(scope="module")
def found(planner: Planner) -> EvaluatedProgram:
    return evaluated(planner, SEAM)


@pytest.fixture(scope="module")
def welded(planner: Planner, found: EvaluatedProgram) -> BeforeAfter:
    return before_after(planner, today_of_krl(found))


def tool_along(side: Side, planner: Planner) -> tuple[np.ndarray, float]:
    """Places (N, 3) m of the tool while it works, 2 ms apart, and the seconds."""
    along = [step for step in side.movements if step.kind == MovementKind.CARTESIAN]
    assert along, f"{side.name} has lost the process"
    driven = [step.trajectory for step in along if step.trajectory is not None]
    q = [one.sample(np.arange(one.times[0], one.times[-1], 2e-3)).q for one in driven]
    seconds = sum(step.duration for step in along)
    return np.asarray(planner.scene("").chain.tcp_poses(np.concatenate(q))[:, :3, 3]), seconds


def distance_to_the_seam(places: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Of places (N, 3) from the programmed lines (N,) m."""
    corners = origin + np.column_stack([POINTS, np.zeros(len(POINTS))])
    away = []
    for first, last in pairwise(corners):
        share = np.clip(
            (places - first) @ (last - first) / ((last - first) @ (last - first)), 0.0, 1.0
        )
        away.append(np.linalg.norm(places - first - share[:, None] * (last - first), axis=1))
    return np.asarray(np.min(away, axis=0))


@pytest.mark.long
def test_every_program_works_along_the_seam_at_its_speed(
    welded: BeforeAfter, planner: Planner
) -> None:
    origin = tool_along(welded.today, planner)[0][0]
    ends = origin + np.array([[0.0, 0.0, 0.0], [*POINTS[-1], 0.0]])
    length = (
        np.linalg.norm(np.diff(POINTS, axis=0), axis=1).sum() - 4 * CORNER
    )  # of the cut corners at most
    for side in (welded.today, *welded.sides):
        places, seconds = tool_along(side, planner)
        assert places[[0, -1]] == pytest.approx(ends, abs=2e-4)
        assert distance_to_the_seam(places, origin).max() < CORNER
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / 2e-3
        assert (
            speeds.max() < 1.01 * SPEED or side is welded.today
        )  # the controller's corners overlap
        assert np.linalg.norm(np.diff(places, axis=0), axis=1).sum() > length
        assert seconds > length / SPEED


@pytest.mark.long
def test_nothing_is_saved_by_cutting_a_process(welded: BeforeAfter) -> None:
    """Law: the process costs in every program what such work costs; only what is around it may be
    dropped.
    """
    names = [hop.name for hop in welded.today.hops]
    assert names == ["start to lines_8_to_10", "along lines_8_to_10", "lines_8_to_10 to home"]
    for side in welded.sides:
        assert [hop.name for hop in side.hops][:3] == names
        assert side.certified
        assert side.saving.common == pytest.approx(welded.today.report.energy)
        assert side.hops[1].energy > 0.9 * welded.today.hops[1].energy
        around = sum(welded.today.hops[k].energy - side.hops[k].energy for k in (0, 2))
        assert side.saving.saved < around + 0.1 * welded.today.hops[1].energy
    assert any("lines_8_to_10" in note for note in welded.notes)


@pytest.mark.long
def test_corners_of_a_process_are_not_counted_as_stops_less(welded: BeforeAfter) -> None:
    """Today's program drives it in a movement from corner to corner, the planner in one that rests
    there.
    """
    along = next(step for step in welded.today.movements if step.kind == MovementKind.CARTESIAN)
    none = np.zeros(3)
    (change,) = changes(Costed((along, along), (none, none)), Costed((along,), (none,)))
    assert change.name == "along lines_8_to_10"
    assert "stop" not in change.words


def test_what_is_taken_for_positioning_is_said_and_can_be_named(found: EvaluatedProgram) -> None:
    free = today_of_krl(found, ())
    assert not any(one.process for one in free.stretches)
    assert any("taken for positioning" in note and "test.src:8:1" in note for note in free.notes)
    named = [
        one.process.name
        for one in today_of_krl(found, [(4, 4)]).stretches
        if one.process is not None
    ]
    assert named == ["line_4"]
    with pytest.raises(RequestError, match="no motion stands in lines 10 to 8"):
        today_of_krl(found, [(10, 8)])


def test_corners_that_become_exact_are_said(planner: Planner, found: EvaluatedProgram) -> None:
    assert not any("corners are" in note for note in today_of_krl(found).notes)
    mixed = SEAM.replace("LIN_REL {X 60} C_DIS", "LIN_REL {X 60}")
    notes = today_of_krl(evaluated(planner, mixed)).notes
    assert sum("corners are approximated by 0 to 10 mm today" in note for note in notes) == 1
    assert any("drive them exactly, which takes them longer" in note for note in notes)


def test_a_visit_of_stations_alone_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "seam.src"
    source.write_text(f"DEF SEAM( )\n{SEAM}\nEND\n", encoding="utf-8")
    assert main(["krl", "import", str(source), "--cell", "open", "--compare"]) == 2
    assert "works along paths of the tool" in capsys.readouterr().err


def test_a_process_that_begins_in_motion_is_refused(planner: Planner) -> None:
    """The planner's paths begin at rest; without the process a saving would be claimed."""
    lines = SEAM.replace(
        "LIN_REL {Z -100}\n$OUT", "$APO.CDIS=10\nPTP_REL {A1 3} C_DIS\nCONTINUE\n$OUT"
    )
    with pytest.raises(RequestError, match="exact stops"):
        today_of_krl(evaluated(planner, lines))


def test_the_cells_own_path_gives_what_it_allows(planner: Planner, found: EvaluatedProgram) -> None:
    today = today_of_krl(found)
    driven = next(one.process for one in today.stretches if one.process is not None)
    assert (driven.path.tool_speed, driven.path.blending_radius) == pytest.approx((SPEED, CORNER))
    own = CellPath("bead", replace(driven.path, tool_speed=0.3, free_angle=0.5))
    cell = replace(planner.cell, paths=(own,))
    theirs = Planner(
        clock=lambda: 0.0, settings=planner.settings, read_cell=lambda _text, _name: cell
    )
    theirs.set_cell(text="cell")
    asked = asked_program(today, theirs.scene("")).cell
    assert [step.target for step in asked.program] == ["bead", "home"]
    assert (asked.path("bead").tool_speed, asked.path("bead").free_angle) == pytest.approx(
        (SPEED, 0.5)
    )
