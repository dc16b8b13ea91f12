"""Dead code: names that nothing in the repository uses, found by vulture.

    python tools/dead_code.py

Prints each with file and line, and ends with 1 where there is one. `KNOWN` lists what is reached in
a manner that a reader of the syntax can't see, and why.
"""

from __future__ import annotations

import fnmatch
import sys
from pathlib import Path

from vulture.core import Vulture

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("src", "ros_ws/src", "tests", "benchmarks", "examples", "tools")
CONFIDENCE = 60  # %; unused functions, classes and attributes get no more

# Folder or file, patterns of names that may stand there, reason.
KNOWN = (
    ("src/ir_cli/*", "add_*", "a command's parser, found by the name in the table of commands"),
    ("src/ir_krl/ir_krl/run/*", "_*", "the rule of a statement or operator, found by its name"),
    ("src/ir_recorder/ir_recorder/live/server.py", "*", "the interface of http.server"),
    ("src/ir_msgs_py/ir_msgs_py/ros/*", "*_execution can_execute entity", "callbacks of rclpy"),
    ("src/ir_msgs_py/ir_msgs_py/ros/*", "get_num_entities add_to_wait_set", "callbacks of rclpy"),
    ("src/ir_msgs_py/ir_msgs_py/ros/*", "*_from_msg", "conversions back, tested in pairs by name"),
    ("src/ir_msgs_py/ir_msgs_py/ros/*", "*_range clock_callback _*goal_request*", "its attributes"),
    ("src/ir_*/ir_*/node/*", "_*", "rclpy keeps an entity as long as its node refers to it"),
    ("src/ir_planner/ir_planner/node/answers.py", "*", "fields of messages"),
    ("src/ir_planner/ir_planner/node/moveit.py", "contact_body_* body_type_*", "of moveit_msgs"),
    ("src/ir_planner/ir_planner/node/moveit_actions.py", "executed_trajectory", "of moveit_msgs"),
    ("src/ir_description/ir_description/files/making/urdf_tree.py", "*Handler", "of expat"),
    ("src/ir_description/ir_description/files/making/xacro_file.py", "get_*", "xacro asks it"),
    ("src/ir_kernels/setup.py", "extra_*", "the interface of setuptools"),
    ("src/ir_kernels/ir_kernels/limits.py", "time_of_*", "fields of a kernel's result, in order"),
    ("src/ir_msgs_py/ir_msgs_py/modes.py", "*_*", "settings read by their names"),
    ("src/ir_msgs_py/ir_msgs_py/plc.py", "*", "bits read by their names"),
    ("src/ir_description/ir_description/robot/power.py", "*", "data of a power file"),
    ("src/ir_planner/ir_planner/checks/verification.py", "waypoint", "result for library users"),
    ("*", "checkMotion", "the interface of OMPL"),
    ("*", "compute_constraint_params", "the interface of TOPP-RA"),
    ("*", "enable_signed_distance", "the interface of Coal"),
    ("*", "gjk_tolerance", "the interface of Coal"),
    ("*", "generate_launch_description", "the interface of launch"),
    ("src/*/contract/conftest.py", "pytest_*", "hooks of pytest"),
    ("benchmarks/*", "*_*", "columns of a table, read by the names of the fields"),
    ("benchmarks/_regional_toppra.py", "identical", "the interface of TOPP-RA"),
    ("tests/*", "*", "fixtures and hooks that pytest finds; ruff looks at the rest"),
)  # fmt: skip


def is_known(path: str, name: str) -> bool:
    """Whether the table says how a name of a file is reached."""
    return any(
        fnmatch.fnmatch(path, where) and any(fnmatch.fnmatch(name, each) for each in names.split())
        for where, names, _ in KNOWN
    )


def main() -> int:
    """Print the names; the number of them decides the exit code."""
    vulture = Vulture()
    vulture.scavenge([str(ROOT / each) for each in FOLDERS], exclude=["*/build/*"])
    found = 0
    for item in vulture.get_unused_code(min_confidence=CONFIDENCE):
        path = Path(item.filename).resolve().relative_to(ROOT).as_posix()
        if not is_known(path, item.name):
            print(f"{path}:{item.first_lineno}: unused {item.typ} {item.name}")
            found += 1
    return int(found > 0)


if __name__ == "__main__":
    sys.exit(main())
