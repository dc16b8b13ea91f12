"""Which build of the compiled core this process uses: native, baseline, or none (the NumPy
reference).

`_native` was compiled for the processor of the machine that built it and may hold instructions that
another one lacks; `_processor` knows what it needs; `_baseline` runs on any x86-64. The environment
variable IR_KERNELS forces one of "native", "baseline", "reference".
"""

import importlib
import os
import warnings
from typing import Any

Core = Any
"""The compiled module, which has no types, or None: the NumPy reference takes its place."""

CHOICES = ("native", "baseline", "reference")


def _import(name: str) -> Core:
    try:
        return importlib.import_module(f"ir_kernels.{name}")
    except ImportError:
        return None


def load(choice: str = "") -> tuple[str, Core]:
    """Name of the build and its module, None for the NumPy reference.

    `choice`: one of CHOICES, or empty for the fastest that runs here. Raises ImportError when a
    build that is asked for by name is not installed; warns once (RuntimeWarning) when nothing
    compiled is there.
    """
    if choice not in ("", *CHOICES):
        raise ImportError(f"IR_KERNELS is {choice!r}: known are {', '.join(CHOICES)}")
    if choice == "reference":
        return "reference", None
    processor = _import("_processor") if choice != "baseline" else None
    native = _import("_native") if processor is not None and processor.native_runs_here() else None
    if native is not None:
        return "native", native
    baseline = _import("_baseline") if choice != "native" else None
    if baseline is not None:
        return "baseline", baseline
    if choice:
        raise ImportError(
            f"IR_KERNELS asks for the {choice} build of ir_kernels, which is not there or can't "
            "run here"
        )
    warnings.warn(
        "ir_kernels: no compiled core is installed, the NumPy reference is used (some hundred "
        "times slower); install a C++ compiler and install ir_kernels again",
        RuntimeWarning,
        stacklevel=3,
    )
    return "reference", None


NAME, MODULE = load(os.environ.get("IR_KERNELS", ""))
