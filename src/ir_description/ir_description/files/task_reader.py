"""Reads the tasks of a cell file: movements to plan from one configuration to another."""

from __future__ import annotations

from ir_description.cell import NameRegister, Task, check_posture
from ir_description.files.items import Item
from ir_description.robot import RobotModel


def read_tasks(items: list[Item], robot: RobotModel) -> tuple[Task, ...]:
    """Return the tasks of a robot."""
    names = NameRegister("task")
    tasks = []
    for item in items:
        row = item.table(("name", "start", "goal"))
        with row["name"].blamed():
            name = row["name"].text(64)
            names.add(name)
        ends = []
        for key in ("start", "goal"):
            posture = row[key].numbers(robot.n, -70.0, 70.0, "rad")
            with row[key].blamed():
                check_posture(robot, posture, f"{key} of {name}")
            ends.append(posture)
        tasks.append(Task(name, *ends))
    return tuple(tasks)
