"""Errors of recordings.

::

    RecorderError
    ├── PathError        the file asked for can't be written there, or is taken
    ├── WriteError       the disk refused while recording: full, read-only
    │   └── LostFileError    the file was deleted or replaced, its disk unmounted
    ├── SchemaError      no definition of a message type is installed
    ├── SplitError       files so small that there would be thousands
    ├── TopicsError      names of topics that are none, or too many
    ├── NothingRecordedError   a recording was asked to end, and none is in progress
    ├── ReadError        not a recording at all, or nothing in it that could be read
    └── LiveError        the live view can't be served
"""


class RecorderError(Exception):
    """Root of what this package raises."""


class PathError(RecorderError):
    """A path that can't become a recording; the sentence says why."""


class WriteError(RecorderError):
    """The storage failed while a recording was written."""


class LostFileError(WriteError):
    """What is recorded has no file any more; another one can be begun."""


class SchemaError(RecorderError):
    """A message type whose definition isn't installed."""


class SplitError(RecorderError):
    """A size or a duration of files that makes no sense."""


class TopicsError(RecorderError):
    """A request names topics that can't be ones."""


class NothingRecordedError(RecorderError):
    """There is no recording to end."""


class ReadError(RecorderError):
    """A file that isn't a recording, or holds nothing readable."""


class LiveError(RecorderError):
    """The live view can't be served; the sentence says why."""
