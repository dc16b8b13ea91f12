"""Contents of a recording file beside its messages: schemas, quality of service, names of
attachments.
"""

__all__ = []
