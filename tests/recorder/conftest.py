"""A small cell, and recordings of it made in milliseconds: real messages, synthetic motion and
power.
"""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from mcap_ros2._dynamic import serialize_dynamic
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from ir_description import cell_from_yaml, load_power_data
from ir_kernels import DynamicsModel, dc_bus
from ir_kernels.power import DcBusParameters
from ir_msgs.msg import (
    ControllerState,
    PlannedMovement,
    PlcOutputs,
    PowerState,
    ProgramSavings,
    ProgramState,
    Saving,
)
from ir_msgs_py.modes import Mode
from ir_recorder import Analysis, analyse, findings, read_recording
from ir_recorder.analysis.production import production_of
from ir_recorder.analysis.tending import MachineTimes, PartRow, Span, TendedStep, Tending
from ir_recorder.format import contents
from ir_recorder.format.qos import QosOffer
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.recording.cell_files import CellFiles
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter
from ir_recorder.report import report_html

CELL_YAML = """
format: ir_cell/1
name: test_cell
robot: kr210_r2700_extra
tool:
  name: gripper
  mass: 155.0
  com: [0.24, 0.0, 0.0]
  inertia_box: [0.4, 0.5, 0.3]
  watts_always: 90.0
  watts_drive_bus: 100.0
  capsules:
    - {name: t_bar, p0: [0.1, -0.24, 0], p1: [0.1, 0.24, 0], radius: 0.09}
    - {name: t_f1, p0: [0.15, -0.22, 0], p1: [0.42, -0.22, 0], radius: 0.055}
    - {name: t_f2, p0: [0.15, 0.22, 0], p1: [0.42, 0.22, 0], radius: 0.055}
tcp: {xyz: [0.42, 0, 0]}
parts:
  - name: part
    mass: 20.0
    com: [0.0, 0.0, 0.0]
    inertia_box: [0.1, 0.3, 0.1]
    capsules: [{name: p_body, p0: [0, -0.1, 0], p1: [0, 0.1, 0], radius: 0.06}]
    bodies: [{name: part_box, kind: box, size: [0.1, 0.22, 0.1]}]
    station: table
equipment:
  - name: table
    pose: {xyz: [1.6, 1.0, 0.0]}
    zone: OPEN
    bodies:
      - {name: table_top, kind: box, xyz: [0, 0, 0.06], size: [0.8, 0.8, 0.12]}
      - {name: table_post, kind: cylinder, xyz: [0.9, 0, 0.6], radius: 0.1, length: 1.2}
    stations:
      - {name: table, pose: {xyz: [0, 0, 0.314], abc_deg: [0, 90, 0]}, approach_distance: 0.2}
  - name: press
    pose: {xyz: [1.68, -1.13, 0.0]}
    zone: SEMI_CLOSED
    bodies:
      - {name: press_bed, kind: box, xyz: [0, 0, 0.09], size: [0.9, 0.9, 0.18]}
      - name: press_head
        kind: mesh
        vertices: [[0.8, -0.4, 0], [1.4, -0.4, 0], [1.4, 0.4, 0], [0.8, 0.4, 0], [1.1, 0, 1.2]]
    stations:
      - name: press
        pose: {xyz: [0, 0, 0.263], abc_deg: [0, 90, 0]}
        allowed_contacts: [{between: [p_body, press_bed], safety_distance: 0.001}]
program:
  - {station: table, attach: part}
  - {station: press, detach: part, dwell: 1.0}
  - {pause: 2.0, power_mode: BUS_POWER_OFF}
  - {posture: home}
"""

START_NS = 1_700_000_000_000_000_000
JOINT_DT_NS = 2_000_000
POWER_DT_NS = 10_000_000
EXACT = (
    "sensor_msgs/msg/JointState",
    "ir_msgs/msg/PowerState",
    "diagnostic_msgs/msg/DiagnosticArray",
)
JOINT_NAMES = [f"joint_a{i}" for i in range(1, 7)]
TABLE_2_MODES = {
    Mode.STAND_ON_MOTORS: "stand_on_motors",
    Mode.MOVING: "stand_on_motors",
    Mode.STAND_ON_BRAKES: "stand_on_brakes",
    Mode.BUS_POWER_OFF: "bus_power_off",
    Mode.HIBERNATION: "hibernation",
}


def stamp(ns: int) -> Time:
    return Time(sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)


def _encoder(kind: str) -> Callable[[Any], bytes]:
    """rclpy's serialize_message is quick but leaves stray bytes behind short sequences; the
    middleware doesn't.
    """
    if kind in (
        "sensor_msgs/msg/JointState",
        "ir_msgs/msg/PowerState",
        "diagnostic_msgs/msg/DiagnosticArray",
    ):
        return serialize_message
    return serialize_dynamic(kind, SchemaLibrary().schema(kind).text)[kind]


@dataclass(eq=False)
class Phase:
    """A stretch of the run: the joints go (or rest) from `start` to `end` in `seconds`, in one
    mode.
    """

    seconds: float
    mode: Mode
    start: np.ndarray
    end: np.ndarray
    load: str = "none"
    target: Mode | None = None
    step: PlannedMovement | None = None
    trajectory_id: str = ""


@dataclass
class Run:
    """Phases one after another, and the recording that a cell going through them leaves."""

    phases: list[Phase] = field(default_factory=list)
    savings: list[ProgramSavings] = field(default_factory=list)
    cell: str = CELL_YAML

    def rest(
        self, seconds: float, mode: Mode, q: np.ndarray, load: str, target: Mode | None = None
    ) -> None:
        self.phases.append(Phase(seconds, mode, q, q, load, target))

    def pause(
        self, seconds: float, mode: Mode, q: np.ndarray, load: str, station: str, name: str
    ) -> None:
        step = PlannedMovement(
            kind="pause", to_station=station, duration=seconds, power_mode=name, load=load
        )
        self.phases.append(Phase(seconds, mode, q, q, load, None, step))

    def move(
        self, seconds: float, start: np.ndarray, end: np.ndarray, load: str, step: PlannedMovement
    ) -> None:
        step.duration = seconds
        step.load = load
        step.trajectory_id = f"{len(self.phases):016x}"
        self.phases.append(
            Phase(seconds, Mode.MOVING, start, end, load, None, step, step.trajectory_id)
        )

    def record(
        self, path: Path, *, plan_factor: float = 1.0, facts: dict[str, str] | None = None
    ) -> Path:
        return _Recorder(self, path, plan_factor, facts or {}).record()


class _Recorder:
    def __init__(self, run: Run, path: Path, plan_factor: float, facts: dict[str, str]) -> None:
        self.run = run
        self.factor = plan_factor
        self.cell = cell_from_yaml(run.cell)
        self.joints = list(self.cell.robot.joint_names)
        self.power = load_power_data()
        self.session = RecordingSession(RecordingWriter(path), facts, START_NS)
        self.encode: dict[str, Callable[[Any], bytes]] = {}
        self.session.attach_cell(CellFiles(run.cell, "<robot name='kr210'/>"), START_NS)
        for topic, kind, offer in (
            ("/joint_states", "sensor_msgs/msg/JointState", QosOffer(depth=100)),
            ("/ir_sim_driver/power_state", "ir_msgs/msg/PowerState", QosOffer()),
            ("/ir_sim_driver/controller_state", "ir_msgs/msg/ControllerState", QosOffer()),
            (
                "/ir_sim_driver/plc_outputs",
                "ir_msgs/msg/PlcOutputs",
                QosOffer(transient_local=True),
            ),
            (
                "/ir_program_runner/program_state",
                "ir_msgs/msg/ProgramState",
                QosOffer(transient_local=True),
            ),
            ("/ir_planner/savings", "ir_msgs/msg/ProgramSavings", QosOffer(transient_local=True)),
            ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", QosOffer()),
        ):
            self.session.open_topic(topic, kind, [offer])
            self.encode[topic] = _encoder(kind)
        self.energy = 0.0
        self.stored = 0.0
        self.now = START_NS
        self.bus = DcBusParameters(self.power.dc_link_capacity_energy)

    def record(self) -> Path:
        steps = [phase for phase in self.run.phases if phase.step is not None]
        for savings in self.run.savings:
            self._put("/ir_planner/savings", savings, self.now)
        for phase in self.run.phases:
            self._diagnostics(phase.load)
            self._phase(phase, steps)
            self._diagnostics(phase.load)
        return self.session.finish().path

    def _put(self, topic: str, message: Any, ns: int) -> None:
        self.session.message(topic, self.encode[topic](message), ns)

    def _diagnostics(self, load: str) -> None:
        status = DiagnosticStatus(
            name="ir_sim_driver",
            hardware_id="KR210, simulated",
            values=[KeyValue(key="load", value=load)],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamp(self.now)
        self._put("/diagnostics", message, self.now)

    def _base(self, phase: Phase) -> float:
        tool = self.cell.tool if "gripper" in phase.load else None
        mode = TABLE_2_MODES.get(phase.mode, "stand_on_motors")
        up = mode in ("stand_on_motors", "stand_on_brakes")
        watts = self.power.mode(mode.upper()).controller_watts
        watts += self.power.drives_and_brake_release if mode == "stand_on_motors" else 0.0
        if tool is not None:
            watts += tool.watts_always + (tool.watts_drive_bus if up else 0.0)
        return watts

    def _phase(self, phase: Phase, steps: list[Phase]) -> None:
        count = round(phase.seconds * 1e9 / JOINT_DT_NS)
        t = np.arange(count) * JOINT_DT_NS * 1e-9
        x = t / phase.seconds
        delta = (phase.end - phase.start)[None, :]
        q = phase.start + delta * (10 * x**3 - 15 * x**4 + 6 * x**5)[:, None]
        qd = delta * ((30 * x**2 - 60 * x**3 + 30 * x**4) / phase.seconds)[:, None]
        qdd = delta * ((60 * x - 180 * x**2 + 120 * x**3) / phase.seconds**2)[:, None]
        loads = (
            self.cell.loads("part" if "part" in phase.load else "") if phase.load != "none" else ()
        )
        model = DynamicsModel(self.cell.robot, loads)
        on = TABLE_2_MODES.get(phase.mode, "stand_on_motors") == "stand_on_motors"
        tau = model.inverse_dynamics(q, qd, qdd) if on else np.zeros_like(q)
        axis = model.axis_power(qd, tau) if on else np.zeros_like(q)
        bus = dc_bus(axis, JOINT_DT_NS * 1e-9, self.bus, self.stored)
        self.stored = float(bus.stored[-1])
        base = self._base(phase)
        mains = bus.mains + base
        index = steps.index(phase) if phase in steps else -1
        if phase.step is not None:
            self._plan(phase, mains, axis, bus, base)
            self._event(phase, index, len(steps), "started")
        asleep = phase.mode is Mode.HIBERNATION
        for k in range(count):
            ns = self.now + k * JOINT_DT_NS
            if not asleep:
                joints = JointState(name=self.joints, position=q[k], velocity=qd[k], effort=tau[k])
                joints.header.stamp = stamp(ns)
                self._put("/joint_states", joints, ns)
            if (k + 1) % 5 == 0:
                self._power(phase, ns + JOINT_DT_NS, mains, axis, bus, tau, base, k)
            if k % 10 == 0 and not asleep:
                state = ControllerState(joint_names=self.joints, trajectory_id=phase.trajectory_id)
                state.header.stamp = stamp(ns)
                state.path_time = float(t[k]) if phase.trajectory_id else 0.0
                state.speed_scaling = 1.0
                state.tool_deviation = 0.0004
                self._put("/ir_sim_driver/controller_state", state, ns)
        outputs = PlcOutputs(
            bbs=on, drives_ready=on, alarm_stop=True, moving=phase.mode is Mode.MOVING
        )
        outputs.header.stamp = stamp(self.now)
        self._put("/ir_sim_driver/plc_outputs", outputs, self.now)
        self.now += count * JOINT_DT_NS
        if phase.step is not None:
            self._event(phase, index, len(steps), "ended")

    def _power(
        self, phase: Phase, ns: int, mains: Any, axis: Any, bus: Any, tau: Any, base: float, k: int
    ) -> None:
        part = slice(k - 4, k + 1)
        power = float(mains[part].mean())
        self.energy += power * POWER_DT_NS * 1e-9
        message = PowerState(mode=int(phase.mode), target_mode=int(phase.target or phase.mode))
        message.header.stamp = stamp(ns)
        message.power = power
        message.energy = self.energy
        message.base_power = base
        link = self.power.dc_link
        message.bus_voltage = float(
            np.sqrt(link.voltage**2 + 2.0 * bus.stored[k] / link.capacitance)
        )
        message.burnt_power = float(bus.dissipated[part].mean())
        message.joint_power = axis[part].mean(axis=0)
        message.joint_torque = tau[k]
        message.joint_current = (
            tau[k] / 10.0
        )  # rosbags misreads two empty sequences of doubles in a row
        self._put("/ir_sim_driver/power_state", message, ns)

    def _plan(self, phase: Phase, mains: Any, axis: Any, bus: Any, base: float) -> None:
        report = phase.step.report
        dt = JOINT_DT_NS * 1e-9
        report.duration = phase.seconds
        report.energy = float(mains.sum() * dt) * self.factor
        report.joint_energy = axis.sum(axis=0) * dt
        report.base_energy = base * phase.seconds
        report.burnt_energy = float(bus.dissipated.sum() * dt)
        report.peak_power = float(mains.max())
        report.min_clearance = 0.1

    def _event(self, phase: Phase, index: int, total: int, event: str) -> None:
        message = ProgramState(program_id="program", index=index, total=total, event=event)
        message.header.stamp = stamp(self.now)
        message.movement = phase.step
        self._put("/ir_program_runner/program_state", message, self.now)


HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
TABLE = np.radians([-32.0, -60.0, 95.0, 0.0, 55.0, 30.0])
PRESS = np.radians([34.0, -55.0, 90.0, 0.0, 50.0, -30.0])


SAVINGS = ProgramSavings(
    available=True,
    movements=Saving(common=4000.0, planned=3000.0, seconds=4.5, share=0.25),
    pauses=Saving(common=1000.0, planned=800.0, seconds=1.2, share=0.2),
    total=Saving(common=5000.0, planned=3800.0, seconds=5.7, share=0.24),
    across=3,
    around=1,
    program_id="0123456789abcdef",
    sentence="what was compared",
)


def demo_run(rest: float = 0.4, move: float = 1.5) -> Run:
    """Table II at machine home without and with the tool, then a program of three movements and two
    pauses.
    """
    run = Run(savings=[SAVINGS])
    for load in ("none", "gripper"):
        run.rest(rest, Mode.STAND_ON_MOTORS, HOME, load)
        run.rest(rest / 2, Mode.TO_BRAKES, HOME, load, Mode.STAND_ON_BRAKES)
        run.rest(rest, Mode.STAND_ON_BRAKES, HOME, load)
        run.rest(rest, Mode.BUS_POWER_OFF, HOME, load)
        run.rest(rest, Mode.HIBERNATION, HOME, load)
        run.rest(rest / 2, Mode.FROM_HIBERNATION, HOME, load, Mode.STAND_ON_MOTORS)
    fetch = PlannedMovement(kind="regional", from_station="home", to_station="table", attach="part")
    bring = PlannedMovement(
        kind="service_entry", from_station="table", to_station="press", detach="part"
    )
    leave = PlannedMovement(kind="service_exit", from_station="press", to_station="home")
    run.move(move, HOME, TABLE, "gripper", fetch)
    run.move(move, TABLE, PRESS, "gripper+part", bring)
    run.pause(rest, Mode.STAND_ON_MOTORS, PRESS, "gripper", "press", "STAND_ON_MOTORS")
    run.pause(2 * rest, Mode.BUS_POWER_OFF, PRESS, "gripper", "press", "BUS_POWER_OFF")
    run.move(move, PRESS, HOME, "gripper", leave)
    return run


@pytest.fixture(scope="session")
def demo_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole run, a few seconds long."""
    return demo_run().record(
        tmp_path_factory.mktemp("recording") / "demo.mcap", facts={"hibernation_leave": "3 s"}
    )


@pytest.fixture(scope="session")
def short_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same run in two seconds: for tests that write and read it dozens of times."""
    return demo_run(rest=0.1, move=0.3).record(tmp_path_factory.mktemp("recording") / "short.mcap")


@pytest.fixture
def new_run() -> Callable[[], Run]:
    """A run without phases."""
    return Run


@pytest.fixture(scope="session")
def new_runs() -> Callable[[], Run]:
    """The same, for recordings that a whole module reads; what their plans save is known."""
    return lambda: Run(savings=[SAVINGS])


@pytest.fixture(scope="session")
def cell_yaml() -> str:
    return CELL_YAML


@pytest.fixture(scope="session")
def analysis(demo_file: Path) -> Analysis:
    return analyse(read_recording(demo_file))


def tending_parts(analysis: Analysis) -> Analysis:
    """The same run as if it had made two parts in a machine, the first of which filled the line."""
    whole = Span(analysis.steps[0].step.start, analysis.steps[-1].step.end)
    middle = 0.5 * (whole.begin + whole.end)
    halves = (Span(whole.begin, middle), Span(middle, whole.end))
    assert analysis.program is not None
    power = analysis.recording.power
    assert power is not None
    ends = np.interp([whole.begin, middle, whole.end], power.time, power.energy)
    parts = tuple(
        PartRow(
            k,
            half,
            each,
            half.seconds - 0.2,
            0.9 * each,
            {"lathe": 0.4},
            {"lathe": 0.2} if k == 2 else {},
            {"lathe": 0.3, "machine_with_a_long_name": 0.1},
        )
        for k, (half, each) in enumerate(zip(halves, np.diff(ends).tolist(), strict=True), start=1)
    )
    steps = tuple(
        TendedStep(
            result.step.movement,
            result.step.start - 0.2 * (k % 2),
            result.step.start,
            result.step.end,
            0.0,
            result.energy,
        )
        for k, result in enumerate(analysis.steps)
    )
    machines = (MachineTimes("lathe", (halves[0],), (halves[1],)),)
    return replace(analysis, tending=Tending(parts, 1, machines, steps))


@pytest.fixture(scope="session")
def tended() -> Callable[[Analysis], Analysis]:
    """A run as if it had tended a machine."""
    return tending_parts


@pytest.fixture(scope="session")
def page(analysis: Analysis) -> str:
    """The report of the whole run."""
    return report_html(analysis, findings(analysis))


@pytest.fixture(scope="session")
def data_of() -> Callable[[str], dict[str, Any]]:
    """What a page hands to its scripts."""

    def read(page: str) -> dict[str, Any]:
        found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
        assert found is not None
        return json.loads(found[1])

    return read


CHROMIUM = Path(__file__).resolve().parents[2] / "tools" / "_chromium.py"


def _tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("_chromium", CHROMIUM)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["_chromium"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    tool = _tool()
    if tool.chromium() is None:
        pytest.skip("needs Chromium: apt install chromium")
    with tool.Browser() as started:
        yield started


@pytest.fixture(scope="session")
def scattered() -> Callable[[Analysis, int], Analysis]:
    """Gives a recording savings of about the energy that was driven: drawn, of a plan that takes up
    to a tenth less or more energy and time, and of a common program that takes more.
    """

    def drawn(analysis: Analysis, seed: int) -> Analysis:
        draw = np.random.default_rng(seed).uniform
        found = analysis.savings
        cycle = production_of(analysis)
        assert found is not None
        assert cycle is not None
        planned = cycle.energy * draw(0.9, 1.1)
        common = cycle.energy * draw(1.2, 1.6)
        moving = found.movements
        seconds = moving.seconds * draw(0.9, 1.1)
        own = replace(
            moving,
            common=common - found.pauses.common,
            planned=planned - found.pauses.planned,
            seconds=seconds,
        )
        longest = (seconds + found.pauses.seconds) * 1.1
        event = replace(analysis.recording.savings[0], savings=replace(found, movements=own))
        facts = (*analysis.recording.facts, (contents.COMMON_SECONDS, f"{longest:.3f} s"))
        return analyse(replace(analysis.recording, savings=(event,), facts=facts))

    return drawn
