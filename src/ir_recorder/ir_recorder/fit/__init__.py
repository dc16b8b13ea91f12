"""Power parameters fitted to a meter or to the motors, and what the data say of each."""

from ir_recorder.fit.changes import Change, change
from ir_recorder.fit.channels import open_prior
from ir_recorder.fit.doubts import doubts, fit_sources, result
from ir_recorder.fit.fit_data import BY, DataSource, FitData, fit_data, source_cell
from ir_recorder.fit.left_out import (
    LeftOut,
    left_out,
    median_error,
    plain_torques,
    recommendation,
    shaft_power_rms,
    shaft_work,
)
from ir_recorder.fit.power_estimate import Estimate, Fit, FittedMovement, fit
from ir_recorder.fit.presentation import left_out_rows, parameter_rows, sentences, write_fit_picture

__all__ = [
    "BY",
    "Change",
    "DataSource",
    "Estimate",
    "Fit",
    "FitData",
    "FittedMovement",
    "LeftOut",
    "change",
    "doubts",
    "fit",
    "fit_data",
    "fit_sources",
    "left_out",
    "left_out_rows",
    "median_error",
    "open_prior",
    "parameter_rows",
    "plain_torques",
    "recommendation",
    "result",
    "sentences",
    "shaft_power_rms",
    "shaft_work",
    "source_cell",
    "write_fit_picture",
]
