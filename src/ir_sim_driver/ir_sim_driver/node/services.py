"""Answers to the services: a request's values to the simulation, what it says into the response.

Requests and responses are those of ir_msgs/srv. While the controller is off the network every answer is a
refusal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ir_msgs_py.errors import MsgsError
from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.ros.conversions import plc_inputs_to_msg, power_mode_to_msg, status_to_msg
from ir_msgs_py.status import Status, StatusCode
from ir_sim_driver.controller.driver import Driver
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import DriverError, RequestRefusedError
from ir_sim_driver.plant.loads import CUSTOM, carried, custom_load
from ir_sim_driver.plc.inputs import SERVICE


class Services:
    """Answers for `driver` in the name of `source`; mac: what wakes the controller."""

    def __init__(self, driver: Driver, source: str, mac: str, load_changed: Callable[[], None]) -> None:
        self._driver, self._source, self._mac = driver, source, mac
        self._load_changed = load_changed

    def set_plc_input(self, request: Any, response: Any) -> Any:
        """Set one bit, or the mode switch by the name of its position; the remark: why it won't count."""

        def work(simulation: Simulation) -> str:
            plc = simulation.plc
            try:
                plc.raw.with_bit(request.name, bool(request.value))
            except MsgsError as error:
                raise RequestRefusedError(StatusCode.INVALID_OBJECT_NAME, str(error)) from error
            refusal = plc.refusal(SERVICE, request.name == "emergency_stop" and bool(request.value))
            if refusal:
                raise RequestRefusedError(StatusCode.INVALID_ROBOT_STATE, refusal)
            if request.name in OperatingMode.__members__:
                plc.set_operating_mode(OperatingMode[request.name])
            else:
                plc.set_bit(request.name, bool(request.value))
            response.inputs = plc_inputs_to_msg(plc.raw)
            return plc.remark(request.name, simulation.pauses.rest is not None)

        return self._answer(response, work)

    def start_pause(self, request: Any, response: Any) -> Any:
        """PROFIenergy Start_Pause."""

        def work(simulation: Simulation) -> str:
            mode = simulation.pauses.start(float(request.pause), simulation.executor.active)
            response.mode = power_mode_to_msg(mode)
            response.time_to_pause = mode.time_to_pause
            response.regular_time_to_operate = mode.regular_time_to_operate
            return f"{mode.name} for {request.pause:g} s"

        return self._answer(response, work)

    def end_pause(self, request: Any, response: Any) -> Any:
        """PROFIenergy End_Pause."""

        def work(simulation: Simulation) -> None:
            response.time_to_operate = simulation.pauses.end()

        return self._answer(response, work)

    def query_modes(self, request: Any, response: Any) -> Any:
        """PROFIenergy Query_Modes."""

        def work(simulation: Simulation) -> None:
            response.modes = [power_mode_to_msg(mode) for mode in simulation.pauses.query_modes()]
            response.current = int(simulation.modes.mode)

        return self._answer(response, work)

    def recover(self, request: Any, response: Any) -> Any:
        """Leave the emergency stop."""
        return self._answer(response, lambda simulation: simulation.recover())

    def set_load(self, request: Any, response: Any) -> Any:
        """Carry named loads, or one from numbers."""

        def work(simulation: Simulation) -> str:
            cell = simulation.cell
            if request.load == CUSTOM:
                com = request.center_of_mass
                load = custom_load(
                    cell,
                    float(request.mass),
                    np.array((com.x, com.y, com.z)),
                    np.array(request.inertia),
                    float(request.watts_always),
                    float(request.watts_drive_bus),
                )
            else:
                load = carried(cell, request.load)
            simulation.set_load(load)
            response.total_mass = load.mass
            return f"carrying {load.text}"

        self._answer(response, work)
        if response.status.code == StatusCode.SUCCESS:
            self._load_changed()
        return response

    def _answer(self, response: Any, work: Callable[[Simulation], str | None]) -> Any:
        """Run `work` on the simulation; what it returns is the remark, what it raises the refusal."""
        try:
            with self._driver.locked() as simulation:
                if not simulation.on_the_network:
                    raise RequestRefusedError(
                        StatusCode.INVALID_ROBOT_STATE,
                        f"the controller is off the network ({simulation.modes.mode.name}): only a "
                        "Wake-on-LAN "
                        f"packet for {self._mac} wakes it",
                    )
                remark = work(simulation)
            answer = Status.success(remark or "", self._source)
        except RequestRefusedError as error:
            answer = Status(error.code, str(error), self._source)
        except (MsgsError, DriverError) as error:
            answer = Status(StatusCode.FAILURE, str(error), self._source)
        response.status = status_to_msg(answer)
        return response
