"""The demonstration: four nodes, one cell, from the cell file to the report.

Pauses of the program and the transitions of hibernation and Bus Power Off are shortened, so that it
takes a minute instead of half an hour; the recording carries the facts and the report shows them.
The clock is never scaled.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from ir_cli.errors import DemonstrationError
from ir_cli.nodes import cell_nodes
from ir_cli.ports import UDP, free_port
from ir_cli.processes import NodeProcesses
from ir_cli.terminal import Progress
from ir_description import Cell, cell_to_yaml, load_cell
from ir_msgs.srv import StartRecording, StopRecording
from ir_msgs_py import names
from ir_msgs_py.errors import MsgsError, RequestRefusedError
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.plc import magic_packet, send_packet
from ir_msgs_py.ros.client import Client, ProgramPlan
from ir_msgs_py.savings import one_sided
from ir_program_runner.settings import LinkSettings
from ir_recorder.format import contents

from .outcome import Outcome, examine
from .power_tour import MODE_SECONDS, PowerWatch, tour

TRANSITIONS = {
    "bus_power_off_enter": 1.0,
    "bus_power_off_leave": 2.0,
    "bus_power_off_minimum_stay": 1.0,
    "hibernation_enter": 2.0,
    "hibernation_leave": 3.0,
    "hibernation_minimum_stay": 2.0,
}
"""Seconds; a real KR C4 takes 3/20 s for Bus Power Off and about 60/120 s for hibernation."""
LONGEST_PAUSE = 12.0
"""Seconds; longer pauses of the program are cut to this."""
TOUR_STAY = 1.2
"""Seconds in each power mode at machine home: a plateau of the mains meter (100 Hz) needs some
tenths.
"""
LONGEST_TRANSITION = 600.0
"""Longest wait for a mode [s] where transitions take as long as the controller's."""
LOOK_SECONDS = 0.1
"""Between two looks whether the nodes are there."""
START_SECONDS = 60.0
"""Longest wait for a node to offer its services: four processes that start at once on a slow
machine.
"""


class Demonstration:
    """One run: `run` returns what came out of it, or raises an error with a sentence."""

    def __init__(
        self,
        cell: str,
        out: Path,
        seed: int,
        plant: str,
        progress: Progress,
        *,
        real_pauses: bool = False,
    ) -> None:
        self._out = out
        self._plant = plant
        self._progress = progress
        full = load_cell(cell)
        pauses = [step.dwell for step in full.program if step.kind == "PAUSE"]
        self._full_pauses = [] if real_pauses else pauses
        self._transitions = {} if real_pauses else TRANSITIONS
        self._patience = LONGEST_TRANSITION if real_pauses else MODE_SECONDS
        self._cell = full if real_pauses else with_short_pauses(full, LONGEST_PAUSE)
        self._options = PlanOptions(seed=seed)
        self._link = LinkSettings(wake_port=free_port(UDP))
        loads = ("none", self._cell.tool.name) if self._cell.tool else ("none",)
        self._loads = loads if full.robot.controller.has_table else ()

    def run(self) -> Outcome:
        """Start the nodes, run the story, stop the nodes, examine the recording."""
        self._out.mkdir(parents=True, exist_ok=True)
        recording = self._out / "demo.mcap"
        cell_file = self._out / "demo_cell.yaml"
        cell_file.write_text(cell_to_yaml(self._cell))
        progress = self._progress
        what = f"cell {self._cell.name}, simulated plant {self._plant}"
        progress.say(f"Demonstration of {what}: real nodes over DDS, real time")
        nodes = NodeProcesses(self._out / "log", {})
        transitions = {
            f"transitions.{name}": seconds for name, seconds in self._transitions.items()
        }
        with nodes, Client(timeout=START_SECONDS, node_name="ir_demo") as client:
            progress.begin("start planner, driver, runner, recorder")
            nodes.start(
                cell_nodes(
                    str(cell_file.resolve()),
                    planner=transitions,
                    driver={**transitions, "wake_port": self._link.wake_port, "plant": self._plant},
                    runner={"wake_port": self._link.wake_port},
                    recorder={"facts": self._facts(), "roots": [str(self._out.resolve())]},
                )
            )
            _await_services(client, nodes)
            with _naming_the_dead(nodes):
                self._start_recording(client, recording)
                progress.end(str(recording))
                failed = self._story(client)
                client.ask("/" + names.STOP_RECORDING, StopRecording.Request())
            nodes.end()
        progress.begin("read the recording, write report and picture")
        loads = 0 if failed else len(self._loads)
        outcome = examine(
            recording, self._out / "report.html", self._out / "demo.png", loads, failed
        )
        progress.end(f"{self._out / 'report.html'}, {self._out / 'demo.png'}")
        return outcome

    def _story(self, client: Client) -> str:
        """Plan, visit the modes, drive; why that ended early, "" where it didn't: what was recorded
        till then is reported.
        """
        try:
            plan = self._plan(client)
        except RequestRefusedError as error:
            self._progress.end("no plan")
            return str(error)
        try:
            self._tour(client)
            self._drive(client, plan)
        except (DemonstrationError, MsgsError) as error:
            self._progress.end("ended early")
            return str(error)
        return ""

    def _facts(self) -> list[str]:
        """What the recording keeps of this run: how it was planned, and what is shortened."""
        what = "pauses and the transitions of the power modes; the clock is not scaled"
        facts = {
            **({"shortened": what} if self._transitions else {}),
            "seed": str(self._options.seed),
            "plant": self._plant,
            contents.SAFETY_DISTANCE: f"{self._options.safety_distance:g} m",
            **{name: f"{seconds:g} s" for name, seconds in self._transitions.items()},
        }
        if self._full_pauses:
            facts[contents.UNSHORTENED_PAUSES] = ", ".join(
                f"{seconds:g} s" for seconds in self._full_pauses
            )
        return [f"{key}={value}" for key, value in facts.items()]

    def _start_recording(self, client: Client, path: Path) -> None:
        request = StartRecording.Request(path=str(path.resolve()), overwrite=True)
        client.ask("/" + names.START_RECORDING, request)

    def _plan(self, client: Client) -> ProgramPlan:
        self._progress.begin("plan the program")
        plan = client.plan_program(
            options=self._options,
            progress=lambda at: self._progress.update(f"{at.phase} {at.done}/{at.total}"),
        )
        report = plan.report
        proof = "certified" if report.certified else "NOT certified"
        why = one_sided(report.energy, report.energy_low, report.energy_high)
        why = f", {why}" if why else ""
        self._progress.end(
            f"{len(plan.movements)} steps, {report.duration:.1f} s, predicted "
            f"{report.energy / 1000.0:.1f} kJ (90 %: {report.energy_low / 1000.0:.1f} to "
            f"{report.energy_high / 1000.0:.1f} kJ{why}), clearance "
            f"{report.min_clearance * 1000.0:.0f} mm, {proof} ({plan.info.planning_time:.2f} s "
            "of planning)"
        )
        return plan

    def _tour(self, client: Client) -> None:
        """Where the controller's modes are known; without a table there is none to rest in."""
        if not self._loads:
            return
        self._progress.begin("visit the power modes at machine home")
        tour(
            client,
            PowerWatch(client, self._patience),
            self._loads,
            TOUR_STAY,
            self._wake,
            self._progress.update,
        )
        self._progress.end("motors, brakes, Bus Power Off, hibernation, with and without the tool")

    def _drive(self, client: Client, plan: ProgramPlan) -> None:
        self._progress.begin("drive the program")
        run = client.run_program(
            plan.program_id,
            progress=lambda at: self._progress.update(
                f"{at.movement + 1}/{at.total} {at.phase}, {at.remaining:.0f} s left"
            ),
        )
        self._progress.end(
            f"{run.executed} steps, {run.duration:.1f} s, {run.energy / 1000.0:.1f} kJ simulated"
        )

    def _wake(self) -> None:
        """Send the Wake-on-LAN packet that the program runner would send."""
        send_packet(magic_packet(self._link.mac), self._link.wake_address, self._link.wake_port)


def _await_services(client: Client, nodes: NodeProcesses) -> None:
    """Wait until every node offers its services; a node that ends meanwhile is named at once."""
    wanted = {f"/{name}" for name in (names.GET_CELL, names.SET_PLC_INPUT, names.START_RECORDING)}
    deadline = time.monotonic() + START_SECONDS
    while missing := wanted - set(client.graph.services()):
        nodes.check()
        if time.monotonic() > deadline:
            raise DemonstrationError(f"no {', '.join(sorted(missing))} after {START_SECONDS:g} s")
        time.sleep(LOOK_SECONDS)


@contextmanager
def _naming_the_dead(nodes: NodeProcesses) -> Iterator[None]:
    """A request that fails because a node ended says which node, and why."""
    try:
        yield
    except (DemonstrationError, MsgsError):
        nodes.check()
        raise
    nodes.check()


def with_short_pauses(cell: Cell, longest: float) -> Cell:
    """Cell whose program pauses no longer than `longest` [s]."""
    steps = tuple(
        replace(step, dwell=min(step.dwell, longest)) if step.kind == "PAUSE" else step
        for step in cell.program
    )
    return replace(cell, program=steps)
