"""Draw the pictures of docs/report.md and README.md: a report at a desk, on a phone and on paper;
the live view; today's program beside the planner's.

    make demo && python tools/report_pictures.py [--recording out/demo.mcap] [--folder docs/images]

Chromium draws them without a screen; a fault of the page ends the script.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from _chromium import Browser
from _live_picture import live_view

from ir_planner import Planner
from ir_planner.before_after import before_after_common
from ir_recorder import Analysis, analyse, findings, read_recording
from ir_recorder.report import write_report
from ir_recorder.report.before_after import write_before_after

PAPER = (740, 1094)  # px at 96 dpi: A4 less the margins of the page's style


@dataclass(frozen=True)
class Shot:
    """A picture: width and height of the window [px], the place that is scrolled to, and how it is
    shown.
    """

    name: str
    size: tuple[int, int]
    at: str = "header"
    touch: bool = False
    media: str = "screen"


SHOTS = (
    Shot("report.png", (1400, 1730)),
    Shot("report_phone.png", (390, 844), touch=True),
    Shot("report_methods.png", (1400, 640), at="#methods"),
    Shot("report_print.png", PAPER, media="print"),
)
COMPARED = Shot("compare.png", (1100, 880))
LIVE = Shot("live.png", (1400, 1500))


def main() -> int:
    """Writes all pictures; returns 1 where the page has a fault."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--recording", type=Path, default=Path("out/demo.mcap"), help="default: out/demo.mcap"
    )
    parser.add_argument(
        "--folder", type=Path, default=Path("docs/images"), help="default: docs/images"
    )
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    analysis = analyse(read_recording(asked.recording))
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        file = write_report(analysis, findings(analysis), Path(folder) / "report.html")
        faults = [fault for shot in SHOTS for fault in _draw(browser, file, shot, asked.folder)]
        planner = Planner("demo", clock=lambda: 0.0)
        start = planner.cell.posture(planner.cell.cycle_start())
        found = before_after_common(planner, (), start)
        file = write_before_after(found, planner.cell, Path(folder) / "compare.html")
        faults += _draw(browser, file, COMPARED, asked.folder)
        with live_view(analysis, _instant(analysis)) as server:
            faults += _draw(browser, server.address, LIVE, asked.folder)
    drawn = (*SHOTS, COMPARED, LIVE)
    sys.stdout.write("".join(f"{asked.folder / shot.name}\n" for shot in drawn))
    sys.stderr.write("".join(f"{fault}\n" for fault in faults))
    return 1 if faults else 0


def _instant(analysis: Analysis) -> float:
    """The middle of the longest movement [s], when the robot is on its path."""
    longest = max(analysis.movements, key=lambda result: result.seconds)
    return longest.step.start + 0.6 * longest.seconds


def _draw(browser: Browser, file: Path | str, shot: Shot, folder: Path) -> list[str]:
    """Writes one picture; returns what was wrong with the page."""
    page = browser.open(file, *shot.size, touch=shot.touch)
    if isinstance(file, str):
        page.wait("document.getElementById('no-motion').hidden")
    if shot.media == "print":
        page.call("Emulation.setEmulatedMedia", media="print")
        page.run("dispatchEvent(new Event('beforeprint'))")
    place = f"document.querySelector('{shot.at}')"
    page.run(f"{place}.open = true")  # where it is folded away
    page.frame()
    page.run(f"{place}.scrollIntoView({{behavior: 'instant'}})")
    page.picture(folder / shot.name, whole=False)
    wrong = [*page.faults, *(page.requests if isinstance(file, Path) else ())]
    page.close()
    return wrong


if __name__ == "__main__":
    sys.exit(main())
