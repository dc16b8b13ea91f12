"""What the driver announces to whoever comes later, and hears: the planner's cell, the machines'
signals.

Load, robot, timers and states of machines are latched; contacts are not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from ir_description import DescriptionError, cell_from_yaml
from ir_msgs.msg import CarriedLoad as CarriedLoadMsg
from ir_msgs.msg import CellState, Signal
from ir_msgs.msg import Contact as ContactMsg
from ir_msgs.msg import ControllerTimers as ControllerTimersMsg
from ir_msgs.msg import MachineStates as MachineStatesMsg
from ir_msgs_py import names
from ir_msgs_py.announcements import CarriedLoad
from ir_msgs_py.names import own
from ir_msgs_py.ros.plan_conversions import contact_to_msg, machine_states_to_msg
from ir_msgs_py.ros.power_conversions import carried_load_to_msg, controller_timers_to_msg
from ir_msgs_py.ros.serving import ANY, unexpected
from ir_msgs_py.ros.topics import LATCHED, CommandTopic
from ir_sim_driver.controller import Driver, PlannedCell
from ir_sim_driver.plant import Carried, plant_to_yaml
from ir_values.arrays import FloatArray

_CONTACTS = QoSProfile(depth=100)


class DriverAnnouncements:
    """Of `driver`, by `node`; now: time of the plant; load_changed: called when the robot carries
    another load, and at the start.

    A cell is read beside everything else.
    """

    def __init__(
        self,
        node: Node,
        driver: Driver,
        now: Callable[[], Time],
        load_changed: Callable[[], None],
    ) -> None:
        self._driver = driver
        self._now = now
        self._load_changed = load_changed
        self._load: Carried | None = None
        self._cells = ThreadPoolExecutor(max_workers=1, thread_name_prefix="cells")
        self._offered: deque[CellState] = deque(maxlen=1)  # a flood of large cells waits nowhere
        self._loads = node.create_publisher(CarriedLoadMsg, own(names.CARRIED_LOAD), LATCHED)
        self._description = node.create_publisher(String, names.ROBOT_DESCRIPTION, LATCHED)
        self._timers = node.create_publisher(
            ControllerTimersMsg, own(names.CONTROLLER_TIMERS), LATCHED
        )
        self._machines = node.create_publisher(MachineStatesMsg, own(names.MACHINE_STATES), LATCHED)
        self._contacts = node.create_publisher(ContactMsg, own(names.CONTACTS), _CONTACTS)
        self._version = -1
        timers = controller_timers_to_msg(driver.timers)
        timers.header.stamp = self._now()
        self._timers.publish(timers)
        self._plant = node.create_publisher(String, own(names.PLANT), LATCHED)
        self._plant.publish(String(data=plant_to_yaml(driver.plant)))
        self.look()
        self._changed = node.create_guard_condition(self.look)
        node.create_subscription(CellState, names.CELL, self._heard, LATCHED)
        for topic in (names.SIGNALS, names.MACHINE_SIGNALS):
            CommandTopic(node, Signal, topic, self._signalled, of=lambda msg: msg.name)

    def close(self) -> None:
        """Read no more cells."""
        self._cells.shutdown(wait=True, cancel_futures=True)

    def watch(self, load: Carried) -> None:
        """Let the node look soon when this load, which is carried now, or a change around the robot
        has not been announced; any thread may call it.
        """
        if load is not self._load or self._driver.cell_side.version != self._version:
            self._changed.trigger()

    def look(self) -> None:
        """Announce what has changed: the load, and the robot with it, states of machines; and
        contacts.
        """
        self._look_around()
        load = self._driver.carried
        if load is self._load:
            return
        self._load = load
        msg = carried_load_to_msg(announced(load))
        msg.header.stamp = self._now()
        self._loads.publish(msg)
        self._description.publish(String(data=self._driver.description()))
        self._load_changed()

    def _look_around(self) -> None:
        cell = self._driver.cell_side
        version = self._driver.cell_side.version
        if version != self._version:
            self._version = version
            machines = machine_states_to_msg(cell.machine_states())
            machines.header.stamp = self._now()
            self._machines.publish(machines)
        for contact in cell.take_contacts():
            touched = contact_to_msg(contact)
            touched.header.stamp = self._now()
            self._contacts.publish(touched)

    def _signalled(self, messages: Sequence[Signal]) -> None:
        for msg in messages:
            self._driver.cell_side.hear_signal(msg.name, bool(msg.value))

    def _heard(self, msg: CellState) -> None:
        self._offered.append(msg)
        self._cells.submit(self._read)

    def _read(self) -> None:
        """Read the newest cell, where it has not been read."""
        try:
            msg = self._offered.pop()
        except IndexError:
            return
        try:
            cell = cell_from_yaml(msg.cell_yaml)
            for machine in cell.equipment:
                machine.world_bodies()  # placed here, and not while the plant waits
        except DescriptionError as error:
            self._driver.warn(f"the planner's cell is not taken: {error}")
        except ANY as error:
            self._driver.warn(f"the planner's cell is not taken: {unexpected(error).message}")
        else:
            self._driver.offer_cell(PlannedCell(cell, msg.hash))


def announced(load: Carried) -> CarriedLoad:
    """What is carried as one rigid body."""
    mass = load.mass
    com = sum((each.mass * each.com for each in load.loads), np.zeros(3)) / (mass or 1.0)
    about_com = (each.inertia + _steiner(each.mass, each.com - com) for each in load.loads)
    inertia = sum(about_com, np.zeros((3, 3)))
    return CarriedLoad(load.text, mass, com, inertia, load.watts_always, load.watts_drive_bus)


def _steiner(mass: float, offset: FloatArray) -> FloatArray:
    """Inertia (3, 3) of a point mass at an offset (3,)."""
    inertia: FloatArray = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return inertia
