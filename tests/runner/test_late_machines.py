"""The program follows its machines, not the clock: a late one shifts what depends on it, nothing
else.
"""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st

from ir_description.cell import ProcessTimes
from ir_msgs_py.announcements import Event
from ir_msgs_py.modes import Mode
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status
from ir_program_runner import Machines, Program, ProgramSettings
from ir_program_runner import requests as ask

HANDS = 2.0  # s of every step in which the robot has its hands full


@dataclass(frozen=True)
class Described:
    name: str
    initial: bool = False
    follows: str = ""
    delay: float = 0.0
    process: str = ""


def machine(name: str) -> tuple[Described, Described]:
    return (
        Described(f"{name}.start"),
        Described(f"{name}.done", follows=f"{name}.start", process=name),
    )


class World:
    """Machines and a clock; a robot whose pauses end when they are asked to. When each step began
    and ended [s].
    """

    def __init__(self, lathe: float, washer: float) -> None:
        times = {"lathe": ProcessTimes(lathe, lathe), "washer": ProcessTimes(washer, washer)}
        self.machines = Machines((*machine("lathe"), *machine("washer")), times)
        self.now = 100.0
        self.executed = 0
        self.started: dict[int, float] = {}
        self.ended: dict[int, float] = {}

    def run(self, steps: list[PlannedMovement]) -> World:
        program = Program(steps, ProgramSettings()).run()
        try:
            request = next(program)
            while True:
                self.fulfil(request)
                request = program.send(
                    ask.RequestOutcome(self.now, Mode.STAND_ON_MOTORS, Status.success())
                )
        except StopIteration as ended:
            self.executed = ended.value.executed
        return self

    def fulfil(self, request: ask.Request) -> None:
        match request:
            case ask.Announce(index, Event.STARTED):
                self.started[index] = self.now
            case ask.Announce(index, _):
                self.ended[index] = self.now
            case ask.SetSignal(signal):
                self.machines.set(signal, self.now)
            case ask.WaitUntil(moment):
                self.now = max(self.now, moment)
                self.answer()
            case ask.WaitForSignals(signals):
                while not self.machines.holds(signals):
                    self.now = max(self.now, self.machines.next_answer)
                    self.answer()

    def answer(self) -> None:
        for signal in self.machines.take_answers(self.now):
            self.machines.hear(signal, self.now)


def wait(seconds: float, since: str = "", wait_for: str = "", sets: str = "") -> PlannedMovement:
    return PlannedMovement(
        kind="pause",
        duration=seconds,
        since=since,
        wait_for=(wait_for,) if wait_for else (),
        set_signals=(sets,) if sets else (),
    )


def tended(lathe: float, washer: float) -> list[PlannedMovement]:
    """Both are loaded, each is waited for and unloaded; then the lathe is loaded again."""
    return [
        wait(HANDS, sets="washer.start"),
        wait(HANDS, sets="lathe.start"),
        wait(lathe, since="lathe.start"),
        wait(HANDS, wait_for="lathe.done", sets="lathe.start=0"),
        wait(washer - lathe - 2.0 * HANDS, since="washer.start"),
        wait(HANDS, wait_for="washer.done", sets="washer.start=0"),
    ]


@given(
    lathe=st.floats(1.0, 50.0),
    slack=st.floats(1.0, 50.0),
    late=st.floats(0.0, 100.0),
)
def test_a_late_machine_shifts_what_depends_on_it_and_nothing_else(
    lathe: float, slack: float, late: float
) -> None:
    washer = lathe + 2.0 * HANDS + slack
    steps = tended(lathe, washer)
    planned = World(lathe, washer).run(steps)
    driven = World(lathe + late, washer).run(steps)
    assert abs(driven.started[3] - planned.started[3] - late) < 1e-6
    # the washer doesn't know of the lathe: its part is taken on time as long as the robot can
    beyond = max(late - slack, 0.0)
    assert abs(driven.started[5] - planned.started[5] - beyond) < 1e-6
    assert driven.ended[2] == planned.ended[2]
    assert driven.executed == len(steps)


def test_a_pause_whose_signal_was_not_set_yet_is_as_long_as_planned() -> None:
    world = World(1.0, 1.0).run([wait(7.0, since="lathe.start")])
    assert world.ended[0] - world.started[0] == 7.0
