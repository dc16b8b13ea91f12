"""Many robots and shifts on one page: kWh by robot, mode and movement, and what could be saved by
what.
"""

from ir_recorder.report.fleet.members import MOST, Member, member_of, read_members
from ir_recorder.report.fleet.page import fleet_html, write_fleet
from ir_recorder.report.fleet.table import fleet_columns, write_fleet_table

__all__ = [
    "MOST",
    "Member",
    "fleet_columns",
    "fleet_html",
    "member_of",
    "read_members",
    "write_fleet",
    "write_fleet_table",
]
