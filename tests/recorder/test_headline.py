"""The top of the page is true at first sight."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from ir_msgs_py.savings import one_sided
from ir_recorder import Analysis, Finding, analyse, findings
from ir_recorder.analysis.production import production_of
from ir_recorder.report import report_html
from ir_recorder.report.headline import failing, run_tiles, source, tiles, verdict
from ir_recorder.report.number_text import joules, kilowatt_hours, millimetres, seconds


def not_driven(analysis: Analysis) -> Analysis:
    """The plan of a recording without its run."""
    steps = tuple(result.step.movement for result in analysis.steps)
    bare = replace(analysis.recording, power=None, joints=None, controller=None, hardware="")
    return analyse(replace(bare, events=(), planned=steps))


def test_simulated_figures_are_labelled(analysis: Analysis, page: str) -> None:
    assert "Simulated, not measured" in page
    real = replace(analysis, recording=replace(analysis.recording, hardware="KR210"))
    assert "Measured" in source(real)
    assert analysis.recording.power is not None
    power = replace(analysis.recording.power, plant="typical, seed 7")
    assert "plant typical, seed 7" in source(
        replace(analysis, recording=replace(real.recording, power=power))
    )
    assert "plant not recorded" in source(
        replace(analysis, recording=replace(real.recording, hardware=""))
    )


def test_a_run_without_a_program_says_so_and_is_not_green(analysis: Analysis) -> None:
    bare = analyse(replace(analysis.recording, events=()))
    top = report_html(bare, findings(bare)).split("<main>")[0]
    assert 'class="verdict good"' not in top
    assert 'class="verdict open"' in top
    assert "not checked" in top
    assert "none executed" in tiles(bare)


def test_nothing_checked_is_not_checked() -> None:
    assert "Nothing was checked" in verdict(())
    assert "good" not in verdict(())


def test_a_check_that_fails_is_named_beside_the_verdict(analysis: Analysis) -> None:
    """Its name, what was found and what is allowed; of many the first, and how many more."""
    assert failing(findings(analysis)[:0]) == ""
    bad = [
        Finding(f"reading <{k}>", measured=5.0 + k, low=-math.inf, high=1.0, unit="W", reason="")
        for k in range(5)
    ]
    one = report_html(analysis, bad[:1])
    assert "The check that fails" in one
    assert "reading &lt;0&gt;: 5 W, allowed at most 1 W" in one
    many = failing(bad)
    assert many.count("<li>") == 4
    assert "2 more below" in many


def test_a_plan_without_a_drive_says_whether_it_is_proved(analysis: Analysis) -> None:
    """Once it read "Nothing was checked" beside "proved"."""
    plan = not_driven(analysis)
    assert plan.recording.only_planned
    for proved, word in ((True, ">Proved"), (False, ">Not proved")):
        own = replace(plan, recording=replace(plan.recording, planned_certified=proved))
        shown = verdict((), own)
        assert f"{word}: no collision, within limits" in shown
        assert ("good" in shown) is proved


def test_the_page_of_a_plan_shows_its_steps_and_no_empty_part(analysis: Analysis) -> None:
    """Once it had five parts with "Nothing was recorded" and none with what is in the file."""
    plan = not_driven(analysis)
    page = report_html(plan, findings(plan))
    assert "Nothing was recorded" not in page
    assert "0 hold" not in page
    steps = page.split('id="steps"')[1].partition("</details>")[0]
    for step in plan.recording.planned:
        assert joules(step.report.energy) in steps
        assert step.is_pause or millimetres(step.report.min_clearance) in steps
    count = sum(step.report.certified for step in plan.recording.planned if not step.is_pause)
    assert steps.count(">proved<") == count


def test_a_plan_without_a_comparison_is_called_what_it_costs(analysis: Analysis) -> None:
    """Once its head was "what the plan saves" over what it costs, and that of shifts alone."""
    plan = not_driven(analysis).recording
    alone = analyse(replace(plan, savings=(), facts=(("plan", "never driven"),)))
    page = report_html(alone, ())
    answer = page.split('id="answer"')[1].partition("</section>")[0]
    assert "the plan and what it costs" in page
    assert "the plan and what it saves" not in page
    assert "at night and at weekends, in hibernation" in answer  # as each year of a plan
    assert "ibernation" in answer
    assert "No comparison in this file" in answer
    assert "predicted: planned program, predicted" not in answer.lower()
    assert "216 EUR a year, at most" not in answer


def test_shortened_pauses_stand_beside_the_energy_of_the_full_cycle(analysis: Analysis) -> None:
    facts = (("unshortened_pauses", "600 s, 1800 s"),)
    found = analyse(replace(analysis.recording, facts=facts))
    shown = tiles(found)
    assert "this run, pauses shortened" in run_tiles(found)
    assert "cycle with full pauses" in shown
    assert "pauses in power modes 40.0 min, in the run 1.20 s" in shown
    assert "pauses shortened" not in tiles(analysis) + run_tiles(analysis)


def test_pauses_are_in_the_figures_of_the_run(analysis: Analysis) -> None:
    shown = run_tiles(analysis)
    for name in ("movements", "pauses", "waiting between steps"):
        assert f"<span>{name}</span>" in shown


@pytest.mark.parametrize(("low", "said"), [(100.0, True), (98.0, True), (90.0, False)])
def test_a_value_at_the_lower_end_of_its_interval_says_why(low: float, said: bool) -> None:
    assert bool(one_sided(100.0, low, 120.0)) is said
    assert one_sided(100.0, 100.0, 100.0) == ""


def test_a_plan_has_one_row_of_tiles(analysis: Analysis) -> None:
    """Its energy and seconds are those of the cycle that is counted."""
    found = not_driven(analysis)
    cycle = production_of(found)
    assert cycle is not None
    shown = tiles(found)
    assert shown.count('class="tile"') <= 6
    said = f"<b>{kilowatt_hours(cycle.energy)}</b><small>in {seconds(cycle.seconds)}, predicted"
    assert said in shown


def test_what_is_left_is_not_what_the_plan_saves(analysis: Analysis) -> None:
    """Once one table had both, the nights of the saving above pauses of the plan."""
    assert analysis.savings is not None
    page = report_html(analysis, findings(analysis))
    left = page.split('id="levers"')[1].partition("</section>")[0]
    assert "What is still left after this plan" in left
    assert "at night and at weekends" not in left
    bare = analyse(replace(analysis.recording, savings=()))
    alone = report_html(bare, findings(bare)).split('id="levers"')[1].partition("</section>")[0]
    assert "What to change first" in alone
    assert "at night and at weekends" in alone


def test_a_verdict_says_what_kind_of_checks_hold(analysis: Analysis) -> None:
    good = [Finding("x", measured=1.0, low=0.0, high=2.0, unit="W", reason="")] * 2
    assert "Driven in simulation: 2 checks of safety, time and energy hold" in verdict(
        good, analysis
    )
    real = replace(analysis, recording=replace(analysis.recording, hardware="KR210"))
    assert ">Driven: 2 checks" in verdict(good, real)
