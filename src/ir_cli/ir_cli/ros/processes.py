"""Nodes as child processes: started without a launch file, watched, stopped by process id."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ir_cli.errors import CommandError

STOP_SECONDS = 30.0
"""How long a node may take to end after SIGINT before it is killed; on a busy machine four end at
once.
"""


@dataclass(frozen=True)
class NodeCommand:
    """A node to start: the module that runs it, its ROS parameters, and its namespace ("" for
    none).
    """

    module: str
    parameters: Mapping[str, object] = field(default_factory=dict)
    namespace: str = ""

    @property
    def name(self) -> str:
        """Of the process: its module, after its namespace."""
        return f"{self.namespace}/{self.module}".strip("/").replace("/", ".")

    def arguments(self) -> list[str]:
        """Return the command line; strings are quoted so that YAML keeps them strings."""
        line = [
            sys.executable,
            "-m",
            "ir_cli.ros.child",
            self.module,
            "--ros-args",
            "--log-level",
            "warn",
        ]
        if self.namespace:
            line += ["-r", f"__ns:={self.namespace}"]
        for name, value in self.parameters.items():
            line += ["-p", f"{name}:={_yaml(value)}"]
        return line


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def ending(code: int) -> str:
    """How a process with this return code ended, in words."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        return f"was ended by {signal.Signals(-code).name}"
    except ValueError:
        return f"was ended by signal {-code}"


class NodeProcesses:
    """A group of node processes; leaving the context stops all that were started, and so does the
    end of this process, however it ends.
    """

    def __init__(self, log_folder: Path, environment: Mapping[str, str]) -> None:
        self._log_folder = log_folder
        self._environment = {**os.environ, **environment, "ROS_LOG_DIR": str(log_folder)}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> NodeProcesses:
        self._log_folder.mkdir(parents=True, exist_ok=True)
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()

    def start(self, commands: Sequence[NodeCommand]) -> None:
        """Start the nodes side by side; their output goes to `<name>.log` in the log folder."""
        for command in commands:
            name = command.name
            with self._log(name).open("wb") as log:
                self._running[name] = subprocess.Popen(
                    command.arguments(),
                    env=self._environment,
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )

    def ids(self) -> dict[str, int]:
        """Process ids by name."""
        return {name: process.pid for name, process in self._running.items()}

    def check(self, only: str = "") -> None:
        """Raise CommandError when a node, or the only one that counts, has ended on its own, with
        the end of what it printed.
        """
        for name, process in self._running.items():
            if only not in ("", name):
                continue
            code = process.poll()
            if code is not None:
                last = self._log(name).read_text(errors="replace").splitlines()[-12:]
                colon = ":" if last else ""
                raise CommandError("\n  ".join([f"{name} {ending(code)}{colon}", *last]))

    def end(self) -> None:
        """Stop all nodes; raise CommandError when one of them did not end well."""
        bad = [f"{name} {ending(code)}" for name, code in self.stop().items() if code != 0]
        if bad:
            raise CommandError(f"{'; '.join(bad)}; their output is in {self._log_folder}")

    def stop(self) -> dict[str, int]:
        """Interrupt all nodes, wait for them, kill what does not end; return the exit codes."""
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + STOP_SECONDS
        codes = {}
        for name, process in self._running.items():
            try:
                codes[name] = process.wait(max(0.1, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                codes[name] = process.wait()
            if process.stdin is not None:
                process.stdin.close()
        self._running.clear()
        return codes

    def _log(self, name: str) -> Path:
        return self._log_folder / f"{name}.log"


def cell_nodes(
    cell: str,
    *,
    namespace: str = "",
    planner: Mapping[str, object] | None = None,
    driver: Mapping[str, object] | None = None,
    runner: Mapping[str, object] | None = None,
    recorder: Mapping[str, object] | None = None,
) -> tuple[NodeCommand, ...]:
    """Commands for planner, driver, program runner and recorder of one cell (a name or a path)."""
    nodes = {
        "ir_planner": planner,
        "ir_sim_driver": driver,
        "ir_program_runner": runner,
        "ir_recorder": recorder,
    }
    return tuple(
        NodeCommand(f"{name}.node", {"cell": cell, **(parameters or {})}, namespace)
        for name, parameters in nodes.items()
    )
