"""Errors of studies, as one tree.

::

    StudyError
    ├── SettingsError  a settings file makes no sense: the key, its value, and what it may be
    └── StoppedError   somebody asked to stop; what was made is kept
"""


class StudyError(Exception):
    """Root of everything that ir_studies raises; a sentence for people."""


class SettingsError(StudyError):
    """Settings that make no sense."""

    exit_code = 2


class StoppedError(StudyError):
    """Stopped by whoever started it."""
