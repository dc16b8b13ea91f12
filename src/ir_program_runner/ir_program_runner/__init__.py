"""Runs a planned program on the driver: movements, pauses with their power mode, signals of the machines."""
