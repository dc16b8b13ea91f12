"""Load check: do the torques of a movement fit the load that the controller knows?"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Cell, Load, data_sheet_of
from ir_description.library import load_power_parameters
from ir_description.robot import DATA_SHEET
from ir_sim_driver.load_check.mass_estimate import (
    Declared,
    LoadFinding,
    NotedMotion,
    Uncertainty,
    weighed,
)
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend, Carried
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

# Settings.


@dataclass(frozen=True)
class LoadCheckSettings:
    """What the robot really carries, and when a difference from what was declared is noticed."""

    mass_error: float = setting(
        0.0,
        "By what share the load that the simulated robot carries is heavier than it was declared.",
        minimum=-0.9,
        maximum=1.0,
        read_only=True,
    )
    parameters: str = setting(
        "data_sheet",
        "What is known of the robot: 'data_sheet', or the path of a file that a fit wrote.",
        read_only=True,
    )
    threshold: float = setting(
        3.0,
        "Standard deviations of the estimated mass from which on it is noticed.",
        minimum=1.0,
        maximum=10.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


# Samples of a movement, collected while it is driven.

_REACH = 3  # looks before and after an instant that its speed and acceleration are taken from
# looks between two instants at first, and instants kept
_EVERY = 16
_MOST = 96
LEAST = 6
"""Instants that a check needs."""


class LoadWatch:
    """Is given the robot every `period` [s] while a movement is driven; keeps few instants of any
    length.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.begin()

    def begin(self) -> None:
        """A movement starts."""
        self._seen: deque[FloatArray] = deque(maxlen=2 * _REACH + 1)
        self._torque: FloatArray | None = None
        self._looks = 0
        self._every = _EVERY
        self._rows: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []

    def look(self, robot: Backend) -> None:
        """Take the robot's position, and now and then its torque."""
        self._seen.append(robot.q)
        phase = self._looks % self._every
        if phase == _REACH:
            self._torque = robot.torque
        elif phase == 2 * _REACH and self._torque is not None:
            first = self._seen[0]
            middle = self._seen[_REACH]
            last = self._seen[-1]
            self._rows.append((first, middle, last, self._torque))
            if len(self._rows) > _MOST:
                del self._rows[::2]
                self._every *= 2
        self._looks += 1

    def motion(self) -> NotedMotion | None:
        """The instants so far; None while they are too few, or not finite, as where the physics
        failed.
        """
        if len(self._rows) < LEAST:
            return None
        first, middle, last, torque = np.ascontiguousarray(np.array(self._rows).swapaxes(0, 1))
        reach = _REACH * self._period
        qd = (last - first) / (2.0 * reach)
        qdd = (last - 2.0 * middle + first) / reach**2
        motion = NotedMotion(middle, qd, qdd, torque)
        return motion if all(np.isfinite(values).all() for values in motion) else None


# Check of a running robot: every movement weighs the declared load at its end.


class LoadChecks:
    """Of the robot of `cell`; period [s] between two looks; notices: what is noticed is a warning
    there.

    last: what the last movement said, None where it said nothing or is still driven.
    """

    def __init__(
        self, cell: Cell, settings: LoadCheckSettings, notices: Notices, period: float
    ) -> None:
        own = settings.parameters not in ("", DATA_SHEET)
        sheet = data_sheet_of(cell.robot, cell.robot.controller)
        parameters = load_power_parameters(settings.parameters, cell.robot) if own else sheet
        self._settings = settings
        self._notices = notices
        self._robot = Uncertainty(cell.robot, parameters, cell.robot.marks, cell.base_pose)
        self._watch = LoadWatch(period)
        self._declared: Declared | None = None
        self.last: LoadFinding | None = None
        self._new: LoadFinding | None = None

    def really(self, load: Carried) -> tuple[Load, ...]:
        """What the simulated robot carries where `load` is declared."""
        self._declared = Declared(load, self._robot) if load.loads else None
        self._watch.begin()
        factor = 1.0 + self._settings.mass_error
        return tuple(
            replace(each, mass=each.mass * factor, inertia=each.inertia * factor)
            for each in load.loads
        )

    def begin(self) -> None:
        """A movement starts."""
        self._watch.begin()
        self.last = None

    def take(self) -> LoadFinding | None:
        """What the last movement said, once."""
        finding = self._new
        self._new = None
        return finding

    def look(self, robot: Backend) -> None:
        """The motors drive the robot along a movement."""
        self._watch.look(robot)

    def ended(self, trajectory_id: str) -> LoadFinding | None:
        """What the movement says of the load; None where no load is declared or it says nothing."""
        motion = self._watch.motion()
        declared = self._declared
        self.begin()
        if motion is None or declared is None:
            return None
        finding = weighed(motion, declared, self._settings.threshold)
        if finding is None:
            return None
        finding = replace(finding, trajectory_id=trajectory_id)
        self.last = finding
        self._new = finding
        if finding.noticed:
            self._notices.add(Level.WARN, finding.sentence)
        return finding
