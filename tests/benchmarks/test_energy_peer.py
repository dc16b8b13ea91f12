"""IPOPT beside the planner: its answers are trajectories, and its joules are those of the
drives.
"""

from __future__ import annotations

import numpy as np
import pytest
from _baseline import baseline
from _drives import Drives
from energy import MOST, S_M, certified, movements

from ir_planner import Planner


@pytest.mark.long
def test_a_peer_is_certified_and_cheaper_than_the_baseline() -> None:
    from _energy_peer import EnergyPeer  # CasADi takes a second to load

    planner = Planner("open", clock=lambda: 0.0)
    scene = planner.scene()
    drives = Drives(scene)
    q0, q1 = next(movements(scene, 1, 0))
    duration = 1.5
    peer = EnergyPeer(scene)
    found = peer.solve(q0, q1, duration, 0)
    assert found is not None
    assert peer.energy == pytest.approx(
        drives.energy(found), rel=0.01
    )  # smoothed friction, 60 intervals
    answer = certified(planner, found, scene, "")
    assert answer is not None
    assert answer.duration <= MOST * duration
    assert np.abs(answer.positions[[0, -1]] - [q0, q1]).max() < 1e-12
    assert planner.evaluate(answer, safety_distance=S_M).verification.certified
    assert drives.energy(answer) < drives.energy(baseline(q0, q1, scene, duration))
