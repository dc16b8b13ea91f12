"""Answers to the services: a request's values to the driver, what it says into the response.

Requests and responses are those of ir_msgs/srv.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ir_description import Cell
from ir_msgs_py.ros.power_conversions import plc_inputs_to_msg, power_mode_to_msg
from ir_msgs_py.ros.serving import answered
from ir_msgs_py.status import Status, StatusCode
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError, RequestRefusedError
from ir_sim_driver.plant import CUSTOM, Carried, carried, custom_load
from ir_sim_driver.plc import SERVICE
from ir_values.errors import IrError


class DriverServices:
    """Answers for `driver` in the name of `source`; load_changed is called when the robot carries
    another.
    """

    def __init__(self, driver: Driver, source: str, load_changed: Callable[[], None]) -> None:
        self._driver = driver
        self._source = source
        self._load_changed = load_changed

    def set_plc_input(self, request: Any, response: Any, came_ns: int = 0, client: str = "") -> Any:
        """Set one bit, or the mode switch by the name of its position; INPUT_IGNORED where it won't
        count. came_ns: when the request came [ns of the monotonic clock]; client: who sent it. The
        response has the levels as they are, also where it refuses.
        """

        def work() -> str:
            value = bool(request.value)
            try:
                levels, remark = self._driver.press(
                    SERVICE, request.name, value, came_ns, client, int(request.after_stop)
                )
            except RequestRefusedError:
                response.inputs = plc_inputs_to_msg(self._driver.plc.inputs())
                raise
            response.inputs = plc_inputs_to_msg(levels)
            if remark:
                raise RequestRefusedError(StatusCode.INPUT_IGNORED, remark)
            return ""

        return self._answer(response, work)

    def start_pause(self, request: Any, response: Any) -> Any:
        """PROFIenergy Start_Pause."""

        def work() -> str:
            mode = self._driver.start_pause(float(request.pause))
            response.mode = power_mode_to_msg(mode)
            response.time_to_pause = mode.time_to_pause
            response.regular_time_to_operate = mode.regular_time_to_operate
            return f"{mode.name} for {request.pause:g} s"

        return self._answer(response, work)

    def end_pause(self, request: Any, response: Any) -> Any:
        """PROFIenergy End_Pause."""

        def work() -> str:
            response.time_to_operate = self._driver.end_pause()
            return ""

        return self._answer(response, work)

    def query_modes(self, request: Any, response: Any) -> Any:
        """PROFIenergy Query_Modes."""

        def work() -> str:
            modes, current = self._driver.query_modes()
            response.modes = [power_mode_to_msg(mode) for mode in modes]
            response.current = int(current)
            return ""

        return self._answer(response, work)

    def recover(self, request: Any, response: Any, came_ns: int = 0) -> Any:
        """Leave the emergency stop; came_ns: when the request came [ns of the monotonic clock]."""
        return self._answer(response, lambda: self._driver.recover(came_ns))

    def set_load(self, request: Any, response: Any) -> Any:
        """Carry named loads, or one from numbers."""

        def load(cell: Cell) -> Carried:
            if request.load != CUSTOM:
                return carried(cell, request.load)
            com = request.center_of_mass
            return custom_load(
                cell,
                float(request.mass),
                np.array((com.x, com.y, com.z)),
                np.array(request.inertia),
                float(request.watts_always),
                float(request.watts_drive_bus),
            )

        def work() -> str:
            now = self._driver.set_load(load)
            response.total_mass = now.mass
            return f"carrying {now.text}"

        self._answer(response, work)
        if response.status.code == StatusCode.SUCCESS:
            self._load_changed()
        return response

    def _answer(self, response: Any, work: Callable[[], str]) -> Any:
        """Run `work`; what it returns is the remark, what it raises the refusal."""
        return answered(
            response, self._source, lambda: Status.success(work()), known_status, self._driver.warn
        )


def known_status(error: Exception) -> Status | None:
    """The status of a request that an error ended, None for one that nobody thought of."""
    if isinstance(error, RequestRefusedError):
        return Status(error.code, str(error))
    if isinstance(error, (IrError, DriverError)):
        return Status(StatusCode.FAILURE, str(error))
    return None
