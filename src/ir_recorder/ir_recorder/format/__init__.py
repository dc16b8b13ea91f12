"""Contents of a recording file beside its messages: schemas, quality of service, names of
attachments.
"""

from ir_recorder.format.qos import (
    QosOffer,
    QosRequest,
    offers_from_yaml,
    offers_to_yaml,
    request_for,
)
from ir_recorder.format.schemas import Field, MessageSchema, SchemaLibrary, definitions_of

__all__ = [
    "Field",
    "MessageSchema",
    "QosOffer",
    "QosRequest",
    "SchemaLibrary",
    "definitions_of",
    "offers_from_yaml",
    "offers_to_yaml",
    "request_for",
]
