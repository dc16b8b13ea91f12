"""Forwards to ir_values.files until every package imports that."""

from ir_values.files import ANYWHERE, ENVIRONMENT, FileRoots

__all__ = ["ANYWHERE", "ENVIRONMENT", "FileRoots"]
