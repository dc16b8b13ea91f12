"""Messages in C before Python objects are made of them.

rclpy converts a message while it holds the interpreter, so that no other thread runs meanwhile. It
asks the message's class for the function that converts it; a class made here has a function of our
own, which looks at the C message first.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

from ir_msgs_py.ros.rclpy_inside import part

Convert = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p)
"""Makes a Python object of the C message at an address."""
_api = ctypes.pythonapi
_api.PyCapsule_GetName.restype = ctypes.c_char_p
_api.PyCapsule_GetName.argtypes = [ctypes.py_object]
_api.PyCapsule_GetPointer.restype = ctypes.c_void_p
_api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
_api.PyCapsule_New.restype = ctypes.py_object
_api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]


class CSequence(ctypes.Structure):
    """Of rosidl_runtime_c; a string has the same layout. What it holds is freed by its capacity,
    whatever its size.
    """

    _fields_ = (("data", ctypes.c_void_p), ("size", ctypes.c_size_t), ("capacity", ctypes.c_size_t))


def converter(kind: Any) -> Callable[[int], Any] | None:
    """The function that makes an object of a C message of this metaclass; None where it has
    none.
    """
    if part(kind, "_CONVERT_TO_PY") is None:
        kind.__import_type_support__()
    capsule = part(kind, "_CONVERT_TO_PY")
    if capsule is None:
        return None
    return Convert(_api.PyCapsule_GetPointer(capsule, _api.PyCapsule_GetName(capsule)))


def lookalike(kind: Any, convert: Any) -> Any:
    """A class that rclpy takes for one of metaclass `kind`, whose messages `convert` makes: a
    Convert, which has to be kept.
    """
    pointer = ctypes.cast(convert, ctypes.c_void_p)
    own = {
        "_TYPE_SUPPORT": kind._TYPE_SUPPORT,
        "_CREATE_ROS_MESSAGE": kind._CREATE_ROS_MESSAGE,
        "_DESTROY_ROS_MESSAGE": kind._DESTROY_ROS_MESSAGE,
        "_CONVERT_TO_PY": _api.PyCapsule_New(pointer, None, None),
    }
    return type("Lookalike", (), own)()
