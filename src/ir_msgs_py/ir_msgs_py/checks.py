"""Forwards to ir_values until every package imports that."""

from ir_values.arrays import at_least, finite, in_fraction, not_nan, one_of, read_only, set_field
from ir_values.errors import SENTENCE_MAX, one_line

__all__ = [
    "SENTENCE_MAX",
    "at_least",
    "finite",
    "in_fraction",
    "not_nan",
    "one_line",
    "one_of",
    "read_only",
    "set_field",
]
