"""What a recording asks other nodes for: the planner's cell, and the parameters of all nodes."""

__all__: list[str] = []
