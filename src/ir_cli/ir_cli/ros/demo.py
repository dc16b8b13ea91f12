"""`ir demo`: a cell planned, driven, recorded and explained, by real nodes in own processes.

Of a cell with a program its pauses and the transitions of hibernation and Bus Power Off are
shortened, so that it takes a minute instead of half an hour; the recording carries the facts and
the report shows them. A cell with a route is tended: its cheapest cycle is planned, the line filled
from empty, and so many cycles are made, with pauses and transitions as they are. Several robots do
so many joint cycles (`robots_demo`). The clock is never scaled. The exit code is 0 when every check
of the recording held.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from ir_cli.errors import CommandError
from ir_cli.output import Progress, table
from ir_cli.planning import CEILING
from ir_cli.ports import UDP, free_port
from ir_cli.ros.power_tour import MODE_SECONDS, PowerWatch, tour
from ir_cli.ros.processes import NodeProcesses, cell_nodes
from ir_description import Cell, cell_to_yaml, load_cell
from ir_msgs.srv import StartRecording, StopRecording
from ir_msgs_py import names
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.ros.client import Client, ProgramAnswer
from ir_msgs_py.ros.plan_conversions import program_savings_to_msg
from ir_msgs_py.savings import ProgramSavings, one_sided
from ir_msgs_py.wake_on_lan import magic_packet, send_packet
from ir_planner import Goal, Planner
from ir_program_runner.settings import LinkSettings
from ir_recorder import (
    Analysis,
    Finding,
    Verdict,
    analyse,
    findings,
    read_recording,
    summary,
)
from ir_recorder.analysis.checks import row_name
from ir_recorder.analysis.production import production_of
from ir_recorder.format import contents
from ir_recorder.report import write_report
from ir_recorder.report.number_text import interval, number
from ir_recorder.report.picture import write_picture
from ir_recorder.report.program_names import computed_words
from ir_recorder.report.tables import savings_lines
from ir_values.errors import IrError, RequestRefusedError
from ir_values.output_files import write_file

# Results by the recording: movements, checks, the report and the picture.

MODES_AT_REST = 4
"""Power modes that the tour visits with each load."""


@dataclass(frozen=True)
class DemoOutcome:
    """The analysed recording and whether every check held."""

    analysis: Analysis
    checks: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether everything could be read, was checked, and holds."""
        return summary(self.checks)[0] is Verdict.HOLDS and not self.analysis.problems

    def text(self) -> str:
        """Tables for the terminal."""
        parts = [
            self._movements(),
            self._at_rest(),
            self._cycle(),
            self._parts_text(),
            self._savings_text(),
            *self.analysis.problems,
        ]
        parts += check_lines(self.checks)
        return "\n\n".join(part for part in parts if part)

    def _cycle(self) -> str:
        """Energy of the run, and of the cycle with its pauses at full length."""
        program = self.analysis.program
        if program is None:
            return "no program was executed"
        source = self.analysis.recording.origin
        lines = [f"this run ({source}): {_total(program.whole.energy, program.whole.seconds)}"]
        if program.unshortened is not None:
            full = program.unshortened
            cut = f"pauses of {full.full_pauses:.0f} s instead of {full.run_pauses:.0f} s"
            lines.append(f"with full pauses (computed): {_total(full.energy, full.seconds)}; {cut}")
            cycle = production_of(self.analysis)
            if cycle is not None and computed_words(cycle):
                lines.append(f"    {computed_words(cycle)}")
        return "\n".join(lines)

    def _parts_text(self) -> str:
        """What each part of a route took, and who waited for whom."""
        tending = self.analysis.tending
        if tending is None:
            return ""
        header = [
            "part",
            "s",
            "s planned",
            "J",
            "J predicted",
            "robot waited for",
            "part waited in",
        ]
        rows = [
            [
                f"{part.number}{' (fills the line)' if part.number <= tending.filling else ''}",
                f"{part.span.seconds:.2f}",
                f"{part.planned_seconds:.2f}",
                f"{part.joules:.0f}",
                f"{part.planned_joules:.0f}",
                _listed({**part.paused, **{f"{n}, late": s for n, s in part.late.items()}}),
                _listed(part.finished),
            ]
            for part in tending.parts
        ]
        return table(header, rows)

    def _savings_text(self) -> str:
        """What the program saves by its plan, each figure with its baseline."""
        return "\n".join(savings_lines(self.analysis))

    def _movements(self) -> str:
        joules = ["J predicted", "90 %", f"J {self.analysis.recording.origin}"]
        header = ["step", "s", *joules, "cost W", "clearance mm", "tool deviation mm"]
        rows = []
        for result in self.analysis.steps:
            planned = result.step.movement.report
            clearance = result.clearance.least if result.clearance is not None else math.nan
            rows.append(
                [
                    f"{result.step.index + 1} {result.step.label}",
                    f"{result.seconds:.2f}",
                    f"{planned.energy:.0f}",
                    f"{planned.energy_low:.0f} to {planned.energy_high:.0f}",
                    f"{result.energy:.0f}",
                    f"{planned.movement_cost:.0f}",
                    f"{clearance * 1000.0:.1f}",
                    f"{result.tool_deviation * 1000.0:.2f}",
                ]
            )
        return table(header, [["-" if cell == "nan" else cell for cell in row] for row in rows])

    def _at_rest(self) -> str:
        rows = [
            [
                row_name(row),
                f"{row.expected:.0f}",
                f"{row.power:.1f}",
                f"{row.error * 100.0:+.2f} %",
                "-" if math.isnan(row.table_2) else f"{row.table_2:.0f}",
            ]
            for row in self.analysis.plateaus
        ]
        header = ["at rest, machine home", "W by data", "W net", "", "W Table II"]
        return table(header, rows) if rows else ""


def _listed(waits: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {seconds:.1f} s" for name, seconds in waits.items()) or "-"


def _total(energy: float, seconds: float) -> str:
    return f"{energy / 1000.0:.1f} kJ ({energy / 3600.0:.1f} Wh) in {seconds:.1f} s"


def check_lines(checks: Sequence[Finding]) -> list[str]:
    """Every check that does not hold in words, and the verdict with their names: the last line says
    which.
    """
    wrong = [check for check in checks if not check.ok]
    names = ", ".join(check.name for check in wrong)
    verdict = f"checks: {summary(tuple(checks))[1]}"
    return [*map(_check_sentence, wrong), f"{verdict}: {names}" if wrong else verdict]


def _check_sentence(check: Finding) -> str:
    """A check that does not hold, in words."""
    allowed = interval(check.low, check.high, check.unit)
    note = f" ({check.note})" if check.note else ""
    if check.verdict is Verdict.NOT_CHECKED:
        return f"NOT CHECKED  {check.name}{note}"
    return (
        f"FAILED  {check.name}: {number(check.measured, check.unit)}, allowed {allowed}: "
        f"{check.reason}{note}"
    )


def examine(recording: Path, report: Path, picture: Path, failed: str = "") -> DemoOutcome:
    """Analyse the recording, write report and picture; failed: why the demonstration ended
    early.
    """
    analysis = analyse(read_recording(recording))
    if failed:
        analysis = replace(analysis, problems=(failed, *analysis.problems))
    checks = findings(analysis)
    write_report(analysis, checks, report)
    write_picture(analysis, picture)
    return DemoOutcome(analysis, checks)


# The run: nodes, plan, tour of the power modes, program.

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
_RECORDER = f"{names.RECORDER}.node"
FINISH_SECONDS = 3600.0
"""Longest wait for a recorder that lives to close its file [s]: an answer that is lost ends it."""
START_SECONDS = 60.0
"""Longest wait for a node to offer its services: four processes that start at once on a slow
machine.
"""


@dataclass(frozen=True)
class Tended:
    """How a cell with a route is tended: parts an hour (0: as many as possible), whole cycles."""

    parts_per_hour: float = 0.0
    cycles: int = 3


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
        tended: Tended | None = None,
    ) -> None:
        self._out = out
        self._plant = plant
        self._progress = progress
        full = load_cell(cell)
        self._steps: tuple[PlannedMovement, ...] = ()
        self._saves = ProgramSavings()
        if full.route is not None and not full.program:
            real_pauses = True
            full, self._steps = self._tending(full, tended or Tended(), seed)
        pauses = [step.dwell for step in full.program if step.kind == "PAUSE"]
        self._full_pauses = [] if real_pauses else pauses
        self._transitions = {} if real_pauses else TRANSITIONS
        self._patience = LONGEST_TRANSITION if real_pauses else MODE_SECONDS
        self._cell = full if real_pauses else with_short_pauses(full, LONGEST_PAUSE)
        self._options = PlanOptions(seed=seed, planning_time=CEILING)
        self._link = LinkSettings(wake_port=free_port(UDP))
        loads = ("none", self._cell.tool.name) if self._cell.tool else ("none",)
        visited = full.robot.controller.has_table and not self._steps
        self._loads = loads if visited else ()

    def _tending(
        self, cell: Cell, tended: Tended, seed: int
    ) -> tuple[Cell, tuple[PlannedMovement, ...]]:
        """The run of the cell's cheapest cycle, from machine home on, and the cell of it."""
        self._progress.begin("plan the cheapest cycle")
        planner = Planner(cell, clock=time.monotonic)
        plan = planner.plan_steady_cycle(
            parts_per_hour=tended.parts_per_hour, cycles=tended.cycles, seed=seed, saving=True
        )
        if plan.run is None or plan.run_cell is None:
            raise CommandError(plan.status.message)
        self._progress.end(repr(plan))
        if plan.program is not None and plan.cycle is not None:
            self._saves = plan.program.savings.of_part(plan.cycle.units)
        planner.set_cell(plan.run_cell)
        first = plan.run.movements[0]
        assert first.trajectory is not None
        start = first.trajectory.positions[0]
        there = planner.plan_regional(goal=Goal(configuration=start), start="home", seed=seed)
        if there.trajectory is None:
            raise CommandError(there.status.message)
        approach = PlannedMovement(
            kind=MovementKind.REGIONAL,
            from_station="home",
            to_station=first.from_station,
            trajectory_id=there.trajectory.trajectory_id,
            trajectory=there.trajectory,
            report=there.report,
            duration=there.trajectory.duration,
            load=first.load,
        )
        return plan.run_cell, (approach, *plan.run.movements)

    def run(self) -> DemoOutcome:
        """Start the nodes, run the story, stop the nodes, examine the recording."""
        self._out.mkdir(parents=True, exist_ok=True)
        recording = self._out / "demo.mcap"
        cell_file = self._out / "demo_cell.yaml"
        write_file(cell_file, cell_to_yaml(self._cell))
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
                    runner={"wake_port": self._link.wake_port, "seed": self._options.seed},
                    recorder={"facts": self._facts(), "roots": [str(self._out.resolve())]},
                )
            )
            await_services(client, nodes, _SERVICES)
            with naming_the_dead(nodes), recorded(client, nodes, recording):
                progress.end(str(recording))
                failed = self._story(client)
            nodes.end()
        progress.begin("read the recording, write report and picture")
        outcome = examine(recording, self._out / "report.html", self._out / "demo.png", failed)
        progress.end(f"{self._out / 'report.html'}, {self._out / 'demo.png'}")
        return outcome

    def _story(self, client: Client) -> str:
        """Plan, visit the modes, drive; why that ended early, "" where it didn't: what was recorded
        till then is reported.
        """
        if self._steps:
            return self._tend(client)
        try:
            plan = self._plan(client)
        except RequestRefusedError as error:
            self._progress.end("no plan")
            return str(error)
        try:
            self._tour(client)
            self._drive(client, plan.program_id)
        except (CommandError, IrError) as error:
            self._progress.end("ended early")
            return str(error)
        return ""

    def _tend(self, client: Client) -> str:
        """Drive the run, which saves what its plan does; why that ended early."""
        if self._saves.available:
            client.publish(f"/{names.PROGRAM_SAVINGS}", program_savings_to_msg(self._saves))
        try:
            self._drive(client, self._steps)
        except (CommandError, IrError) as error:
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
        if self._saves.common_seconds > 0.0:
            facts[contents.COMMON_SECONDS] = f"{self._saves.common_seconds!r} s"
        if self._loads:
            facts[contents.MODES_AT_REST] = str(MODES_AT_REST * len(self._loads))
        if self._full_pauses:
            facts[contents.UNSHORTENED_PAUSES] = ", ".join(
                f"{seconds:g} s" for seconds in self._full_pauses
            )
        return [f"{key}={value}" for key, value in facts.items()]

    def _plan(self, client: Client) -> ProgramAnswer:
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

    def _drive(self, client: Client, program: str | Sequence[PlannedMovement]) -> None:
        self._progress.begin("drive the program")
        run = client.run_program(
            program,
            progress=lambda at: self._progress.update(
                f"{at.movement + 1}/{at.total} {at.phase}, {at.remaining:.0f} s left"
            ),
        )
        # its joules are those of the recording, which begins and ends with a step
        self._progress.end(f"{run.executed} steps, {run.duration:.1f} s")

    def _wake(self) -> None:
        """Send the Wake-on-LAN packet that the program runner would send."""
        send_packet(magic_packet(self._link.mac), self._link.wake_address, self._link.wake_port)


_SERVICES = (names.GET_CELL, names.SET_PLC_INPUT, names.START_RECORDING)


def await_services(client: Client, nodes: NodeProcesses, services: Sequence[str]) -> None:
    """Wait until every node offers its services; a node that ends meanwhile is named at once."""
    wanted = {f"/{name}" for name in services}
    deadline = time.monotonic() + START_SECONDS
    while missing := wanted - set(client.graph.services()):
        nodes.check()
        if time.monotonic() > deadline:
            raise CommandError(f"no {', '.join(sorted(missing))} after {START_SECONDS:g} s")
        time.sleep(LOOK_SECONDS)


@contextmanager
def recorded(client: Client, nodes: NodeProcesses, path: Path) -> Iterator[None]:
    """Record into a file what happens meanwhile, however that ends: also by Ctrl-C."""
    request = StartRecording.Request(path=str(path.resolve()), overwrite=True)
    client.ask("/" + names.START_RECORDING, request)
    try:
        yield
    finally:
        finish_recording(client, nodes)


def finish_recording(client: Client, nodes: NodeProcesses) -> None:
    """Let the recorder close its file, however long a loaded machine takes for it; a recorder that
    ends meanwhile is named at once.
    """
    answer: Future[object] = Future()

    def ask() -> None:
        try:
            request = StopRecording.Request()
            answer.set_result(client.ask("/" + names.STOP_RECORDING, request, FINISH_SECONDS))
        except IrError as error:
            answer.set_exception(error)

    threading.Thread(target=ask, daemon=True).start()
    while not wait([answer], LOOK_SECONDS).done:
        nodes.check(only=_RECORDER)
    answer.result()


@contextmanager
def naming_the_dead(nodes: NodeProcesses) -> Iterator[None]:
    """A request that fails because a node ended says which node, and why."""
    try:
        yield
    except (CommandError, IrError):
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
