"""What can go wrong in the shared vocabulary, as one tree.

MsgsError
├── InvalidValueError (ValueError)    a field is out of its bounds, not finite or of the wrong shape
│   ├── TrajectoryError               a point of a trajectory; knows point and joint
│   │   └── JointNamesError           unknown, missing or double joint
│   └── PoseError                     a pose that means nothing; knows the status code of the answer
├── MessageTextError (ValueError)     YAML text that is not the message it is said to be
├── FileRefusedError                  a file outside of the allowed folders, or of another kind
├── UnknownTypeError                  no such message, service or action type
├── ParameterError (ValueError)       a parameter out of range or a settings class without its
descriptions └── ClientError
    ├── ServiceUnavailableError       no node offers it
    ├── CallTimedOutError             offered, but no answer in time
    └── RequestRefusedError           answered with a status that is not SUCCESS; carries it
"""


class MsgsError(Exception):
    """Root of all errors of this package."""


class InvalidValueError(MsgsError, ValueError):
    """A value that a field cannot hold; the sentence names the field, the value and its bound."""


class TrajectoryError(InvalidValueError):
    """A trajectory that cannot be followed.

    point and joint are the 0-based indices at fault, None where the whole trajectory is.
    """

    def __init__(self, sentence: str, point: int | None = None, joint: int | None = None) -> None:
        super().__init__(sentence)
        self.point = point
        self.joint = joint


class JointNamesError(TrajectoryError):
    """Joint names that are not the expected set."""


class PoseError(InvalidValueError):
    """A pose that cannot be used; `code` is the status code that answers it."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


class MessageTextError(MsgsError, ValueError):
    """YAML text that does not describe the message it is meant for."""


class FileRefusedError(MsgsError):
    """A file that may not be read or written; the sentence names the path and the allowed
    folders.
    """


class UnknownTypeError(MsgsError):
    """No interface of this name is installed."""


class ParameterError(MsgsError, ValueError):
    """A parameter value out of its range, or a settings class that lacks a description."""


class ClientError(MsgsError):
    """A request of a script that got no usable answer."""


class ServiceUnavailableError(ClientError):
    """No node offers this service or action."""


class CallTimedOutError(ClientError):
    """The node is there but did not answer in time."""


class RequestRefusedError(ClientError):
    """The node answered, with a status other than SUCCESS."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code
