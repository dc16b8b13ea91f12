"""Movements of a cell from whose watts the power parameters of its robot can be identified."""
