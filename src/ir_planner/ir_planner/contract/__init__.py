"""What is asked of searches, registered here or by installed packages: tests for
`pytest --pyargs ir_planner.contract -k NAME`.
"""

__all__: list[str] = []
