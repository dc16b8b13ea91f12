"""Every page at a desk, on a phone and on paper: nothing is cut, nothing overlaps, nothing scrolls
sideways, and axe finds nothing.

Needs Chromium. Without it these tests say `not checked: browser`; where CI=true it has to be there.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import axe_core_python
import pytest

from ir_description import load_cell
from ir_msgs_py.savings import BeforeAfter
from ir_planner import Planner
from ir_planner.before_after import before_after_common
from ir_recorder import Analysis, analyse, findings
from ir_recorder.report import report_html
from ir_recorder.report.before_after import before_after_html
from ir_recorder.report.fleet import fleet_html
from ir_recorder.report.fleet_members import member_of
from ir_recorder.report.robots import robots_html
from ir_recorder.report.side_by_side import comparison_html
from ir_studies.arena.figures import ArenaRun
from ir_studies.arena.page import page_html as arena_html
from ir_studies.arena.settings import ArenaEntry, ArenaSettings
from ir_studies.layout.page import page_html as layout_html
from ir_studies.layout.placement import Known, Placement, payloads_of
from ir_studies.layout.settings import LayoutSettings
from ir_studies.layout.summary import Final
from ir_studies.statistics.findings import findings_of
from ir_studies.statistics.outputs import page_html as statistics_html
from ir_studies.statistics.settings import StatisticsSettings

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "out" / "pages"
BOXES = Path(__file__).with_name("page_boxes.js").read_text()
AXE = (Path(axe_core_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
FOUND = """((more) => axe.run(document, {resultTypes: ['violations'], ...more}).then(
    (found) => found.violations.map((one) =>
        `${one.id}: ${one.nodes.slice(0, 3).map((node) => node.html.slice(0, 120)).join(' | ')}`))
)"""
DARK = "{runOnly: ['color-contrast', 'scrollable-region-focusable']}"
"""What a page in other colours and of another width may break."""
SAME = ("empty report", "long names")
"""Pages of the elements of another one, which axe judges."""
SIZES = {"desk": (1400, 900), "phone": (390, 844), "paper": (703, 1047)}
ENDINGS = ("_desk.png", "_phone.png", ".pdf")
OPEN = "document.querySelectorAll('details').forEach((each) => { each.open = true; })"


@cache
def compared() -> tuple[BeforeAfter, Planner]:
    planner = Planner("open", clock=lambda: 0.0)
    home = planner.cell.machine_home
    return before_after_common(planner, ("p1", "p2", "home"), home, 30.0), planner


def report(analysis: Analysis) -> str:
    return report_html(analysis, findings(analysis))


def empty(analysis: Analysis) -> str:
    bare = replace(
        analysis.recording, power=None, joints=None, controller=None, events=(), cell_yaml=""
    )
    return report(analyse(bare))


def long_names(analysis: Analysis) -> str:
    """Stations and settings as a large plant calls them."""
    recording = analysis.recording
    name = "conveyor_of_the_second_hall_place_3"
    events = tuple(
        replace(event, movement=replace(event.movement, from_station=name))
        for event in recording.events
    )
    facts = (("packages", "ir_planner_0.1.0_" * 8), ("pauses", "shortened " * 20))
    return report(analyse(replace(recording, events=events, facts=facts)))


def plan(analysis: Analysis) -> str:
    """The plan of a recording, which nobody drove."""
    steps = tuple(result.step.movement for result in analysis.steps)
    bare = replace(analysis.recording, power=None, joints=None, controller=None, hardware="")
    facts = (("plan", "never driven"),)
    return report(analyse(replace(bare, events=(), planned=steps, facts=facts)))


def recordings(analysis: Analysis) -> str:
    checked = (analysis, findings(analysis))
    return comparison_html([checked, checked, checked])


def fleet(analysis: Analysis) -> str:
    member = member_of(analysis, "robot")
    assert member is not None
    robots = [replace(member, robot=f"hall_{k}_robot_with_a_long_name") for k in range(9)]
    return fleet_html(robots, left_out=["cut.mcap: left out: it was not driven to the end"])


def robots(analysis: Analysis) -> str:
    return robots_html({"left": analysis, "right": analysis}, findings(analysis))


def before_and_after(_: Analysis) -> str:
    found, planner = compared()
    return before_after_html(found, planner.cell)


def arena(_: Analysis) -> str:
    settings = ArenaSettings(planners=("portfolio", "tree"), cells=("open",), seeds=1)
    runs = []
    for planner, cost in (("portfolio", 100.0), ("tree", 104.0)):
        for task in ("home->p1", "p1->home"):
            row = {
                **{"solved": True, "cost_j": cost, "first_s": 0.1, "final_s": 0.4},
                **{"movement_cost": cost, "duration_s": 1.0, "energy_j": cost},
                **{"clearance_m": 0.02, "progress": [[0.1, 2.0 * cost], [0.4, cost]]},
                **{"total_s": 1.0, "straight_free": False},
            }
            runs.append(ArenaRun(ArenaEntry(planner, "open", task, 0, "", "synchronous"), row))
    return arena_html(runs, settings)


def statistics(_: Analysis) -> str:
    rows = []
    for k in range(12):
        pair: dict[str, Any] = {"start": "a", "goal": "b"}
        for timing, share in (("synchronous", 0.0), ("asynchronous", 0.01 * (k % 5 - 2))):
            joules = 12_345.6 * (1.0 + share)
            pair[timing] = {
                **{"solved": k != 3, "timing": timing, "trajectory_id": f"{timing}{k}"},
                **{"message": "no path found between the two", "duration_s": 2.0 + share},
                **{"direct_j": joules, "indirect_j": 0.95 * joules, "predicted_j": 0.95 * joules},
                **{"predicted_low_j": 0.95 * joules, "predicted_high_j": 1.2 * joules},
                **{"peak_w": 5000.0, "path_m": 4.0, "movement_cost": 13_460.0},
                "torque_share": 0.7,
            }
        rows.append(pair)
    return statistics_html(findings_of(rows), StatisticsSettings("open"))


def layout(_: Analysis) -> str:
    """Three placements of a robot, of which one is impossible."""
    settings = LayoutSettings(
        cell="open",
        stations=("p1", "home"),
        base={"x": (-0.5, 0.5), "y": (-0.5, 0.5)},
        keep=1,
        seeds=1,
    )
    cell = load_cell("open")
    conditions = settings.conditions
    known = []
    for x, solved in ((0.0, True), (0.3, True), (-0.4, False)):
        placement = Placement({"base.x": x, "base.y": 0.5 * x})
        row = {
            **{"solved": solved, "energy_j": 1000.0 - x, "moving_j": 900.0, "duration_s": 4.0},
            **{"clearance_m": 0.02, "cost_j": 2000.0 - 100.0 * x, "robots": [0.0, 1.0]},
            **{"message": "too near the table", "kind": "station"},
            "coarse": [1900.0] * len(payloads_of(conditions)),
        }
        plans = dict.fromkeys(conditions, row) if solved else {}
        known.append(Known(placement, row, plans, conditions))
    finals = [
        [Final(one.placement, condition, (row,)) for condition, row in one.plans.items()]
        for one in known[:2]
    ]
    return layout_html(known, finals, settings, cell)


PAGES: dict[str, Callable[[Analysis], str]] = {
    "report": report,
    "plan": plan,
    "parts": report,
    "empty report": empty,
    "long names": long_names,
    "recordings": recordings,
    "fleet": fleet,
    "robots": robots,
    "before and after": before_and_after,
    "arena": arena,
    "statistics": statistics,
    "layout": layout,
}
SOONER = ("report", "fleet", "layout")  # the others only in the long tests


@pytest.mark.sampled
@pytest.mark.parametrize(
    "name",
    [name if name in SOONER else pytest.param(name, marks=pytest.mark.long) for name in PAGES],
)
def test_nothing_is_cut_overlaps_or_scrolls_and_axe_finds_nothing(
    browser: Any,
    analysis: Analysis,
    tended: Callable[[Analysis], Analysis],
    tmp_path: Path,
    name: str,
) -> None:
    path = tmp_path / "page.html"
    shown = tended(analysis) if name == "parts" else analysis
    path.write_text(PAGES[name](shown), encoding="utf-8")
    faults = {}
    for size, (wide, high) in SIZES.items():
        page = browser.open(path, wide, high, touch=size == "phone", dark=size == "phone")
        if size == "paper":
            page.call("Emulation.setEmulatedMedia", media="print")
            page.run("dispatchEvent(new Event('beforeprint'))")
        page.frame()
        faults[size] = page.run(BOXES)
        if size != "paper":
            page.run(OPEN)
            page.frame()
            faults[f"{size}, all unfolded"] = page.run(BOXES)
        if size != "paper" and name not in SAME:
            page.run(f"{AXE}; 0")
            faults[f"{size}, axe"] = page.run(f"{FOUND}({DARK if size == 'phone' else '{}'})")
        page.close()
    assert {size: found for size, found in faults.items() if found} == {}


@pytest.mark.long
def test_no_two_kinds_of_pages_have_the_same_title(analysis: Analysis) -> None:
    """Those of a plan and of a comparison were both called "what the plan saves"."""
    kinds = [name for name in PAGES if name not in (*SAME, "parts")]
    titles: dict[str, list[str]] = {}
    for name in kinds:
        title = PAGES[name](analysis).partition("<title>")[2].partition("</title>")[0]
        titles.setdefault(title.rpartition(": ")[2], []).append(name)
    assert all(len(own) == 1 for own in titles.values()), titles


HEADS = """[...document.querySelectorAll("main h2")].filter((each) => {
    const part = each.closest("section, details");
    return each.getClientRects().length && (part.tagName !== "DETAILS" || part.open);
}).map((each) => each.textContent)"""
"""Headings of what is shown."""


@pytest.mark.parametrize(
    ("name", "heads"),
    [
        ("report", {"Where the energy goes", "This run in figures"}),
        ("recordings", {"Runs in figures"}),
        ("fleet", {"Peak, and when nobody works", "By power mode"}),
    ],
)
def test_figures_of_a_run_are_on_paper(
    browser: Any, analysis: Analysis, tmp_path: Path, name: str, heads: set[str]
) -> None:
    """Flows and figures of runs were on no sheet, and last sheets held a row."""
    path = tmp_path / "page.html"
    path.write_text(PAGES[name](analysis), encoding="utf-8")
    page = browser.open(path, *SIZES["paper"])
    page.call("Emulation.setEmulatedMedia", media="print")
    page.run("dispatchEvent(new Event('beforeprint'))")
    page.frame()
    assert heads <= set(page.run(HEADS))
    page.close()


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["report", pytest.param("before and after", marks=pytest.mark.long)]
)
def test_paper_from_a_phone_has_every_section_that_paper_from_a_desk_has(
    browser: Any, analysis: Analysis, tmp_path: Path, name: str
) -> None:
    path = tmp_path / "page.html"
    path.write_text(PAGES[name](analysis), encoding="utf-8")
    read = {}
    printed = {}
    for size in ("desk", "phone"):
        page = browser.open(path, *SIZES[size], touch=size == "phone")
        read[size] = page.run(HEADS)
        page.call("Emulation.setEmulatedMedia", media="print")
        page.size(*SIZES["paper"])
        page.run("dispatchEvent(new Event('beforeprint'))")
        page.frame()
        printed[size] = page.run(HEADS)
        page.run("dispatchEvent(new Event('afterprint'))")
        page.close()
    assert len(read["phone"]) < len(read["desk"])  # the phone folds
    assert set(printed["desk"]) == set(printed["phone"])


INK = """(() => {
    const canvas = document.getElementById('power');
    if (!canvas.width || !canvas.height) return 0;
    const all = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    return all.filter((value, k) => k % 4 === 3 && value > 0).length;
})()"""
"""Pixels of the chart of power that are drawn."""


def test_curves_are_closed_on_a_phone_and_drawn_when_they_are_opened_or_printed(
    browser: Any, analysis: Analysis, tmp_path: Path
) -> None:
    """A report was 7 screens of a phone long before its first heading for engineers."""
    path = tmp_path / "page.html"
    path.write_text(report(analysis), encoding="utf-8")
    for printed in (False, True):
        page = browser.open(path, *SIZES["phone"], touch=True)
        assert page.run("document.getElementById('over-time').tagName") == "DETAILS"
        assert page.run("document.getElementById('over-time').open") is False
        assert page.run("document.getElementById('motion').tagName") == "SECTION"
        if printed:
            page.call("Emulation.setEmulatedMedia", media="print")
            page.size(*SIZES["paper"])
            page.run("dispatchEvent(new Event('beforeprint'))")
        else:
            page.run("document.querySelector('#over-time > summary').click()")
            page.frame()
            page.frame()
        assert page.run(INK) > 1000
        page.close()
    page = browser.open(path, *SIZES["desk"])
    assert page.run("document.getElementById('over-time').tagName") == "SECTION"
    page.close()


def page_pictures() -> ModuleType:
    """The tool that draws pages; the fixture of the browser has loaded the module that it needs."""
    path = ROOT / "tools" / "page_pictures.py"
    spec = importlib.util.spec_from_file_location("page_pictures", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.long
def test_pictures_of_every_page_are_left_to_look_at(
    browser: Any, analysis: Analysis, tended: Callable[[Analysis], Analysis], tmp_path: Path
) -> None:
    """At a desk, on a phone and as PDF in out/pages: no judge of boxes sees what people see."""
    tool = page_pictures()
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, made in PAGES.items():
        path = tmp_path / "page.html"
        shown = tended(analysis) if name == "parts" else analysis
        path.write_text(made(shown), encoding="utf-8")
        base = PICTURES / name.replace(" ", "_")
        assert tool.draw(browser, str(path), base, unfold=False) == []
        assert all((PICTURES / f"{base.name}{end}").stat().st_size > 10_000 for end in ENDINGS)


def test_the_judge_sees_faults(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    path.write_text(
        "<!doctype html><html lang=en><title>x</title><body><main><p id=a>one</p><p id=a "
        "style='margin-top:-2.2rem'>two</p><div style='width:2000px'>wide</div><div class=scroll "
        "style='overflow:auto;width:90px'><p style='width:300px'>long</p></div></main>"
    )
    page = browser.open(path, 390, 844)
    found = " ".join(page.run(BOXES))
    page.close()
    for words in ("the page scrolls", "beyond the page", "scrolls sideways by", "one on the other"):
        assert words in found
    assert "two elements are called a" in found


PLACED = """(() => {
    const timeline = new Timeline(2021, [[33, 213], [214, 218.5], [219, 2019]]), faults = [];
    let last = -1;
    for (const [from, to] of [[0, 2021], [20, 250], [1000, 1500], [33, 213]]) {
        timeline.zoom(from, to);
        last = -1;
        for (let k = 0; k <= 500; k++) {
            const time = from + (to - from) * k / 500, place = timeline.place(time);
            const back = timeline.at(place);
            if (place <= last || place > 1 + 1e-9) faults.push(['order', time, place]);
            if (Math.abs(back - time) > 1e-6) faults.push(['back', time, back]);
            last = place;
        }
    }
    timeline.zoom(0, 2021);
    return [faults, timeline.breaks().long.length, timeline.place(219) - timeline.place(0)];
})()"""


def test_a_time_axis_with_rests_is_in_order_and_can_be_read_back(
    browser: Any, analysis: Analysis, tmp_path: Path
) -> None:
    """Two of three rests of a cycle are shown short; what moves has most of the axis."""
    path = tmp_path / "page.html"
    path.write_text(report(analysis), encoding="utf-8")
    page = browser.open(path, 1400, 900)
    faults, broken, moving = page.run(PLACED)
    page.close()
    assert faults == []
    assert broken == 2
    assert moving > 0.7
