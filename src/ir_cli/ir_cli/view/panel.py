"""Panel beside the picture: figures in words, and controls to move, play and plan.

Every text is escaped: names, paths and sentences come from files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from ir_cli.view.clearance import StationAccess
from ir_cli.view.drawing import SCALE
from ir_cli.view.playback import PlayedMotion
from ir_description import RobotModel, Station

Post = Callable[[str, Callable[[], None]], None]
NOBODY = "nothing"
SPEEDS = {f"{speed:g}x": speed for speed in (0.25, 0.5, 1.0, 2.0, 4.0)}
_BOX = "style='font-size:12px;line-height:1.4;padding:2px 12px;overflow-wrap:anywhere'"
_BAD = "#d11a2a"


@dataclass(frozen=True, eq=False)
class Actions:
    """What the controls do; each is called with nothing, and reads what it needs from the panel."""

    joints: Callable[[], None]
    play: Callable[[], None]
    time: Callable[[], None]
    at: Callable[[], None]
    target: Callable[[], None]
    undo: Callable[[], None]
    save: Callable[[], None]
    plan: Callable[[], None]
    cancel: Callable[[], None]
    show: Callable[[], None]


class Panel:
    """The controls of one robot."""

    def __init__(self, gui: Any, robot: RobotModel, post: Post, do: Actions) -> None:
        self._gui = gui
        self._post = post
        gui.configure_theme(  # beside the picture, not over it
            control_layout="collapsible",
            control_width="medium",
            show_logo=False,
            show_share_button=False,
        )
        self.status = gui.add_html("")
        with gui.add_folder("Program"):
            self.plan_text = gui.add_html("")
            self.progress = gui.add_progress_bar(0.0, visible=False)
            self.cancel = self._button("Cancel planning", do.cancel, visible=False)
            self.again = self._button("Plan again", do.plan)
            self.play = self._button("Play", do.play)
            self.time = self._input(gui.add_slider("time s", 0.0, 1.0, 0.01, 0.0), "time", do.time)
            self.speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1x")
        with gui.add_folder("Stations"):
            self.stations_text = gui.add_html("")
            self.at = self._input(gui.add_dropdown("robot at", (NOBODY,)), "at", do.at)
        with gui.add_folder("Joints, deg", expand_by_default=False):
            self.joints = [self._joint(k, robot, do.joints) for k in range(robot.n)]
        with gui.add_folder("Move", expand_by_default=False):
            self.target = self._input(gui.add_dropdown("drag", (NOBODY,)), "target", do.target)
            self.moves_text = gui.add_html("")
            self.save = self._button("Save as a new file", do.save, visible=False)
            self.undo = self._button("Undo all moves", do.undo, visible=False)
        with gui.add_folder("Show", expand_by_default=False):
            self.shown = {
                name: self._input(
                    gui.add_checkbox(name, name in ("zones", "labels")), "show", do.show
                )
                for name in ("zones", "labels", "capsules", "reach")
            }

    def of_cell(self, name: str, targets: Iterable[str], stations: Iterable[Station]) -> None:
        """What can be chosen in another cell."""
        self._gui.set_panel_label(f"ir view {name}")
        self.target.options = (NOBODY, *targets)
        self.target.value = NOBODY
        self.at.options = (NOBODY, "home", "park", *(station.name for station in stations))
        self.at.value = NOBODY

    def working(self, busy: bool) -> None:
        """Whether something is planned: there is progress to see, and something to cancel."""
        self.progress.visible = self.cancel.visible = busy
        self.progress.value = 0.0

    def _joint(self, k: int, robot: RobotModel, action: Callable[[], None]) -> Any:
        low, high, home = np.degrees(
            [robot.position_min[k], robot.position_max[k], robot.machine_home[k]]
        )
        slider = self._gui.add_slider(f"A{k + 1}", float(low), float(high), 0.1, float(home))
        return self._input(slider, "joints", action)

    def _button(self, label: str, action: Callable[[], None], *, visible: bool = True) -> Any:
        button = self._gui.add_button(label, visible=visible)
        button.on_click(lambda _: self._post(label, action))
        return button

    def _input(self, handle: Any, key: str, action: Callable[[], None]) -> Any:
        def changed(event: Any) -> None:
            if event.client_id is not None:  # a person, not this program
                self._post(key, action)

        handle.on_update(changed)
        return handle


def box(lines: Iterable[str]) -> str:
    """Escaped lines as HTML."""
    return f"<div {_BOX}>{'<br>'.join(lines)}</div>"


def bad(text: str) -> str:
    """A text in red, escaped."""
    return f"<b style='color:{_BAD}'>{escape(text)}</b>"


def plain(text: str) -> str:
    """A text, escaped."""
    return escape(text)


def stations_html(found: Sequence[StationAccess], complete: bool) -> str:
    """One line per station and load: how many configurations are free, or why none is."""
    lines = []
    for each in found:
        head = f"{each.station} with {each.load}: {each.free} of {each.reached} free"
        if each.free and each.clearance is not None:
            head += f", {1e3 * each.clearance:.1f} mm"
        lines.append(plain(head) if each.free else f"{bad(head)}<br>{plain(each.sentence)}")
    if not complete:
        lines.append("checking …")
    return box(lines or ["no stations"])


def legend_html(motion: PlayedMotion) -> str:
    """The colours of the path with the watts that they mean."""
    stops = ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in SCALE)
    low = motion.watts.min() / 1e3
    high = motion.peak / 1e3
    bar = f"<div style='height:8px;background:linear-gradient(to right,{stops})'></div>"
    note = "<br>pauses are played in 1 s at most" if motion.shortened else ""
    return f"<div {_BOX}>{bar}{low:.1f} kW to {high:.1f} kW at the mains{note}</div>"
