"""Power parameters fitted to a power meter, with what the data say of each."""

from ir_recorder.fit.data import FitData, Source, fit_data, source_cell
from ir_recorder.fit.estimate import Fit, FittedMovement, fit
from ir_recorder.fit.presentation import parameter_rows, sentences, write_fit_picture

__all__ = [
    "Fit",
    "FitData",
    "FittedMovement",
    "Source",
    "fit",
    "fit_data",
    "parameter_rows",
    "sentences",
    "source_cell",
    "write_fit_picture",
]
