"""Bits of the PLC: debounce, interlocks, stuck bits, mode switch."""

from __future__ import annotations

import pytest

from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import OperatingMode, PlcInputs
from ir_sim_driver.notices import Notices
from ir_sim_driver.plc.inputs import Plc, PlcSettings

DT = 0.001


@pytest.fixture
def plc():
    plc = Plc(PlcSettings(), Notices())
    run(plc, 1.0)
    return plc


def run(plc, seconds, pause=False):
    for _ in range(round(seconds / DT)):
        plc.step(DT, pause)


def warnings(plc):
    return [notice.sentence for notice in plc._notices.take()]


@pytest.mark.parametrize(("bit", "rest"), [("ab", Mode.BUS_POWER_OFF), ("hib", Mode.HIBERNATION)])
def test_a_bit_asks_for_its_rest_after_the_debounce(plc, bit, rest):
    plc.set_bit(bit, True)
    run(plc, 0.019)
    assert plc.rest is None
    run(plc, 0.002)
    assert plc.rest is rest
    plc.set_bit(bit, False)
    run(plc, 0.021)
    assert plc.rest is None


def test_chatter_never_counts(plc):
    for k in range(1000):
        plc.set_bit("ab", k % 2 == 0)
        plc.step(DT)
        assert plc.rest is None


def test_emergency_stop_counts_at_once_and_its_release_is_debounced(plc):
    plc.set_bit("emergency_stop", True)
    plc.step(DT)
    assert plc.levels.emergency_stop
    plc.set_bit("emergency_stop", False)
    plc.step(DT)
    assert plc.levels.emergency_stop
    run(plc, 0.021)
    assert not plc.levels.emergency_stop


@pytest.mark.parametrize("bits", [("ab", "hib"), ("ab", "ks"), ("hib", "ks"), ("ab", "hib", "ks")])
def test_a_contradiction_is_ignored_with_a_warning(plc, bits):
    plc.set_all(PlcInputs(**dict.fromkeys(bits, True)))
    run(plc, 0.05)
    assert plc.rest is None
    assert not plc.restart
    assert any("only one of AB, HIB and KS" in sentence for sentence in warnings(plc))


def test_a_deeper_rest_may_be_asked_for_before_the_one_in_force_is_taken_back(plc):
    """As a program does between the two modes of a pause: no warning, unless both bits stay."""
    plc.set_bit("ab", True)
    run(plc, 0.05)
    plc.set_bit("hib", True)
    run(plc, 0.3)
    assert plc.rest is Mode.BUS_POWER_OFF
    plc.set_bit("ab", False)
    run(plc, 1.0)
    assert plc.rest is Mode.HIBERNATION
    assert not warnings(plc)
    plc.set_bit("ab", True)
    run(plc, 1.0)
    assert any("only one of AB, HIB and KS" in sentence for sentence in warnings(plc))


def test_a_contradiction_leaves_what_was_accepted(plc):
    plc.set_bit("ab", True)
    run(plc, 0.05)
    plc.set_bit("hib", True)
    run(plc, 0.05)
    assert plc.rest is Mode.BUS_POWER_OFF
    plc.set_bit("ab", False)
    run(plc, 0.05)
    assert plc.rest is Mode.HIBERNATION


@pytest.mark.parametrize("mode", [OperatingMode.T1, OperatingMode.T2, OperatingMode.AUT])
def test_power_bits_count_only_in_ext(plc, mode):
    plc.set_operating_mode(mode)
    plc.set_bit("ab", True)
    run(plc, 0.05)
    assert plc.rest is None
    assert any(mode.name in sentence for sentence in warnings(plc))


@pytest.mark.parametrize("mode", [OperatingMode.T1, OperatingMode.EXT])
@pytest.mark.parametrize("pause", [False, True])
@pytest.mark.parametrize("bits", [("ab",), ("hib",), ("ab", "hib"), ("drives_on",)])
def test_what_is_said_beforehand_is_what_counts_after_the_debounce(plc, mode, pause, bits):
    plc.set_operating_mode(mode)
    for bit in bits:
        plc.set_bit(bit, True)
    remark = plc.remark(bits[-1], pause)
    before = plc.rest
    run(plc, 0.05, pause)
    said = warnings(plc)
    assert bool(remark) == bool(said)
    if remark:
        assert plc.rest is before
        assert said[-1].endswith(remark.partition("ignored: ")[2])


def test_what_is_taken_back_outside_ext_stays_and_is_said(plc):
    plc.set_bit("ab", True)
    run(plc, 0.05)
    plc.set_operating_mode(OperatingMode.T1)
    plc.set_bit("ab", False)
    sentence = "PLC bit AB is 0 but ignored: operating mode is T1, must be EXT"
    assert plc.remark("ab") == sentence
    run(plc, 0.05)
    assert plc.rest is Mode.BUS_POWER_OFF
    assert warnings(plc)[-1] == sentence
    plc.set_bit("drives_on", True)
    run(plc, 0.05)
    assert warnings(plc) == []  # said once
    plc.set_operating_mode(OperatingMode.EXT)
    run(plc, 0.05)
    assert plc.rest is None


def test_a_bit_that_is_stuck_says_so():
    plc = Plc(PlcSettings(), Notices())
    run(plc, 0.1)
    plc.set_all(PlcInputs(ab=True))
    plc.set_bit("ab", True)
    assert "ignored until it has been 0" in plc.remark("ab")
    plc.set_bit("ab", False)
    plc.set_bit("ab", True)
    assert plc.remark("ab") == ""


def test_power_bits_and_a_profienergy_pause_exclude_each_other(plc):
    plc.set_bit("hib", True)
    run(plc, 0.05, pause=True)
    assert plc.rest is None
    assert any("PROFIenergy" in sentence for sentence in warnings(plc))


def test_a_bit_that_is_already_1_at_the_start_is_ignored_until_it_was_0():
    plc = Plc(PlcSettings(), Notices())
    run(plc, 0.1)
    plc.set_all(PlcInputs(ab=True))
    run(plc, 5.0)
    assert plc.rest is None
    plc.set_all(PlcInputs())
    run(plc, 0.05)
    plc.set_all(PlcInputs(ab=True))
    run(plc, 0.05)
    assert plc.rest is Mode.BUS_POWER_OFF


def test_a_first_set_later_than_the_start_counts(plc):
    plc.set_all(PlcInputs(ab=True))
    run(plc, 0.05)
    assert plc.rest is Mode.BUS_POWER_OFF


def test_after_waking_hib_is_ignored_until_it_was_0(plc):
    plc.set_bit("hib", True)
    run(plc, 0.05)
    plc.wake()
    run(plc, 1.0)
    assert plc.rest is None
    plc.set_bit("hib", False)
    run(plc, 0.05)
    plc.set_bit("hib", True)
    run(plc, 0.05)
    assert plc.rest is Mode.HIBERNATION


def test_pulses_are_edges_and_seen_once(plc):
    seen = []
    plc.set_bit("drives_on", True)
    for _ in range(100):
        plc.step(DT)
        seen.append(plc.drives_on)
    assert sum(seen) == 1
