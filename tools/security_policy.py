"""Write ros_ws/src/ir_bringup/security/policy.xml: what SROS 2 lets each node of a cell say, hear
and ask.

Made from the contract of names. `python tools/security_policy.py --namespace /cell_1` prints the
policy of a cell in a namespace. Format: policy 0.2.0 of ros2/sros2, one enclave for each node, and
one for people.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as Xml

from ir_msgs_py import names

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "ros_ws" / "src" / "ir_bringup" / "security" / "policy.xml"
VERSION = "0.2.0"
OPERATOR = "ir_client"
PARAMETER_SERVICES = (
    *(f"{verb}_parameters" for verb in ("describe", "get", "list", "set")),
    *("get_parameter_types", "set_parameters_atomically", "get_type_description"),
)


@dataclass(frozen=True)
class Rights:
    """What one node may do, by relative names; "/..." is a name of all cells."""

    publish: tuple[str, ...] = ()
    subscribe: tuple[str, ...] = ()
    reply: tuple[str, ...] = ()
    request: tuple[str, ...] = ()
    execute: tuple[str, ...] = ()
    call: tuple[str, ...] = ()


COMMON = Rights(
    publish=(names.DIAGNOSTICS, names.ROSOUT, names.PARAMETER_EVENTS),
    subscribe=("/clock", names.PARAMETER_EVENTS),
)
PLANNER = Rights(
    publish=(names.CELL, names.PLANNED_TRAJECTORY, names.PROGRAM_SAVINGS, names.PLANNER_MARKERS),
    subscribe=(
        names.JOINT_STATES,
        names.CARRIED_LOAD,
        names.CONTROLLER_TIMERS,
        names.MACHINE_STATES,
    ),
    reply=(
        *(names.SET_CELL, names.GET_CELL, names.SET_EQUIPMENT, names.CHECK_STATE),
        names.CHECK_STATES,
        *(names.COMPUTE_IK, names.PLAN_SERVICE_MOVEMENT, names.PLAN_REGIONAL_MOVEMENT),
        *(names.PLAN_TRAJECTORY, names.PLAN_PROGRAM, names.OPTIMIZE_TRAJECTORY),
        *(names.EVALUATE_TRAJECTORY, names.GET_TRAJECTORY, names.GET_PROGRAM, names.PLAN_STANDBY),
        *(names.EXPORT_PROGRAM, names.PLAN_CARTESIAN_MOVEMENT, names.PLAN_ESCAPE),
        *(names.PLAN_STEADY_CYCLE, names.PLAN_ROBOTS),
    ),
    execute=(names.PLAN,),
)
DRIVER = Rights(
    publish=(
        *(names.JOINT_STATES, names.ROBOT_DESCRIPTION, names.TF, names.TF_STATIC, "/clock"),
        *(names.POWER_STATE, names.CONTROLLER_STATE, names.CONTROLLER_TIMERS, names.CARRIED_LOAD),
        *(names.PLC_OUTPUTS, names.PLC_INPUTS_IN_FORCE, names.ROBOT_MARKERS, names.STOP_NUMBER),
        *(names.PLANT, names.LOAD_CHECK, names.CONTACTS, names.MACHINE_STATES, names.STOP_LATCHED),
        names.LAST_RECOVERY,
    ),
    subscribe=(
        *(names.COMMANDED_TRAJECTORY, names.PLC_INPUTS, names.SPEED_SCALING, names.CELL),
        *(names.SIGNALS, names.MACHINE_SIGNALS),
    ),
    reply=(
        *(names.SET_PLC_INPUT, names.START_PAUSE, names.END_PAUSE, names.QUERY_MODES),
        *(names.RECOVER, names.SET_LOAD),
    ),
    execute=(names.EXECUTE_TRAJECTORY, names.FOLLOW_JOINT_TRAJECTORY),
)
RUNNER = Rights(
    publish=(names.SIGNALS, names.MACHINE_SIGNALS, names.PROGRAM_STATE),
    subscribe=(
        *(names.SIGNALS, names.POWER_STATE, names.CONTROLLER_TIMERS),
        *(names.STOP_NUMBER, names.STOP_LATCHED, names.LAST_RECOVERY),
    ),
    request=(
        *(
            names.GET_PROGRAM,
            names.GET_TRAJECTORY,
            names.SET_PLC_INPUT,
            names.SET_LOAD,
            names.QUERY_MODES,
        ),
    ),
    execute=(names.RUN_PROGRAM,),
    call=(names.EXECUTE_TRAJECTORY,),
)
STUDIES = Rights(execute=(names.RUN_STUDY,))
ACTIONS = (*PLANNER.execute, *DRIVER.execute, *RUNNER.execute)
COMMANDS = (names.COMMANDED_TRAJECTORY, names.PLC_INPUTS, names.SPEED_SCALING, names.SIGNALS)
NODES = (names.PLANNER, names.SIM_DRIVER, names.PROGRAM_RUNNER, names.RECORDER)
ANSWERING = (*NODES, names.STUDIES)
CALLS = tuple(f"{node}/{names.CALLS}" for node in ANSWERING)
REPORTS = (*PLANNER.publish, *DRIVER.publish, *RUNNER.publish, *COMMON.publish, *CALLS)
RECORDER = Rights(
    subscribe=(
        *REPORTS,
        *COMMANDS,
        *(f"{action}/_action/status" for action in (*ACTIONS, names.RUN_STUDY)),
    ),
    reply=(names.START_RECORDING, names.STOP_RECORDING),
    request=(
        names.GET_CELL,
        *(f"{node}/{verb}_parameters" for node in NODES[:-1] for verb in ("list", "get")),
    ),
)
LIVE = Rights(
    subscribe=(
        *(names.JOINT_STATES, names.POWER_STATE, names.CONTROLLER_STATE, names.PLC_INPUTS_IN_FORCE),
        *(names.PLC_OUTPUTS, names.CARRIED_LOAD, names.MACHINE_STATES, names.CONTACTS),
        *(names.CELL, names.PLANNED_TRAJECTORY, names.PROGRAM_STATE, names.STOP_NUMBER),
    ),
    request=(names.SET_PLC_INPUT, names.GET_TRAJECTORY),
)
CELL = dict(zip(NODES, (PLANNER, DRIVER, RUNNER, RECORDER), strict=True))
PEOPLE = Rights(
    publish=COMMANDS,
    subscribe=(*REPORTS, *COMMANDS),
    request=(
        *(service for rights in CELL.values() for service in rights.reply),
        *(f"{node}/{service}" for node in ANSWERING for service in PARAMETER_SERVICES),
    ),
    call=(*ACTIONS, names.RUN_STUDY),
)


def rights() -> dict[str, Rights]:
    """Rights of every node, the common ones and its own parameters included."""
    found = {}
    for node, own in {**CELL, names.STUDIES: STUDIES, names.LIVE: LIVE, OPERATOR: PEOPLE}.items():
        found[node] = Rights(
            _sorted(
                own.publish, COMMON.publish, (f"{node}/{names.CALLS}",) if node in ANSWERING else ()
            ),
            _sorted(own.subscribe, COMMON.subscribe),
            _sorted(own.reply, tuple(f"{node}/{service}" for service in PARAMETER_SERVICES)),
            _sorted(own.request),
            _sorted(own.execute),
            _sorted(own.call),
        )
    return found


def policy(namespace: str = "/") -> str:
    """The policy of the cell in a namespace, as XML."""
    root = Xml.Element("policy", version=VERSION)
    enclaves = Xml.SubElement(root, "enclaves")
    for node, own in rights().items():
        enclave = Xml.SubElement(enclaves, "enclave", path=f"{namespace.rstrip('/')}/{node}")
        profile = Xml.SubElement(
            Xml.SubElement(enclave, "profiles"), "profile", ns=namespace, node=node
        )
        for group, right, allowed in (
            ("topics", "publish", own.publish),
            ("topics", "subscribe", own.subscribe),
            ("services", "reply", own.reply),
            ("services", "request", own.request),
            ("actions", "execute", own.execute),
            ("actions", "call", own.call),
        ):
            if allowed:
                element = Xml.SubElement(profile, group, {right: "ALLOW"})
                for name in allowed:
                    Xml.SubElement(element, group.removesuffix("s")).text = name
    Xml.indent(root)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"
    )


def _sorted(*groups: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted({name for group in groups for name in group}))


def main() -> int:
    """Write the file, or print the policy of a namespace."""
    parser = argparse.ArgumentParser(description="Writes the SROS 2 policy of a cell.")
    parser.add_argument(
        "--namespace", help="of the cell (/cell_1): print instead of writing the file"
    )
    namespace = parser.parse_args().namespace
    if namespace is not None:
        sys.stdout.write(policy(f"/{namespace.strip('/')}"))
        return 0
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(policy(), encoding="utf-8")
    print(FILE.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
