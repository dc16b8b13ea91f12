"""Values of the core as messages."""

from __future__ import annotations

import numpy as np

from ir_description import load_cell
from ir_msgs.msg import Station
from ir_msgs_py.ros.conversions import stamped_pose_from_msg
from ir_planner.node.answers import stations_to_msg

ROUNDING = 1e-14  # a rotation through a quaternion and back


def test_a_cells_stations_go_out_with_pose_zone_and_contacts() -> None:
    cell = load_cell("demo")
    messages = stations_to_msg(cell)
    assert [msg.name for msg in messages] == [station.name for station in cell.stations]
    for msg, station in zip(messages, cell.stations, strict=True):
        assert msg.equipment == station.equipment
        assert msg.zone in (Station.OPEN, Station.SEMI_CLOSED, Station.CLOSED)
        assert msg.zone.upper() == station.zone
        np.testing.assert_allclose(stamped_pose_from_msg(msg.pose), station.pose, atol=ROUNDING)
        contacts = [(c.body_a, c.body_b, c.safety_distance) for c in msg.allowed_contacts]
        assert contacts == [
            (c.body_a, c.body_b, c.safety_distance) for c in station.allowed_contacts
        ]
    assert any(msg.allowed_contacts for msg in messages)
