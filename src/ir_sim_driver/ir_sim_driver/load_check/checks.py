"""The load check of a running robot: every movement is watched, and weighs the declared load at its
end.
"""

from __future__ import annotations

from dataclasses import replace

from ir_description import DATA_SHEET, Cell, Load, data_sheet_of, load_power_parameters
from ir_sim_driver.load_check.estimate import Declared, LoadFinding, weighed
from ir_sim_driver.load_check.settings import LoadCheckSettings
from ir_sim_driver.load_check.uncertainty import Uncertainty
from ir_sim_driver.load_check.watch import LoadWatch
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plant import Backend, Carried


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
        parameters = load_power_parameters(settings.parameters) if own else sheet
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
        self.last = self._new = finding = replace(finding, trajectory_id=trajectory_id)
        if finding.noticed:
            self._notices.add(Level.WARN, finding.sentence)
        return finding
