"""Every kernel in plain NumPy, written for reading: the tests' oracle, and what runs without a
compiler.
"""
