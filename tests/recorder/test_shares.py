"""Modes and stations share all time and energy."""

from __future__ import annotations

import pytest

from ir_recorder import Analysis


def test_modes_and_steps_share_all_time_and_energy(analysis: Analysis) -> None:
    assert sum(share.energy for share in analysis.modes) == pytest.approx(analysis.energy)
    assert sum(share.seconds for share in analysis.modes) == pytest.approx(analysis.seconds)
    total = sum(use.energy for use in analysis.stations) + analysis.elsewhere.energy
    assert total == pytest.approx(analysis.energy)


def test_stations_get_their_pauses_service_movements_and_travel(analysis: Analysis) -> None:
    uses = {use.station: use for use in analysis.stations}
    assert set(uses) == {"table", "press"}
    assert uses["table"].travel.seconds == pytest.approx(1.5, abs=1e-6)
    assert uses["press"].service.seconds == pytest.approx(3.0, abs=1e-6)
    assert uses["press"].rest.seconds == pytest.approx(1.2, abs=1e-6)
