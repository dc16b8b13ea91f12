"""Energy by measurement: motion differentiated, torques, DC link and losses by code of the analysis
alone.
"""

from ir_recorder.measure.power_model import PowerModel
from ir_recorder.measure.samples import (
    Samples,
    movements,
    planned_samples,
    samples_of,
    standing_sample,
)

__all__ = ["PowerModel", "Samples", "movements", "planned_samples", "samples_of", "standing_sample"]
