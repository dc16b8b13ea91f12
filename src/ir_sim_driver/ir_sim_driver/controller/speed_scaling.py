"""How fast path time may pass now: what somebody has asked for, move_enable, and the tool's speed
in T1.
"""

from __future__ import annotations

from ir_msgs_py.plc import OperatingMode
from ir_sim_driver.motion import Executor, ToolPoint, manual_scaling
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plc import Plc


class SpeedScaling:
    """Of what `executor` follows. factor: what was asked for, in [0, 1]."""

    def __init__(self, executor: Executor, tool: ToolPoint, plc: Plc, notices: Notices) -> None:
        self._executor = executor
        self._tool = tool
        self._plc = plc
        self._notices = notices
        self.factor = 1.0

    def ask(self, factor: float) -> float:
        """Take the factor into [0, 1] and return it; NaN and negative ones are ignored with a
        warning.
        """
        if not factor >= 0.0:
            self._notices.add(Level.WARN, f"speed scaling {factor:g} ignored: it must be in [0, 1]")
        else:
            self.factor = min(factor, 1.0)
        return self.factor

    def holds(self) -> str:
        """Why path time stands; "" where it may pass."""
        if not self._plc.levels.move_enable:
            return "the PLC's move_enable is 0"
        return "" if self.factor > 0.0 else "the speed scaling is 0"

    def now(self) -> float:
        """The factor that counts now."""
        if not self._plc.levels.move_enable:
            return 0.0
        path = self._executor.path
        if path is None or self._plc.operating_mode is not OperatingMode.T1:
            return self.factor
        s = self._executor.path_parameter
        stop_time = self._executor.stop_time
        return min(self.factor, manual_scaling(self._tool, path, s, stop_time))
