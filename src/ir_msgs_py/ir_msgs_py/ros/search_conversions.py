"""Conversions of logs of searches to and from messages; each pair is a round trip."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from ir_msgs.msg import ConfigurationLog as ConfigurationLogMsg
from ir_msgs.msg import CorrectionLog as CorrectionLogMsg
from ir_msgs.msg import Rejection as RejectionMsg
from ir_msgs.msg import SearchLogs as SearchLogsMsg
from ir_msgs.msg import ToolTrack as ToolTrackMsg
from ir_msgs.msg import WithdrawalLog as WithdrawalLogMsg
from ir_msgs_py.search_log import (
    ConfigurationLog,
    CorrectionLog,
    Counts,
    SearchLog,
    Track,
    WithdrawalLog,
)
from ir_values.arrays import FloatArray

_WITHDRAWAL = (
    "station",
    "load",
    "method",
    "generations",
    "candidates",
    "asked",
    "blocked",
)
_CONFIGURATIONS = ("station", "starts", "accepted", "distinct")
_CORRECTION = ("start", "goal", "generations", "met")


def searches_to_msg(logs: Iterable[SearchLog]) -> SearchLogsMsg:
    """Logs of searches; their order by kind stays."""
    found = SearchLogsMsg()
    for log in logs:
        match log:
            case WithdrawalLog():
                found.withdrawals.append(_withdrawal_to_msg(log))
            case ConfigurationLog():
                found.configurations.append(_configuration_log_to_msg(log))
            case CorrectionLog():
                found.corrections.append(_correction_to_msg(log))
    return found


def searches_from_msg(msg: SearchLogsMsg) -> tuple[SearchLog, ...]:
    """Logs of searches: withdrawals, configurations, corrections."""
    return (
        *map(_withdrawal_from_msg, msg.withdrawals),
        *map(_configuration_log_from_msg, msg.configurations),
        *map(_correction_from_msg, msg.corrections),
    )


def _withdrawal_to_msg(log: WithdrawalLog) -> WithdrawalLogMsg:
    return WithdrawalLogMsg(
        **{name: getattr(log, name) for name in _WITHDRAWAL},
        rejected=_counts_to_msg(log.rejected),
        distance=list(log.distance),
        parents=log.parents.tolist(),
        **{name: _points_to_msg(getattr(log, name)) for name in ("kept", "dropped", "path")},
    )


def _withdrawal_from_msg(msg: WithdrawalLogMsg) -> WithdrawalLog:
    return WithdrawalLog(
        **{name: getattr(msg, name) for name in _WITHDRAWAL},
        rejected=_counts_from_msg(msg.rejected),
        distance=_pair(msg.distance),
        parents=np.array(msg.parents, dtype=np.int64),
        kept=_points_from_msg(msg.kept),
        dropped=_points_from_msg(msg.dropped),
        path=_points_from_msg(msg.path),
    )


def _configuration_log_to_msg(log: ConfigurationLog) -> ConfigurationLogMsg:
    return ConfigurationLogMsg(
        **{name: getattr(log, name) for name in _CONFIGURATIONS},
        rejected=_counts_to_msg(log.rejected),
        tracks=[
            ToolTrackMsg(outcome=track.outcome, points=_points_to_msg(track.points))
            for track in log.tracks
        ],
    )


def _configuration_log_from_msg(msg: ConfigurationLogMsg) -> ConfigurationLog:
    return ConfigurationLog(
        **{name: getattr(msg, name) for name in _CONFIGURATIONS},
        rejected=_counts_from_msg(msg.rejected),
        tracks=tuple(Track(track.outcome, _points_from_msg(track.points)) for track in msg.tracks),
    )


def _correction_to_msg(log: CorrectionLog) -> CorrectionLogMsg:
    return CorrectionLogMsg(
        **{name: getattr(log, name) for name in _CORRECTION},
        fitness=[value for stretch in log.fitness for value in stretch],
        fitness_counts=[len(stretch) for stretch in log.fitness],
        costs=list(log.costs),
        stretches=[ToolTrackMsg(points=_points_to_msg(stretch)) for stretch in log.stretches],
        **{name: _points_to_msg(getattr(log, name)) for name in ("straight", "path", "driven")},
    )


def _correction_from_msg(msg: CorrectionLogMsg) -> CorrectionLog:
    values = iter(msg.fitness)
    return CorrectionLog(
        **{name: getattr(msg, name) for name in _CORRECTION},
        fitness=tuple(tuple(islice(values, count)) for count in msg.fitness_counts),
        costs=_pair(msg.costs),
        stretches=tuple(_points_from_msg(stretch.points) for stretch in msg.stretches),
        straight=_points_from_msg(msg.straight),
        path=_points_from_msg(msg.path),
        driven=_points_from_msg(msg.driven),
    )


def _points_to_msg(points: FloatArray) -> list[float]:
    return points.ravel().tolist()


def _points_from_msg(values: Sequence[float]) -> FloatArray:
    return np.array(values, dtype=np.float64).reshape(-1, 3)


def _counts_to_msg(counts: Counts) -> list[RejectionMsg]:
    return [RejectionMsg(reason=reason, count=count) for reason, count in counts]


def _counts_from_msg(rejected: Iterable[RejectionMsg]) -> Counts:
    return tuple((each.reason, each.count) for each in rejected)


def _pair(values: Sequence[float]) -> tuple[float, float]:
    return float(values[0]), float(values[1])
