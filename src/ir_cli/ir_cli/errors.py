"""What can go wrong at the command line.

CommandError
├── ProcessError        a node could not be started, or died
└── DemonstrationError  a step of the demonstration failed
"""


class CommandError(Exception):
    """A sentence for the person at the terminal; the command ends with exit code 1."""


class ProcessError(CommandError):
    """A node could not be started, or died."""


class DemonstrationError(CommandError):
    """A step of the demonstration failed."""
