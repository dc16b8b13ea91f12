"""The contract of `ExitSearch`, for each registered search for exit paths."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner import CancelledError, Planner, RequestError
from ir_planner.configurations import free_configurations
from ir_planner.request import Context, Journal, Work
from ir_planner.service import EXIT_SEARCHES, Exit, ExitSearch, ExitsFound
from ir_values.settings import describe

SEED = 7
WORK = 60_000
WANTED = 2
STATIONS = (
    ("demo", "gauge_measure"),
    ("demo", "lathe_work"),
    ("cnc_door", "press"),
    ("deep_box", "tun"),
)

Answer = tuple[ExitsFound, Exit]


def unhurried(most: int = WORK, cancelled: Callable[[], bool] = lambda: False) -> Work:
    """Work on a clock that stands still: nothing is cut by time."""
    return Work(most, 1.0, lambda: 0.0, cancelled)


def problem_at(cell: str, station: str, work: Work) -> Exit:
    """To leave a station from the free configuration of least W."""
    planner = Planner(cell, clock=itertools.repeat(0.0).__next__)
    scene = planner.scene()
    options = PlanOptions()
    context = Context(scene, options, Journal(work, SEED), station)
    found = free_configurations(
        scene.station(station).pose, scene, context.thresholds(), np.array(scene.cell.park)
    )
    return Exit.of(found.q[0], context)


def found_by(search: ExitSearch, problem: Exit) -> ExitsFound:
    return search.find(problem, WANTED, np.random.SeedSequence([SEED]), problem.inside.work)


def answers(search: ExitSearch) -> list[Answer]:
    """What the search finds at every station."""
    problems = [problem_at(cell, station, unhurried()) for cell, station in STATIONS]
    return [(found_by(search, problem), problem) for problem in problems]


@pytest.fixture(params=list(EXIT_SEARCHES))
def search(request: pytest.FixtureRequest) -> ExitSearch:
    return EXIT_SEARCHES[request.param]


def test_paths_lead_from_the_station_out_of_the_zone_and_are_free(search: ExitSearch) -> None:
    solved = 0
    for found, problem in answers(search):
        assert found.note
        for path in found.paths:
            solved += 1
            assert np.array_equal(path[0], problem.interaction)
            assert problem.is_out(path[-1:]).all()
            assert problem.inside.edges_free(path[:-1].copy(), path[1:].copy()).all()
    assert solved > 0


def test_it_says_how_far_out_it_came(search: ExitSearch) -> None:
    for found, problem in answers(search):
        far = problem.area.zone_distance(found.farthest[None])[0]
        assert far >= problem.area.zone_distance(problem.interaction[None])[0]
        assert problem.inside.states_free(found.farthest[None]).all()


def test_the_same_seed_gives_the_same_bytes(search: ExitSearch) -> None:
    for (one, problem), (other, again) in zip(answers(search), answers(search), strict=True):
        assert [path.tobytes() for path in one.paths] == [path.tobytes() for path in other.paths]
        assert (one.note, one.rejected) == (other.note, other.rejected)
        assert problem.inside.work.iterations == again.inside.work.iterations


def test_work_is_charged(search: ExitSearch) -> None:
    assert all(problem.inside.work.iterations > 0 for _, problem in answers(search))


@pytest.mark.parametrize("most", [1, 100])
def test_it_ends_when_its_work_is_spent(search: ExitSearch, most: int) -> None:
    """A batch that has begun may be finished."""
    problem = problem_at("deep_box", "tun", unhurried(most))
    found_by(search, problem)
    assert problem.inside.work.iterations <= most + 500


def test_it_stops_when_it_is_asked_to(search: ExitSearch) -> None:
    problem = problem_at("deep_box", "tun", unhurried(cancelled=lambda: True))
    with pytest.raises(CancelledError):
        found_by(search, problem)


def test_its_settings_are_fields_with_a_sentence_and_a_range(search: ExitSearch) -> None:
    assert dataclasses.is_dataclass(search)
    for setting in describe(type(search)):
        assert setting.sentence.endswith(".")
        assert setting.bounds or setting.type is bool, f"{setting.name} has no range"
    assert search.title
    assert (type(search).__doc__ or "").splitlines()[0].endswith(".")


@pytest.mark.parametrize("name", list(EXIT_SEARCHES))
def test_a_request_can_ask_for_it_by_name(name: str) -> None:
    planner = Planner("demo", clock=itertools.repeat(0.0).__next__)
    cell = planner.cell
    near = np.array(cell.park)
    options = PlanOptions(planner_id=name)
    plan = planner.plan_service("lathe_work", near=near, max_candidates=1, options=options)
    assert plan.status.ok, plan.status.message
    assert [candidate.method for candidate in plan.candidates] == [name]
    assert all(candidate.report.certified for candidate in plan.candidates)


def test_an_unknown_name_lists_the_known() -> None:
    planner = Planner("demo", clock=itertools.repeat(0.0).__next__)
    cell = planner.cell
    near = np.array(cell.park)
    options = PlanOptions(planner_id="teleport")
    with pytest.raises(RequestError) as refused:
        planner.plan_service("lathe_work", near=near, max_candidates=1, options=options)
    assert all(name in str(refused.value) for name in EXIT_SEARCHES)
