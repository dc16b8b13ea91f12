"""Errors of recordings.

::

    RecorderError            itself: a file can't be written there, or is taken
    ├── WriteError       the disk refused while recording: full, read-only
    │   └── LostFileError    the file was deleted or replaced, its disk unmounted
    ├── SchemaError      no definition of a message type is installed
    └── ReadError        not a recording at all, or nothing in it that could be read
"""


class RecorderError(Exception):
    """Root of what this package raises; the sentence says what is refused, and why."""


class WriteError(RecorderError):
    """The storage failed while a recording was written."""


class LostFileError(WriteError):
    """What is recorded has no file any more; another one can be begun."""


class SchemaError(RecorderError):
    """A message type whose definition isn't installed."""


class ReadError(RecorderError):
    """A file that isn't a recording, or holds nothing readable."""
