"""Measured data from anywhere: one reader of CSV, Parquet and recordings, units, clocks, gaps."""

from ir_recorder.traces.columns import TraceMapping, read_mapping
from ir_recorder.traces.reader import column_names, read_traces
from ir_recorder.traces.trace import ClockOffset, Trace, clock_offset, mean_power

__all__ = [
    "ClockOffset",
    "Trace",
    "TraceMapping",
    "clock_offset",
    "column_names",
    "mean_power",
    "read_mapping",
    "read_traces",
]
