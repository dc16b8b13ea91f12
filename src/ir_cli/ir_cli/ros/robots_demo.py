"""`ir demo` of a cell with several robots: planned together, driven by a driver and a program
runner for each in a namespace of its name, in one recording.

What keeps the robots apart are signals alone: every runner hears those of the others. The robots
stand where their programs begin, pauses and transitions are as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ir_cli.errors import CommandError
from ir_cli.output import Progress, table
from ir_cli.ports import UDP, free_port
from ir_cli.ros.demo import (
    LOOK_SECONDS,
    START_SECONDS,
    Tended,
    await_services,
    check_lines,
    naming_the_dead,
    recorded,
)
from ir_cli.ros.processes import NodeCommand, NodeProcesses
from ir_description import RobotCells, is_path
from ir_msgs_py import names
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.client import Client, ProgramRun
from ir_msgs_py.ros.spinning import Cancellation
from ir_planner.robots import RobotsPlan, plan_robots
from ir_recorder import Analysis, Finding, Verdict, analyse, findings, read_recording, summary
from ir_recorder.analysis.robots import robot_findings
from ir_recorder.format import contents
from ir_recorder.report import write_report
from ir_recorder.report.robots import (
    driven_joules,
    predicted_joules,
    program_span,
    waited,
    write_robots,
)
from ir_values.errors import IrError

_BEGIN = 1e-3  # rad that a robot may stand off the begin of its program
_PATIENCE = 10.0  # cycles that a robot waits for its turn
_LEAST_PATIENCE = 60.0  # s


@dataclass(frozen=True)
class RobotsOutcome:
    """The analysed recording of all robots; checks: between them."""

    analyses: Mapping[str, Analysis]
    own: Mapping[str, tuple[Finding, ...]]
    checks: tuple[Finding, ...]
    failed: str = ""

    @property
    def all_checks(self) -> tuple[Finding, ...]:
        """Those of each robot, named after it, and those between them."""
        named = [
            replace(each, name=f"{robot}: {each.name}")
            for robot, checks in self.own.items()
            for each in checks
        ]
        return (*self.checks, *named)

    @property
    def ok(self) -> bool:
        """Whether everything could be read, was checked, and holds."""
        problems = [sentence for a in self.analyses.values() for sentence in a.problems]
        return not self.failed and not problems and summary(self.all_checks)[0] is Verdict.HOLDS

    def text(self) -> str:
        """Tables for the terminal."""
        rows = [
            [
                robot,
                str(len(analysis.steps)),
                f"{program_span(analysis).seconds:.2f}",
                f"{driven_joules(analysis):.0f}",
                f"{predicted_joules(analysis):.0f}",
                f"{sum(waited(analysis).values()):.2f}",
            ]
            for robot, analysis in self.analyses.items()
        ]
        every = self.analyses.values()
        together = [sum(map(driven_joules, every)), sum(map(predicted_joules, every))]
        rows.append(["all together", "", "", *(f"{joules:.0f}" for joules in together), ""])
        header = ["robot", "steps", "s", "J simulated", "J predicted", "s waited for signals"]
        parts = [table(header, rows), self.failed]
        parts += [problem for analysis in every for problem in analysis.problems]
        parts += check_lines(self.all_checks)
        return "\n\n".join(part for part in parts if part)


class RobotsDemonstration:
    """One run: `run` returns what came out of it, or raises an error with a sentence."""

    def __init__(
        self,
        cell: str,
        cells: RobotCells,
        out: Path,
        seed: int,
        plant: str,
        progress: Progress,
        tended: Tended,
    ) -> None:
        self._cell = str(Path(cell).resolve()) if is_path(cell) else cell
        self._cells = cells
        self._out = out
        self._seed = seed
        self._plant = plant
        self._progress = progress
        self._tended = tended

    def run(self) -> RobotsOutcome:
        """Plan, start the nodes, drive, stop the nodes, examine the recording."""
        plan = self._plan()
        programs = {robot: plan.run(robot, self._tended.cycles) for robot in plan.robots}
        self._out.mkdir(parents=True, exist_ok=True)
        recording = self._out / "demo.mcap"
        progress = self._progress
        progress.begin("start a driver and a runner for each robot, and the recorder")
        nodes = NodeProcesses(self._out / "log", {})
        with nodes, ExitStack() as stack:
            client = stack.enter_context(Client(timeout=START_SECONDS, node_name="ir_demo"))
            nodes.start(self._commands(plan))
            services = [names.START_RECORDING]
            services += [f"{robot}/{names.SET_PLC_INPUT}" for robot in plan.robots]
            await_services(client, nodes, services)
            with naming_the_dead(nodes), recorded(client, nodes, recording):
                progress.end(str(recording))
                failed = self._drive(programs, stack)
            nodes.end()
        progress.begin("read the recording, write a page of each robot and one of all")
        outcome = examine_robots(recording, self._cells.robots, self._out, failed)
        progress.end(str(self._out / "report.html"))
        return outcome

    def _plan(self) -> RobotsPlan:
        """The joint cycle; one that doesn't begin where the robots stand is refused."""
        self._progress.begin("plan the cheapest cycle of all robots")
        rate = self._tended.parts_per_hour
        options = PlanOptions(seed=self._seed)
        plan = plan_robots(self._cells, cycle_time=3600.0 / rate if rate else 0.0, options=options)
        if not plan.programs:
            raise CommandError(plan.status.message)
        self._progress.end(repr(plan))
        for robot, program in zip(plan.robots, plan.programs, strict=True):
            first = next(step for step in program.movements if step.trajectory is not None)
            assert first.trajectory is not None
            off = first.trajectory.positions[0] - self._cells.of_robot(robot).machine_home
            if np.abs(off).max() > _BEGIN:
                raise CommandError(
                    f"{robot} stands at home first, {np.degrees(np.abs(off).max()):.1f} degrees "
                    "off where its program begins, and nothing is proved of what lies between: "
                    "give it a home_deg that is its park posture"
                )
        return plan

    def _commands(self, plan: RobotsPlan) -> list[NodeCommand]:
        facts = [
            f"seed={self._seed}",
            f"plant={self._plant}",
            f"{contents.SAFETY_DISTANCE}={PlanOptions().safety_distance:g} m",
            f"{contents.CYCLES}={self._tended.cycles}",
        ]
        topics = [f"/{robot}/*" for robot in plan.robots]
        recorder = {
            "cell": self._cell,
            "facts": facts,
            "roots": [str(self._out.resolve())],
            "topics": [*topics, names.DIAGNOSTICS, names.ROSOUT],
        }
        commands = [NodeCommand(f"{names.RECORDER}.node", recorder)]
        patience = max(_PATIENCE * plan.period, _LEAST_PATIENCE)
        for robot in plan.robots:
            port = free_port(UDP)
            cell = {"cell": f"{self._cell}@{robot}", "wake_port": port}
            peers = [f"/{other}/{names.PROGRAM_RUNNER}" for other in plan.robots if other != robot]
            runner = {**cell, "peers": peers, "seed": self._seed, "signal_timeout": patience}
            driver = {**cell, "plant": self._plant}
            space = f"/{robot}"
            commands.append(NodeCommand(f"{names.SIM_DRIVER}.node", driver, space))
            commands.append(NodeCommand(f"{names.PROGRAM_RUNNER}.node", runner, space))
        return commands

    def _drive(self, programs: Mapping[str, tuple[PlannedMovement, ...]], stack: ExitStack) -> str:
        """Drive all programs at once; why one ended early, "" where none did."""
        self._progress.begin("drive the programs")
        clients = {
            robot: stack.enter_context(Client(robot, timeout=START_SECONDS, node_name="ir_demo"))
            for robot in programs
        }
        drives = {
            robot: partial(clients[robot].run_program, steps) for robot, steps in programs.items()
        }
        runs, failed = driven_together(drives)
        said = [f"{robot} {run.duration:.1f} s" for robot, run in runs.items()]
        self._progress.end("; ".join([*said, *(["ended early"] if failed else [])]))
        return failed


def driven_together(
    drives: Mapping[str, Callable[..., ProgramRun]],
) -> tuple[dict[str, ProgramRun], str]:
    """Drive all robots at once, by what drives each until its `give_up` is canceled: the runs that
    ended well, and why another did not, "" where all did. One that fails stops the others, and so
    does whatever is raised here, as by Ctrl-C.
    """
    stopped = Cancellation()
    sentences: list[str] = []
    runs: dict[str, ProgramRun] = {}

    def drive(robot: str) -> None:
        try:
            runs[robot] = drives[robot](give_up=stopped)
        except (CommandError, IrError) as error:
            sentences.append(f"{robot}: {error}")
            stopped.cancel()
        except BaseException:
            stopped.cancel()
            raise

    with ThreadPoolExecutor(len(drives)) as pool:
        try:
            ends = [pool.submit(drive, robot) for robot in drives]
            while wait(ends, timeout=LOOK_SECONDS).not_done:
                continue  # a signal that comes just before a wait doesn't end it
            for end in ends:
                end.result()
        except BaseException:
            stopped.cancel()
            raise
    return runs, "; then ".join(sentences)


def examine_robots(
    recording: Path, robots: tuple[str, ...], out: Path, failed: str = ""
) -> RobotsOutcome:
    """Analyse the recording and write the pages; failed: why the run ended early."""
    analyses = {robot: analyse(read_recording(recording, namespace=robot)) for robot in robots}
    own = {robot: findings(analysis) for robot, analysis in analyses.items()}
    outcome = RobotsOutcome(analyses, own, robot_findings(analyses), failed)
    for robot, analysis in analyses.items():
        write_report(analysis, own[robot], out / f"{robot}.html")
    write_robots(analyses, outcome.all_checks, out / "report.html")
    return outcome
