"""The `ir` command: demonstration, service calls, cells and reports."""

from ir_cli.errors import CommandError, DemonstrationError, ProcessError

__all__ = ["CommandError", "DemonstrationError", "ProcessError"]
