"""The runner's state on /diagnostics."""
