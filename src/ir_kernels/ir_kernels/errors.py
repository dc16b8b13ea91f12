"""The error of the kernels."""


class KernelError(ValueError):
    """An argument makes no sense: the message names it, what it is and what it has to be."""
