"""What somebody has given stays until he, or drives_on, takes it away: a law of AB, HIB and
drives_off. A stop ends a pause of PROFIenergy.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.modes import Mode
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plc import OWN_BITS, SERVICE, TOPIC, giver_of

sys.path.insert(0, str(Path(__file__).parent))
from stop_core import Core

RUNNER = giver_of(SERVICE, "runner")
OTHERS = ((TOPIC, ""), (SERVICE, "operator"))
WAITS = st.sampled_from([1, 30])  # steps: within the debounce, and beyond


def wait(core: Core, steps: int) -> None:
    for _ in range(steps):
        core.step(0.001)


def taken_back(core: Core, bit: str) -> None:
    """All that the program runner does at the end of a pause."""
    with suppress(RequestRefusedError):
        core.control.take_back(bit, RUNNER)
    if bit == "drives_off":
        with suppress(RequestRefusedError):
            core.control.end_rest(RUNNER)


@given(st.sampled_from(OWN_BITS), st.sampled_from(OTHERS), st.booleans(), WAITS, WAITS)
def test_what_another_has_given_stays_when_a_program_takes_its_own_back(
    bit: str, other: tuple[str, str], first: bool, between: int, after: int
) -> None:
    core = Core()
    writer, client = other
    for mine in (not first, first):
        if mine:
            core.plc.write(SERVICE, {bit: True}, "runner")
        else:
            core.plc.write(writer, {bit: True}, client)
        wait(core, between)
    taken_back(core, bit)
    wait(core, after + 30)
    assert getattr(core.plc.levels, bit)
    assert core.control.refusal()


@given(st.sampled_from(OTHERS), WAITS)
def test_a_pulse_of_drives_off_stays_latched_when_a_program_takes_its_own_back(
    other: tuple[str, str], steps: int
) -> None:
    core = Core()
    writer, client = other
    core.plc.write(SERVICE, {"drives_off": True}, "runner")
    wait(core, 30)
    core.plc.write(writer, {"drives_off": True}, client)
    wait(core, steps)
    core.plc.write(writer, {"drives_off": False}, client)
    wait(core, steps)
    taken_back(core, "drives_off")
    wait(core, 30)
    assert core.control.latches.drives_off


@given(st.sampled_from(OWN_BITS), WAITS)
def test_what_a_program_alone_has_given_goes(bit: str, steps: int) -> None:
    core = Core()
    core.plc.write(SERVICE, {bit: True}, "runner")
    wait(core, steps)
    taken_back(core, bit)
    wait(core, 30)
    assert not getattr(core.plc.levels, bit)
    assert not core.control.latches.drives_off


@settings(max_examples=25)
@given(st.integers(0, 5000), st.booleans())
def test_a_stop_ends_a_pause_of_profienergy_for_good(after: int, recovers: bool) -> None:
    core = Core()
    core.control.pauses._route = (Mode.STAND_ON_BRAKES, Mode.BUS_POWER_OFF, Mode.HIBERNATION)
    wait(core, after)
    core.write({"emergency_stop": True})
    wait(core, 1)
    core.write({"emergency_stop": False})
    wait(core, 30)
    if recovers:
        core.recover()
    wait(core, 5000)
    assert core.control.pauses.rest is None
    assert not core.control.pauses.active
    assert core.mode not in (Mode.TO_HIBERNATION, Mode.HIBERNATION)
