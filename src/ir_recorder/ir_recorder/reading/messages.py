"""Values out of decoded messages: the same fields, checked, whatever library decoded them."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from typing import Any

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from ir_msgs_py.report import DistancePair, PlannedMovement, TrajectoryReport
from ir_msgs_py.savings import ProgramSavings, Saving
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.format.schemas import definitions_of
from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import RawChannel
from ir_values.arrays import FloatArray

_LONG = 1 << 16  # bytes of a message whose values are counted before it is decoded


def decoder_of(channel: RawChannel) -> Callable[[bytes], Any] | None:
    """What decodes the channel's messages, None where nothing does; raises nearly anything for a
    damaged schema. The library prints what it can't read, which may be anything: that stays out of
    the terminal. A long message of more values than `Columns` reads is a ReadError, before each of
    them takes an object.
    """
    schema = Schema(1, channel.schema_text.encode(), channel.schema_encoding, channel.type)
    definitions_of(channel.type, channel.schema_text)
    with contextlib.redirect_stderr(io.StringIO()):
        decode: Callable[[bytes], Any] | None = DecoderFactory().decoder_for(
            channel.message_encoding, schema
        )
    if decode is None:
        return None

    def decoded(data: bytes) -> Any:
        if len(data) > _LONG:
            Columns([data], channel.type, channel.schema_text)
        return decode(data)

    return decoded


def movement_from(message: Any) -> PlannedMovement:
    """A PlannedMovement of its decoded message, without the points; ValueError where a field makes
    no sense.
    """
    return PlannedMovement(
        kind=message.kind,
        from_station=message.from_station,
        to_station=message.to_station,
        trajectory_id=message.trajectory_id,
        report=report_from(message.report),
        duration=message.duration,
        power_mode=message.power_mode,
        attach=message.attach,
        detach=message.detach,
        load=message.load,
        wait_for=tuple(message.wait_for),
        set_signals=tuple(message.set_signals),
        since=getattr(message, "since", ""),  # older recordings have none
        passes=tuple(getattr(message, "passes", ())),
    )


def trajectory_from(message: Any) -> JointTrajectory:
    """A JointTrajectory of its decoded message, without its efforts; an IrError where it makes no
    sense.
    """
    times = [
        point.time_from_start.sec * 1_000_000_000 + point.time_from_start.nanosec
        for point in message.points
    ]
    positions, velocities, accelerations = (
        [list(getattr(point, name)) for point in message.points]
        for name in ("positions", "velocities", "accelerations")
    )
    return JointTrajectory(
        tuple(message.joint_names),
        np.array(times, dtype=np.int64),
        np.array(positions, dtype=np.float64),
        np.array(velocities, dtype=np.float64) if all(velocities) else None,
        np.array(accelerations, dtype=np.float64) if all(accelerations) else None,
    )


def savings_from(message: Any) -> ProgramSavings:
    """ProgramSavings of its decoded message."""
    return ProgramSavings(
        available=bool(message.available),
        movements=_saving_from(message.movements),
        pauses=_saving_from(message.pauses),
        across=int(message.across),
        around=int(message.around),
        program_id=message.program_id,
        sentence=message.sentence,
    )


def _saving_from(message: Any) -> Saving:
    low, high = (getattr(message, name, 0.0) for name in ("saved_low", "saved_high"))  # older: none
    return Saving(*map(float, (message.common, message.planned, message.seconds, low, high)))


def report_from(message: Any) -> TrajectoryReport:
    """A TrajectoryReport of its decoded message; what recordings of before don't have keeps its
    default.
    """
    later = (
        "energy_low",
        "energy_high",
        "power_parameters",
        "torque_reserve",
        "safety_distance",
        "tool_speed",
        "tool_acceleration",
    )
    return TrajectoryReport(
        **{name: getattr(message, name) for name in later if hasattr(message, name)},
        duration=message.duration,
        movement_cost=message.movement_cost,
        energy=message.energy,
        joint_energy=message.joint_energy,
        base_energy=message.base_energy,
        burnt_energy=message.burnt_energy,
        peak_power=message.peak_power,
        min_clearance=message.min_clearance,
        closest=_pair_from(message.closest) if message.closest.body_a else None,
        closest_time=message.closest_time,
        velocity_ratio=message.velocity_ratio,
        acceleration_ratio=message.acceleration_ratio,
        jerk_ratio=message.jerk_ratio,
        torque_ratio=message.torque_ratio,
        path_length=message.path_length,
        certified=message.certified,
        cell_hash=getattr(message, "cell_hash", ""),  # recordings from before have neither
        load=getattr(message, "load", ""),
        contacts=tuple(_pair_from(pair) for pair in message.contacts),
    )


def _pair_from(message: Any) -> DistancePair:
    return DistancePair(
        kind=message.kind,
        body_a=message.body_a,
        body_b=message.body_b,
        distance=message.distance,
        point_a=_point(message.point_a),
        point_b=_point(message.point_b),
        allowed_contact=message.allowed_contact,
    )


def _point(point: Any) -> FloatArray:
    return np.array([point.x, point.y, point.z], dtype=np.float64)


def contact_sentence(contact: Any) -> str:
    """A recorded Contact, for people."""
    pair = contact.pair
    return (
        f"contact: {pair.body_a} touched {pair.body_b} at {contact.speed:.2f} m/s, "
        f"{contact.depth * 1e3:.1f} mm deep, about {contact.force:.0f} N (simulated)"
    )
