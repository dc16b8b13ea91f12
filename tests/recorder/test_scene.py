"""The motion and the parts in the picture in 3D are those of the recording."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np

from ir_recorder import read_recording


def test_the_motion_is_in_the_page_to_a_hundredth_of_a_degree(
    page: str, demo_file: Path, data_of: Any
) -> None:
    scene = data_of(page)["scene"]
    counts = np.frombuffer(base64.b64decode(scene["angles"]), dtype="<i2").reshape(scene["frames"], 6)
    joints = read_recording(demo_file).joints
    np.testing.assert_allclose(counts[0] * scene["angleStep"], joints.position[0], atol=1.1e-4)
    np.testing.assert_allclose(counts[-1] * scene["angleStep"], joints.position[-1], atol=1.1e-4)


def test_a_part_moves_from_station_to_hand_to_station(page: str, data_of: Any) -> None:
    (part,) = data_of(page)["scene"]["parts"]
    assert [where is not None for _, where in part["lies"]] == [True, False, True]
