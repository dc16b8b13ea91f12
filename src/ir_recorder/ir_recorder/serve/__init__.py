"""The recorder's services."""

__all__: list[str] = []
