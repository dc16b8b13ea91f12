"""Forwards to ir_values.arrays until every package imports that."""

from ir_values.arrays import BoolArray, FloatArray, IntArray

__all__ = ["BoolArray", "FloatArray", "IntArray"]
