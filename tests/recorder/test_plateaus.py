"""Table II comes out of a recording alone."""

from __future__ import annotations

import pytest

from ir_recorder import Analysis


def test_all_eight_values_of_table_2_come_out_of_the_recording_alone(analysis: Analysis) -> None:
    assert len(analysis.plateaus) == 8
    for row in analysis.plateaus:
        assert row.power == pytest.approx(row.expected, rel=1e-3)
