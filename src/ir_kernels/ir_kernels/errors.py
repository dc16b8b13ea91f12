"""Errors of the kernels.

KernelError
└── InputError (also a ValueError): an argument has the wrong shape, type or value; the message
names it
"""


class KernelError(Exception):
    """Root of everything that ir_kernels raises."""


class InputError(KernelError, ValueError):
    """An argument makes no sense: the message names it, what it is and what it has to be."""
