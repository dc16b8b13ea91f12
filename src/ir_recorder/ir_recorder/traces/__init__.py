"""Measured data from anywhere: one reader of CSV, Parquet and recordings, units, clocks, gaps."""

from ir_recorder.traces.align import ClockOffset, clock_offset, mean_power, resampled
from ir_recorder.traces.mapping import TraceMapping, read_mapping
from ir_recorder.traces.reader import column_names, read_traces
from ir_recorder.traces.trace import Trace

__all__ = [
    "ClockOffset",
    "Trace",
    "TraceMapping",
    "clock_offset",
    "column_names",
    "mean_power",
    "read_mapping",
    "read_traces",
    "resampled",
]
