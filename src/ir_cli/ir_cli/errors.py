"""What can go wrong at the command line.

CommandError
├── InputError          what was typed makes no sense: exit code 2
├── ProcessError        a node could not be started, or died
└── DemonstrationError  a step of the demonstration failed
"""


class CommandError(Exception):
    """A sentence for the person at the terminal; the command ends with `exit_code`."""

    exit_code = 1


class InputError(CommandError):
    """What was typed, or the file that was named, makes no sense."""

    exit_code = 2


class ProcessError(CommandError):
    """A node could not be started, or died."""


class DemonstrationError(CommandError):
    """A step of the demonstration failed."""
