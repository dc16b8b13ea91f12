"""Errors of studies, as one tree.

::

    StudyError
    ├── SettingsError  a settings file makes no sense: the key, its value, and what it may be
    ├── FolderError    the folder of the results holds others, or is in use
    ├── WorkerError    the processes that plan can't be started, or Dask is missing or not reached
    ├── DrivingError   the simulated robot did not drive what was planned
    └── StoppedError   somebody asked to stop; what was made is kept
"""


class StudyError(Exception):
    """Root of everything that ir_studies raises; a sentence for people."""


class SettingsError(StudyError):
    """Settings that make no sense."""

    exit_code = 2


class FolderError(StudyError):
    """A folder that can't be used."""


class WorkerError(StudyError):
    """Processes that can't be started."""


class DrivingError(StudyError):
    """A movement or a mode that did not take place."""


class StoppedError(StudyError):
    """Stopped by whoever started it."""
