"""What is asked of backends and links, registered here or by installed packages: tests for
`pytest --pyargs ir_sim_driver.contract -k NAME`.
"""

__all__: list[str] = []
