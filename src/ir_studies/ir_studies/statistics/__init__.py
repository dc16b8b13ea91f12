"""Statistics of section VI of the paper over random movements of a cell.

Time and energy with synchronous and asynchronous joints; predicted, measured directly and measured
indirectly.
"""

from ir_studies.statistics.runs import run_statistics
from ir_studies.statistics.settings import EXAMPLE, StatisticsSettings, statistics_settings

__all__ = [
    "EXAMPLE",
    "StatisticsSettings",
    "run_statistics",
    "statistics_settings",
]
