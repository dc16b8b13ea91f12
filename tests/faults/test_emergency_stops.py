"""Every press of the emergency stop counts: however short, in every mode, whoever writes a 0
afterwards.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient

from ir_msgs_py.modes import OFF_THE_NETWORK, Mode, TransitionTimes
from ir_msgs_py.plc import PlcInputs
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import Driver, Simulation, SimulationSettings, TrajectoryGoal, make_simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plc import SERVICE, TOPIC
from ir_sim_driver.plc.inputs import BITS
from ir_sim_driver.plc.modbus import COILS, MODBUS, ControllerTables, ModbusTcp, answered

QUICK = TransitionTimes(
    stand_on_brakes_enter=0.05,
    stand_on_brakes_leave=0.05,
    stand_on_brakes_minimum_stay=0.05,
    bus_power_off_enter=0.05,
    bus_power_off_leave=0.05,
    bus_power_off_minimum_stay=0.05,
    hibernation_enter=0.05,
    hibernation_leave=0.05,
    hibernation_minimum_stay=0.05,
)
PERIOD = 2_000_000
Press = Callable[[Driver], None]


class Cell:
    """A ticked driver."""

    def __init__(self) -> None:
        self.simulation: Simulation = make_simulation(
            "open", backend="ideal", settings=SimulationSettings(transitions=QUICK)
        )
        self.driver = Driver(self.simulation)
        self.stamp = 0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.002)):
            self.stamp += PERIOD
            self.driver.tick(self.stamp)

    def until(self, mode: Mode) -> None:
        for _ in range(2_000):
            if self.simulation.modes.mode is mode:
                return
            self.run(0.002)
        raise AssertionError(
            f"{mode.name} has not come, the mode is {self.simulation.modes.mode.name}"
        )

    def bring_into(self, mode: Mode) -> None:
        """By the shortest route from standing on motors."""
        self.run(0.1)
        bits = {"BRAKES": "drives_off", "BUS_POWER_OFF": "ab", "HIBERNATION": "hib"}
        bit = next((bit for ending, bit in bits.items() if mode.name.endswith(ending)), None)
        if bit is not None:
            self.driver.press(SERVICE, bit, True)
        if mode.name.startswith("FROM_"):
            self.until(Mode[mode.name.removeprefix("FROM_").replace("BRAKES", "STAND_ON_BRAKES")])
            if bit == "hib":
                self.driver.plc.write_inputs(SERVICE, {"hib": False})
                self.run(0.1)
                self.driver.plc.wake()
            elif bit == "drives_off":
                self.driver.press(SERVICE, "drives_off", False)
                self.driver.press(SERVICE, "drives_on", True)
            else:
                self.driver.press(SERVICE, "ab", False)
        if mode is Mode.MOVING:
            q = self.simulation.backend.q
            rest = np.zeros((2, 6))
            home = np.array(self.simulation.cell.machine_home)
            names = self.simulation.robot.joint_names
            target = home + (-0.3 if np.abs(q - home).max() < 0.15 else 0.0)
            goal = TrajectoryGoal(
                JointTrajectory.from_seconds(names, [0.0, 2.0], [q, target], rest, rest)
            )
            self.simulation.execute(self.simulation.vet(goal, 0), 0)
            self.run(0.5)
        self.until(mode)

    def wake_up(self) -> None:
        """Let every rest end."""
        self.driver.plc.write_inputs(SERVICE, {"ab": False, "hib": False})
        if self.simulation.modes.mode in (Mode.TO_HIBERNATION, Mode.HIBERNATION):
            self.until(Mode.HIBERNATION)
            self.run(0.1)
            self.driver.plc.wake()
        self.run(0.5)

    def settle(self) -> None:
        """Whatever it was doing, until it stands on motors or in the emergency stop, all levels at
        0.
        """
        for _ in range(20):
            self.driver.plc.write_all_inputs(TOPIC, PlcInputs())
            self.driver.plc.wake()
            self.run(0.05)
            if self.simulation.modes.mode in (Mode.EMERGENCY_STOP, Mode.STAND_ON_MOTORS):
                return

    def recover(self) -> None:
        """Stand on motors, ready for anything."""
        self.driver.recover()
        self.driver.press(SERVICE, "drives_on", True)
        self.run(0.1)
        self.driver.press(SERVICE, "drives_on", False)
        self.until(Mode.STAND_ON_MOTORS)


@pytest.fixture
def cell() -> Iterator[Cell]:
    made = Cell()
    yield made
    made.driver.close()


def by_service(driver: Driver) -> None:
    driver.press(SERVICE, "emergency_stop", True)


def by_topic(driver: Driver) -> None:
    driver.plc.write_all_inputs(TOPIC, PlcInputs(emergency_stop=True))


def by_modbus(driver: Driver) -> None:
    driver.plc.write_inputs("modbus", {"emergency_stop": True})


PRESSES = (by_service, by_topic, by_modbus)
MODES = [mode for mode in Mode if mode is not Mode.EMERGENCY_STOP]


@pytest.mark.parametrize("press", PRESSES)
@pytest.mark.parametrize("mode", MODES)
def test_a_press_that_is_overwritten_at_once_is_latched_until_recover(
    cell: Cell, mode: Mode, press: Press
) -> None:
    cell.bring_into(mode)
    press(cell.driver)
    cell.driver.plc.write_all_inputs(TOPIC, PlcInputs())  # a PLC that knows of no press
    assert cell.simulation.stopped
    cell.wake_up()
    assert cell.simulation.modes.mode is Mode.EMERGENCY_STOP
    q = cell.simulation.backend.q.copy()
    cell.run(1.0)
    assert np.array_equal(cell.simulation.backend.q, q)
    assert "nothing resumes" in cell.driver.recover()
    cell.until(Mode.FROM_BRAKES)


@pytest.mark.parametrize("mode", [m for m in MODES if m not in OFF_THE_NETWORK])
def test_the_answer_comes_when_the_plant_has_seen_it(cell: Cell, mode: Mode) -> None:
    cell.bring_into(mode)
    cell.driver.press(SERVICE, "emergency_stop", True)
    assert not cell.simulation.executor.active
    assert not cell.simulation.outputs().alarm_stop


def test_motors_that_hold_during_a_transition_are_off_at_once(cell: Cell) -> None:
    cell.bring_into(Mode.TO_BUS_POWER_OFF)
    cell.driver.press(SERVICE, "emergency_stop", True)
    cell.run(0.01)
    assert not cell.simulation.backend.torque.any()


def test_recover_before_the_drives_are_on_resets_the_latch_and_nothing_else(cell: Cell) -> None:
    cell.bring_into(Mode.BUS_POWER_OFF)
    by_service(cell.driver)
    with pytest.raises(RequestRefusedError, match="still pressed"):
        cell.driver.recover()
    cell.driver.press(SERVICE, "emergency_stop", False)
    cell.run(0.1)
    assert "is reset" in cell.driver.recover()
    assert cell.simulation.modes.mode is Mode.BUS_POWER_OFF
    cell.wake_up()
    assert cell.simulation.modes.mode is Mode.STAND_ON_MOTORS


@pytest.mark.parametrize("press", PRESSES)
@pytest.mark.parametrize("mode", [Mode.TO_HIBERNATION, Mode.HIBERNATION, Mode.FROM_HIBERNATION])
def test_after_a_stop_in_hibernation_the_robot_stays_awake(
    cell: Cell, mode: Mode, press: Press
) -> None:
    """HIB is still 1 when the controller is woken: it is ignored until it has been 0, as always."""
    cell.bring_into(mode)
    cell.driver.plc.write_inputs(SERVICE, {"hib": True})
    press(cell.driver)
    cell.driver.plc.write_inputs(SERVICE, {"emergency_stop": False})
    cell.driver.plc.write_inputs(SERVICE, {"hib": True})
    cell.driver.plc.wake()
    if mode is Mode.TO_HIBERNATION:
        cell.until(Mode.HIBERNATION)
        cell.run(0.1)
        cell.driver.plc.wake()
    cell.until(Mode.EMERGENCY_STOP)
    cell.driver.recover()
    cell.until(Mode.STAND_ON_MOTORS)
    cell.run(1.0)
    assert cell.simulation.modes.mode is Mode.STAND_ON_MOTORS


@pytest.mark.parametrize("bit", ["ab", "drives_off"])
def test_who_takes_its_own_bit_back_is_heard_also_after_a_stop(cell: Cell, bit: str) -> None:
    """A stop came between the request and its answer, or while the driver was suspended."""
    cell.run(0.1)
    cell.driver.press(SERVICE, bit, True, client="runner")
    cell.run(1.0)
    asked = time.monotonic_ns()
    by_service(cell.driver)
    cell.driver.press(SERVICE, f"end_{bit}", True, came_ns=asked, client="runner")
    cell.driver.press(SERVICE, "emergency_stop", False)
    cell.run(0.5)
    assert cell.simulation.modes.mode is Mode.EMERGENCY_STOP
    cell.driver.recover()
    cell.until(Mode.STAND_ON_MOTORS)
    assert cell.simulation.control.refusal() == ""


def test_a_rest_that_its_end_does_not_end_says_why(cell: Cell) -> None:
    cell.bring_into(Mode.BUS_POWER_OFF)
    cell.driver.press(SERVICE, "AUT", True)
    _, remark = cell.driver.press(SERVICE, "end_ab", True)
    assert "operating mode is AUT, must be EXT" in remark
    cell.run(0.5)
    assert cell.simulation.modes.mode is Mode.BUS_POWER_OFF


def test_a_press_while_recovering_stops_again(cell: Cell) -> None:
    cell.bring_into(Mode.MOVING)
    by_modbus(cell.driver)
    cell.run(0.5)
    cell.driver.plc.write_inputs("modbus", {"emergency_stop": False})
    cell.run(0.1)
    cell.driver.recover()
    by_topic(cell.driver)
    cell.driver.plc.write_all_inputs(TOPIC, PlcInputs())
    cell.run(1.0)
    assert cell.simulation.modes.mode is Mode.EMERGENCY_STOP


def test_who_does_not_own_the_inputs_presses_all_the_same(cell: Cell) -> None:
    cell.bring_into(Mode.STAND_ON_MOTORS)
    object.__setattr__(cell.simulation.plc._settings, "owner", "modbus")
    with pytest.raises(RequestRefusedError):
        by_topic(cell.driver)
    assert cell.simulation.modes.mode is Mode.EMERGENCY_STOP


def test_a_modbus_client_that_writes_1_and_0_while_asleep_is_answered_and_latched(
    cell: Cell,
) -> None:
    cell.bring_into(Mode.HIBERNATION)
    server = ModbusTcp(modbus=True, modbus_port=0).open(cell.driver.plc)
    client = ModbusTcpClient("127.0.0.1", port=server.port, timeout=PATIENCE)
    try:
        assert client.connect()
        assert not client.write_coil(COILS.index("emergency_stop"), True).isError()
        assert client.write_coil(COILS.index("emergency_stop"), False).exception_code == 4
    finally:
        client.close()
        server.close()
    cell.driver.plc.write_inputs(SERVICE, {"emergency_stop": False})
    cell.wake_up()
    assert cell.simulation.modes.mode is Mode.EMERGENCY_STOP


def by_modbus_pulse(driver: Driver) -> None:
    """As a field bus writes: 1, and 0 in the next request."""
    tables = ControllerTables(driver.plc, 2.0)
    coil = COILS.index("emergency_stop")
    assert answered(struct.pack(">BHH", 5, coil, 0xFF00), tables)[0] == 5
    answered(struct.pack(">BHH", 5, coil, 0), tables)


def traffic(driver: Driver, writer: str) -> None:
    """A PLC writes all its levels again, and knows of no emergency stop."""
    levels = replace(driver.plc.inputs(), emergency_stop=False)
    if writer == TOPIC:
        driver.plc.write_all_inputs(TOPIC, levels)
    else:
        driver.plc.write_inputs(writer, {bit: bool(getattr(levels, bit)) for bit in BITS})


def lost(presses: int, seed: int) -> list[str]:
    """Presses in every mode at random instants amid a PLC's traffic, and those that were not
    latched.
    """
    generator = np.random.default_rng(seed)
    cell = Cell()
    missing = []
    every = (*PRESSES, by_modbus_pulse)
    for k in range(presses):
        mode = MODES[k % len(MODES)]
        press = every[int(generator.integers(len(every)))]
        rate = int(generator.choice([20, 100, 250]))
        writer = str(generator.choice([TOPIC, MODBUS]))
        cell.bring_into(mode)
        at = int(generator.integers(20))
        for tick in range(at + 26):
            if tick == at:
                press(cell.driver)
            if tick % (500 // rate) == 0:
                traffic(cell.driver, writer)
            cell.run(0.002)
        latched = cell.simulation.stopped
        cell.settle()
        if not latched or cell.simulation.modes.mode is not Mode.EMERGENCY_STOP:
            missing.append(f"press {k} {press.__name__} in {mode.name} at {rate} Hz of {writer}")
        cell.recover()
    cell.driver.close()
    return missing


def test_forty_presses_in_every_mode_amid_a_plcs_traffic_are_latched() -> None:
    assert lost(42, seed=1) == []


@pytest.mark.long
def test_a_thousand_presses_in_every_mode_amid_a_plcs_traffic_are_latched() -> None:
    assert lost(1_000, seed=2) == []
