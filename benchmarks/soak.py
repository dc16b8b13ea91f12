"""Do the four nodes grow in an hour of work? Memory, descriptors, threads and logs, minute by
minute.

    python benchmarks/soak.py [--minutes N] [--rest SECONDS] [--quick] [--json FILE]

Planner, driver with physics and Modbus, runner and recorder run as processes in real time. A client
plans programs and has them run, asks every service that it can, is killed and comes back, and
presses the emergency stop; the recorder writes one file after the other. Growth is counted from a
tenth of the time on.
"""

from __future__ import annotations

import argparse
import os
import socket
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from _hostile_node import PRESS, RELEASE
from _node_process import running
from _results import Claim, add_ending, at_least, at_most, finish, line_of
from sensor_msgs.msg import JointState

from ir_msgs.msg import PowerState
from ir_msgs.srv import (
    CheckState,
    ComputeIk,
    EndPause,
    QueryModes,
    Recover,
    SetLoad,
    SetPlcInput,
    StartPause,
    StartRecording,
    StopRecording,
)
from ir_msgs_py import names
from ir_msgs_py.modes import Mode
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.client import Client
from ir_values.errors import IrError

NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder")
STATIONS = (("p1", "p2"), ("p1b", "conv"), ("cab", "p1"))
WARM = 0.1  # share of the time
ASKED = 20  # rounds of quick calls in a cycle of work
# min
QUICK = 2.0
FULL = 60.0


class Shift:
    """The nodes at work. processes: their ids; kept: a folder for logs and recordings."""

    def __init__(self, processes: dict[str, int], port: int, kept: Path) -> None:
        self._processes = processes
        self._port = port
        self._kept = kept
        self.programs = 0
        self.calls = 0
        self.presses = 0
        self.refused = 0

    def has(self) -> dict[str, float]:
        """Memory [MB], descriptors and threads of each node, and what all have logged [kB]."""
        row: dict[str, float] = {}
        for name, pid in self._processes.items():
            status = Path(f"/proc/{pid}/status").read_text().splitlines()
            fields = dict(line.split(":", 1) for line in status if ":" in line)
            row[f"{name}_mb"] = int(fields["VmRSS"].split()[0]) / 1024.0
            row[f"{name}_descriptors"] = len(os.listdir(f"/proc/{pid}/fd"))
            row[f"{name}_threads"] = int(fields["Threads"])
        row["log_kb"] = sum(file.stat().st_size for file in self._kept.rglob("*.log")) / 1024.0
        return row

    def work(self, client: Client, cycle: int) -> None:
        """A cycle: calls, a program, a stop, a pause, a recording; a refusal counts and is no
        failure.
        """
        state = client.next_message(names.JOINT_STATES, JointState)
        requests = (
            (names.CHECK_STATE, CheckState.Request(state=state)),
            (names.COMPUTE_IK, ComputeIk.Request(goal="p1", near=state, starts=1)),
            (names.QUERY_MODES, QueryModes.Request()),
            (names.SET_LOAD, SetLoad.Request(load="none" if cycle % 2 else "cell")),
            (names.SET_PLC_INPUT, SetPlcInput.Request(name="no such bit")),
        )
        for name, request in requests * ASKED:
            client.call(name, request)
            self.calls += 1
        self._record(client, cycle)
        self._try(lambda: self._program(client, cycle))
        if cycle % 3 == 0:
            self._try(lambda: self._pause(client))
        else:
            self._stop(client)

    def _try(self, act: Any) -> None:
        try:
            act()
        except IrError:
            self.refused += 1

    def _program(self, client: Client, cycle: int) -> None:
        options = PlanOptions(planning_time=10.0, seed=cycle)
        plan = client.plan_program(STATIONS[cycle % len(STATIONS)], options=options, savings=False)
        client.run_program(plan.program_id, timeout=120.0)
        self.programs += 1

    def _record(self, client: Client, cycle: int) -> None:
        client.call("/ir_recorder/stop", StopRecording.Request())
        path = self._kept / "shift.mcap"
        client.ask(
            "/ir_recorder/start", StartRecording.Request(path=str(path), overwrite=cycle > 0)
        )

    def _pause(self, client: Client) -> None:
        client.ask(names.START_PAUSE, StartPause.Request(pause=10.0))
        time.sleep(2.0)
        client.ask(names.END_PAUSE, EndPause.Request())
        self._until(client, Mode.STAND_ON_MOTORS)

    def _stop(self, client: Client) -> None:
        with socket.create_connection(("127.0.0.1", self._port), timeout=10.0) as plc:
            for request in (PRESS, RELEASE):
                plc.sendall(request)
                plc.recv(64)
        self._until(client, Mode.EMERGENCY_STOP)
        self.presses += 1
        for _ in range(50):
            if client.call(names.RECOVER, Recover.Request()).status.code == 1:
                break
            time.sleep(0.1)
        self._until(client, Mode.STAND_ON_MOTORS)

    @staticmethod
    def _until(client: Client, mode: Mode) -> None:
        deadline = time.monotonic() + 60.0
        while client.next_message(names.POWER_STATE, PowerState).mode != mode:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{mode.name} has not come within a minute")


def soaked(minutes: float, rest: float) -> list[dict[str, Any]]:
    """A row for each minute; rest: after each cycle of work [s]."""
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder, ExitStack() as nodes:
        kept = Path(folder)
        os.environ["ROS_LOG_DIR"] = str(kept)
        os.environ["IR_FILE_ROOTS"] = str(kept)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = int(free.getsockname()[1])
        small = {"stored_trajectories": 50, "stored_programs": 10, "stored_megabytes": 20}
        given: dict[str, dict[str, str | int]] = {
            "ir_planner": {"cell": "open", **small},
            "ir_sim_driver": {
                "cell": "open",
                "modbus": "true",
                "modbus_port": port,
                "wake_port": 0,
            },
            "ir_program_runner": {},
            "ir_recorder": {},
        }
        processes = {
            name: nodes.enter_context(running(f"{name}.node", **parameters)).pid
            for name, parameters in given.items()
        }
        shift = Shift(processes, port, kept)
        began = time.monotonic()
        cycle = 0
        while time.monotonic() - began < 60.0 * minutes:
            with Client(timeout=60.0) as client:  # a new one in every cycle
                shift.work(client, cycle)
            time.sleep(rest)
            cycle += 1
            passed = (time.monotonic() - began) / 60.0
            if passed >= len(rows) + 1 or (minutes < 10.0 and passed > 0.3 * (len(rows) + 1)):
                row = {
                    "minute": passed,
                    **shift.has(),
                    "programs": shift.programs,
                    "calls": shift.calls,
                }
                rows.append({**row, "presses": shift.presses, "refused": shift.refused})
                print(line_of(rows[-1]), flush=True)
    return rows


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """What grew between a tenth of the time and the end."""
    minutes = rows[-1]["minute"]
    early = next(row for row in rows if row["minute"] >= WARM * minutes)

    def grown(ending: str) -> float:
        return max(
            float(rows[-1][f"{name}_{ending}"] - early[f"{name}_{ending}"]) for name in NODES
        )

    return [
        at_least("minutes of work", minutes, "min", 1.0),
        at_least("programs that were run", rows[-1]["programs"], "", 1),
        at_most("memory that a node gains, at most", grown("mb"), "MB", 30.0),
        at_most("descriptors that a node gains, at most", grown("descriptors"), "", 4),
        at_most("threads that a node gains, at most", grown("threads"), "", 4),
        at_most("log that all nodes write", rows[-1]["log_kb"], "kB", 10.0 * minutes + 200.0),
    ]


def main() -> None:
    """Let the nodes work, print what they have."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=FULL, help=f"default: {FULL:g}")
    parser.add_argument(
        "--rest", type=float, default=0.0, help="s after each cycle of work; default: 0"
    )
    add_ending(parser, f"{QUICK:g} minutes")
    given = parser.parse_args()
    rows = soaked(QUICK if given.quick else given.minutes, given.rest)
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
