"""Work of all studies: jobs in worker processes, results in a growing file, settings files."""

from ir_studies.work.job import Job, Row, StudyJob
from ir_studies.work.means import MOST_WORKERS, Means
from ir_studies.work.results import Results
from ir_studies.work.settings_file import (
    Placed,
    beside,
    checked_known,
    checked_number,
    checked_numbers,
    read_text,
    settings_values,
)

__all__ = [
    "MOST_WORKERS",
    "Job",
    "Means",
    "Placed",
    "Results",
    "Row",
    "StudyJob",
    "beside",
    "checked_known",
    "checked_number",
    "checked_numbers",
    "read_text",
    "settings_values",
]
