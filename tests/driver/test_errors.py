"""Refusals of the driver as values."""

from __future__ import annotations

import pickle

import pytest

from ir_msgs_py.status import StatusCode
from ir_sim_driver import DriverError, ErrorCode, TrajectoryRefusedError
from ir_sim_driver.errors import RequestRefusedError


@pytest.mark.parametrize(
    "error",
    [
        TrajectoryRefusedError(ErrorCode.INVALID_GOAL, "too fast"),
        RequestRefusedError(StatusCode.FAILURE, "asleep"),
    ],
)
def test_a_refusal_passes_between_processes(error: DriverError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.code) == (type(error), str(error), error.code)  # type: ignore[attr-defined]
