"""The line of a study says how long the rest of a phase takes."""

from __future__ import annotations

from ir_cli.studies import TimeLeft


def test_the_time_left_follows_from_jobs_of_this_phase_and_this_run() -> None:
    now = [0.0]
    left = TimeLeft(lambda: now[0])
    assert left.words("looks", 40, 100) == ""  # 40 were there already
    now[0] = 10.0
    assert left.words("looks", 50, 100) == ", about 50 s for the others"
    now[0] = 200.0
    assert left.words("looks", 60, 100) == ", about 7 min for the others"
    assert left.words("looks", 100, 100) == ""
    assert left.words("plans", 0, 16) == ""
    now[0] = 8000.0
    assert left.words("plans", 4, 16) == ", about 6 h for the others"
    assert left.words("plans", 0, 16) == ""  # the next batch
