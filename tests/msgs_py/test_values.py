"""Values refuse at the door what they cannot hold, with the value, its bound and the unit."""

from __future__ import annotations

import numpy as np
import pytest

from ir_msgs_py import announcements as program
from ir_msgs_py import modes, plc, report
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import Status, StatusCode
from ir_values.errors import InvalidValueError

NAN = float("nan")


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: PlanOptions(planning_time=0.0), "planning_time is 0 s: it must be more than 0 s"),
        (lambda: PlanOptions(planning_time=-1.0), "planning_time is -1 s"),
        (lambda: PlanOptions(planning_time=NAN), "planning_time is nan s: it must be finite"),
        (
            lambda: PlanOptions(safety_distance=-0.1),
            "safety_distance is -0.1 m: it must be at least 0 m",
        ),
        (
            lambda: PlanOptions(objective="fun"),
            'objective is "fun": known are movement_cost, time, energy',
        ),
        (
            lambda: PlanOptions(velocity_scaling=0.0),
            r"velocity_scaling is 0: it must be in \(0, 1\]",
        ),
        (lambda: PlanOptions(seed=-1), "seed is -1: it must be in 0"),
        (
            lambda: report.PlannedMovement(kind="jump"),
            'kind of movement is "jump": known are service_exit',
        ),
        (
            lambda: report.PlannedMovement(kind="pause", power_mode="NAP"),
            "power mode 'NAP' of the pause is unknown: known",
        ),
        (
            lambda: report.PlannedMovement(kind="regional", power_mode="HIBERNATION"),
            "only a pause has one",
        ),
        (
            lambda: report.PlannedMovement(kind="pause", trajectory_id="ab"),
            "a pause has no trajectory",
        ),
        (
            lambda: report.PlannedMovement(kind="pause", duration=-1.0),
            "duration of the movement is -1 s",
        ),
        (lambda: report.TrajectoryReport(energy=NAN), "energy is nan: it must be finite"),
        (
            lambda: report.TrajectoryReport(min_clearance=NAN),
            "min_clearance is nan m: it must be a number",
        ),
        (
            lambda: report.TrajectoryReport(joint_energy=np.zeros(6), torque_ratio=np.zeros(5)),
            "torque_ratio has 5 joints: joint_energy has 6",
        ),
        (
            lambda: report.DistancePair("self", "a", "b", NAN, np.zeros(3), np.zeros(3)),
            "distance of a and b is nan m: it must be finite",
        ),
        (
            lambda: report.DistancePair("self", "a", "b", 0.0, np.zeros(2), np.zeros(3)),
            r"point_a has shape \(2,\): it must be \(3\)",
        ),
        (lambda: report.Rejection("no path", -1), "count of 'no path' is -1"),
        (
            lambda: report.PlanningInfo(start=np.zeros(2), start_names=("a",)),
            "start has 2 values for 1 joint names",
        ),
        (lambda: modes.checked_mode(7), "power mode is 7: known are 0 STAND_ON_MOTORS"),
        (
            lambda: modes.PowerMode(mode=modes.Mode.MOVING, time_to_pause=-1.0),
            "time_to_pause of MOVING is -1 s",
        ),
        (
            lambda: modes.PowerMode(mode=modes.Mode.MOVING, break_even=NAN),
            "break_even of MOVING is nan",
        ),
        (lambda: plc.Signal("", True), "name of a signal is ''"),
        (lambda: plc.Signal("a\nb", True), "1 to 256 printable characters"),
        (lambda: plc.Signal.parse("door=2"), 'signal "door=2" has level "2": known are 0, 1'),
        (lambda: plc.PlcInputs().with_bit("zz", True), 'PLC input is "zz": known are ab, hib, ks'),
        (lambda: plc.PlcInputs().with_bit("T1", False), "operating mode T1 cannot be taken away"),
        (
            lambda: program.ProgramState(
                stamp_ns=0,
                program_id="p",
                index=2,
                total=2,
                event="started",
                movement=report.PlannedMovement(kind="pause"),
            ),
            "index of the movement is 2: it must be in 0 .. 1",
        ),
    ],
)
def test_a_bad_value_is_named(build, sentence):
    with pytest.raises(InvalidValueError, match=sentence):
        build()


def test_zero_is_a_value():
    options = PlanOptions(safety_distance=0.0, seed=0)
    assert options.safety_distance == 0.0


def test_arrays_are_read_only():
    value = report.TrajectoryReport(joint_energy=[1, 2])
    with pytest.raises(ValueError, match="read-only"):
        value.joint_energy[0] = 3.0


def test_a_status_says_its_code_as_a_word():
    status = Status(-31, "position 9 m away is out of reach")
    assert status.code is StatusCode.NO_IK_SOLUTION
    assert str(status) == "NO_IK_SOLUTION (-31): position 9 m away is out of reach"
    assert not status.ok
    assert Status.success().ok
    assert str(Status(7)) == "CODE 7 (7)"


def test_a_program_sets_and_clears_signals_by_text():
    assert plc.Signal.parse("clamp") == plc.Signal("clamp", True)
    assert plc.Signal.parse("clamp=1") == plc.Signal("clamp", True)
    assert plc.Signal("clamp", False).text == "not clamp"
    assert (
        plc.Signal.parse("clamp=0") == plc.Signal.parse("not clamp") == plc.Signal("clamp", False)
    )


def test_one_bit_changes_and_the_others_stay():
    inputs = plc.PlcInputs(emergency_stop=True).with_bit("ab", True).with_bit("EXT", True)
    assert inputs == plc.PlcInputs(
        emergency_stop=True, ab=True, operating_mode=plc.OperatingMode.EXT
    )
