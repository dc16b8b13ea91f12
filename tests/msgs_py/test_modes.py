from __future__ import annotations

import pytest

from ir_msgs_py.modes import (
    DRIVES_ON,
    MODES,
    OFF_THE_NETWORK,
    READY,
    REST_MODES,
    REST_OF_BIT,
    RESTS,
    ROW,
    Mode,
    checked_mode,
)
from ir_msgs_py.plc import PLC_INPUT_NAMES
from ir_values.errors import InvalidValueError


def test_the_table_goes_from_shallow_to_deep() -> None:
    assert [row.depth for row in MODES] == list(range(len(MODES)))
    assert REST_MODES == ("STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")


def test_every_number_is_a_row_a_transition_of_one_row_moving_or_the_emergency_stop() -> None:
    transitions = [mode for row in RESTS for mode in (row.entering, row.leaving)]
    assert sorted([*ROW, *transitions, Mode.MOVING, Mode.EMERGENCY_STOP]) == sorted(Mode)


def test_a_transition_is_named_after_its_mode() -> None:
    for row in RESTS:
        mode = row.mode.name.removeprefix("STAND_ON_")
        assert (row.entering.name, row.leaving.name) == (f"TO_{mode}", f"FROM_{mode}")


def test_what_the_columns_say() -> None:
    assert {Mode.STAND_ON_MOTORS, Mode.MOVING} == READY
    assert {Mode.HIBERNATION, Mode.FROM_HIBERNATION} == OFF_THE_NETWORK
    assert READY | {Mode.STAND_ON_BRAKES, Mode.TO_BRAKES, Mode.FROM_BRAKES} == DRIVES_ON
    assert REST_OF_BIT == {"ab": Mode.BUS_POWER_OFF, "hib": Mode.HIBERNATION}
    assert set(REST_OF_BIT) <= set(PLC_INPUT_NAMES)
    assert ROW[Mode.BUS_POWER_OFF].name == "Bus power off"


def test_an_unknown_number_lists_the_known() -> None:
    assert checked_mode(4) is Mode.HIBERNATION
    with pytest.raises(
        InvalidValueError, match="power mode is 7: known are 0 STAND_ON_MOTORS, 1 MOVING"
    ):
        checked_mode(7)
