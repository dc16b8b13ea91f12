"""Robotic cells of the public benchmark: read, and solved to a proven gap.

for instance in read_instances("cells.xml"):
    answer = solve_cell(instance)
    print(answer.energy, answer.gap)
"""

from ir_studies.cells.instance import Instance
from ir_studies.cells.solution import CellAnswer, hurried, solve_cell
from ir_studies.cells.tended_cell import tended_instance
from ir_studies.cells.xml_file import read_instances, written

__all__ = [
    "CellAnswer",
    "Instance",
    "hurried",
    "read_instances",
    "solve_cell",
    "tended_instance",
    "written",
]
