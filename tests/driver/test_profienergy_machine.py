"""PROFIenergy's commands in every state and transition: an answer is what the controller then does.

The reference is written from docs/driver.md: how long a state lasts, what leads out of it, and who
may give which command in it.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_msgs_py.modes import Mode, TransitionTimes
from ir_sim_driver.errors import RequestRefusedError

ENTER_STAY_LEAVE = {
    "STAND_ON_BRAKES": (0.3, 0.4, 0.5),
    "BUS_POWER_OFF": (0.5, 0.6, 0.8),
    "HIBERNATION": (0.7, 0.4, 4.0),
}
FALLS = {
    "TO_BRAKES": "STAND_ON_BRAKES",
    "TO_BUS_POWER_OFF": "BUS_POWER_OFF",
    "TO_HIBERNATION": "HIBERNATION",
}
RISES = {
    "FROM_BRAKES": "STAND_ON_BRAKES",
    "FROM_BUS_POWER_OFF": "BUS_POWER_OFF",
    "FROM_HIBERNATION": "HIBERNATION",
}
ASLEEP = {"TO_HIBERNATION", "HIBERNATION"}
PAUSES = {"short pause": 6.0, "pause": 5000.0}  # s; deep enough for bus power off; for every rest
LONG = PAUSES["pause"]
STEP = 0.004  # s
TIMES = TransitionTimes(
    **{
        f"{name.lower()}_{what}": seconds
        for name, row in ENTER_STAY_LEAVE.items()
        for what, seconds in zip(("enter", "minimum_stay", "leave"), row, strict=True)
    }
)


def seconds_to_motors(state: str, since: float) -> float:
    """From a state that has lasted for `since` seconds, when everything lets the motors on."""
    if state in FALLS:
        enter, stay, leave = ENTER_STAY_LEAVE[FALLS[state]]
        return enter - since + stay + leave
    if state in ENTER_STAY_LEAVE:
        _, stay, leave = ENTER_STAY_LEAVE[state]
        return max(0.0, stay - since) + leave
    return ENTER_STAY_LEAVE[RISES[state]][2] - since if state in RISES else 0.0


class Bench:
    """A controller, and since when its state lasts."""

    def __init__(self, simulation):
        self.simulation = simulation
        self.since = 0.0
        self.bit = ""
        self.pause = False

    @property
    def state(self):
        return self.simulation.modes.mode.name

    def run(self, seconds):
        for _ in range(round(seconds / self.simulation.settings.dt)):
            before = self.state
            self.simulation.step()
            self.since = 0.0 if self.state != before else self.since + self.simulation.settings.dt

    def begin(self, how):
        if how in ("ab", "hib", "emergency_stop"):
            self.bit = how
            self.simulation.plc.set_bit(how, True)
        elif how in PAUSES:
            self.pause = True
            self.simulation.pauses.start(PAUSES[how], executing=False)

    def then(self, how):
        if how in ("release", "wake") and self.bit:
            self.simulation.plc.set_bit(self.bit, False)
            self.bit = ""
        if how == "wake":
            self.simulation.wake()
        elif how == "end":
            self.simulation.control.end_pause()
            self.pause = False

    def end_is_refused(self):
        return bool(self.bit) or self.state in ASLEEP | {"EMERGENCY_STOP"}

    def start_is_refused(self):
        if self.bit:
            return True
        may = {"STAND_ON_MOTORS", "STAND_ON_BRAKES", "TO_BRAKES"}
        if self.pause:
            may |= {"TO_BUS_POWER_OFF", "BUS_POWER_OFF", "TO_HIBERNATION"}
        return self.state not in may


# how it began; after how long; what came then; how long before the command
WAYS = [
    ("", 0.1, "", 0.0),
    *(("pause", at, "", 0.0) for at in (0.1, 0.5, 0.9, 1.9)),
    ("pause", 0.1, "end", 0.9),
    *(("short pause", at, "", 0.0) for at in (0.9, 1.4)),
    *(("short pause", 1.4, "end", at) for at in (0.1, 0.6)),
    ("ab", 0.2, "", 0.0),
    ("ab", 0.2, "release", 1.4),
    ("hib", 0.3, "", 0.0),
    ("hib", 0.3, "release", 0.7),
    ("hib", 1.5, "wake", 0.1),
    ("emergency_stop", 0.3, "", 0.0),
]
# to states of these, later or after another command
MORE_WAYS = [
    *(("pause", at, "", 0.0) for at in (1.3, 2.1, 2.6, 3.2)),
    *(("pause", 0.1, "end", at) for at in (0.1, 0.4)),
    ("short pause", 1.4, "end", 0.9),
    ("ab", 1.0, "", 0.0),
    *(("ab", 0.2, "release", at) for at in (0.1, 0.6)),
    ("hib", 1.0, "", 0.0),
    *(("hib", 0.3, "release", at) for at in (0.1, 0.3)),
    ("hib", 1.5, "wake", 0.5),
]
every_way = pytest.mark.parametrize(
    "way", [*WAYS, *(pytest.param(way, marks=pytest.mark.long) for way in MORE_WAYS)], ids=str
)


@pytest.fixture
def bench(make):
    def at(began, after, came, until):
        bench = Bench(make(transitions=TIMES))
        bench.run(0.8)
        bench.begin(began)
        bench.run(after)
        bench.then(came)
        bench.run(until)
        return bench

    return at


@pytest.mark.sampled
@every_way
def test_end_pause_says_when_the_motors_are_on_or_that_they_stay_off(bench, way):
    here = bench(*way)
    state = here.state
    expected = seconds_to_motors(state, here.since)
    if here.end_is_refused():
        with pytest.raises(RequestRefusedError, match="can't be ended"):
            here.simulation.control.end_pause()
        here.run(6.0)
        assert here.state != "STAND_ON_MOTORS"
        return
    said = here.simulation.control.end_pause()
    assert said == pytest.approx(expected, abs=STEP)
    here.run(max(0.0, said - STEP))
    assert said <= STEP or here.state != "STAND_ON_MOTORS"
    here.run(2 * STEP)
    assert here.state == "STAND_ON_MOTORS"


@pytest.mark.sampled
@pytest.mark.parametrize("pause", [0.5, LONG])
@every_way
def test_start_pause_ends_in_the_mode_that_it_answers_or_changes_nothing(bench, way, pause):
    here = bench(*way)
    if here.start_is_refused():
        twin = bench(*way)
        with pytest.raises(RequestRefusedError, match="no pause"):
            here.simulation.pauses.start(pause, executing=False)
        for _ in range(30):
            here.run(0.1)
            twin.run(0.1)
            assert here.state == twin.state
        return
    promised = here.simulation.pauses.start(pause, executing=False).mode
    here.run(6.0)
    assert here.state == promised.name
    assert pause < LONG or promised is Mode.HIBERNATION


@pytest.mark.sampled
@every_way
def test_query_modes_tells_the_times_and_changes_nothing(bench, way):
    here = bench(*way)
    twin = bench(*way)
    for told in here.simulation.pauses.query_modes():
        enter, stay, leave = ENTER_STAY_LEAVE.get(told.mode.name, (0.0, 0.0, 0.0))
        assert (told.time_to_pause, told.time_min_length_of_stay) == (enter, stay)
        assert told.regular_time_to_operate == leave
    here.run(1.0)
    twin.run(1.0)
    assert here.state == twin.state


def test_the_ways_lead_to_every_state_and_transition(bench):
    states = {bench(*way).state for way in WAYS}
    assert {mode.name for mode in Mode} - states == {"MOVING"}


def test_in_motion_no_pause_begins_and_none_is_to_be_ended(make, plan, start, cell):
    simulation = make(transitions=TIMES)
    home = np.array(cell.machine_home)
    start(simulation, plan(2.0, home, home + 0.2))
    simulation.run(1.0)
    assert simulation.modes.mode is Mode.MOVING
    with pytest.raises(RequestRefusedError, match="executing"):
        simulation.pauses.start(LONG, executing=True)
    assert simulation.control.end_pause() == 0.0
    simulation.run(0.1)
    assert simulation.modes.mode is Mode.MOVING
