"""The shop floor's laws on cells and programs that are drawn: what goes out comes back, what is
known is read.
"""

from __future__ import annotations

import pytest
from _shop_cells import drawn_cell
from _shop_hidden import row_of
from _shop_round_trip import SHARE, planned, round_trip

from ir_krl.write import STYLES
from ir_planner import Planner


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 1])
def test_a_drawn_cell_comes_back_in_every_style(seed: int) -> None:
    """Law: seconds and joules of each step within 0.5 % of its comment, the same loads, contacts
    and modes, certified again.
    """
    planner = Planner(drawn_cell(seed), clock=lambda: 0.0)
    plan = planned(planner)
    assert plan.status.ok, plan.status.message
    for style in STYLES:
        row = round_trip(planner, plan, style)
        assert not row.refused
        assert row.certified
        assert max(row.seconds_off, row.joules_off) <= SHARE, row
        assert row.loads_off + row.modes_off + row.contacts_off == 0, row


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(1000, 1040))
def test_what_is_known_of_a_program_is_read(seed: int) -> None:
    row = row_of(seed)
    assert row.verdict == "right", row
