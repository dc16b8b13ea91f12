"""Power at rest comes out of a recording alone, and Table II where the load is the paper's."""

from __future__ import annotations

import pytest

from ir_recorder import Analysis


def test_all_eight_values_of_table_2_come_out_of_the_recording_alone(analysis: Analysis) -> None:
    assert len(analysis.plateaus) == 8
    for row in analysis.plateaus:
        assert row.power == pytest.approx(row.table_2, rel=1e-3)
        assert row.expected == pytest.approx(row.table_2, rel=1e-3)
