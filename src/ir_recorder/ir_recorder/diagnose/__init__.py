"""The recorder's state on /diagnostics."""

__all__: list[str] = []
