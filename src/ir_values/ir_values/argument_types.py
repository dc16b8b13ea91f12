"""Arguments of the types in their annotations, or one sentence: what a caller without a type
checker passes by mistake doesn't come farther than the door.

    @typed(InvalidValueError)
    def until(time: float) -> ...    # until("x"): time is 'x': it must be a number

Numbers, texts, arrays of numbers, lists of these, and classes are looked at; other annotations hold
whatever comes. Bounds are checks of their own.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, wraps
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from ir_values.errors import shown

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")
Refusal = Callable[[str], Exception]
_NAMES: dict[object, str] = {
    float: "a number",
    int: "a whole number",
    str: "a text",
    bool: "true or false",
    NoneType: "None",
    np.ndarray: "an array of numbers",
}
_NUMBERS: dict[object, tuple[type, ...]] = {
    float: (Real,),
    int: (Integral,),
    bool: (bool, np.bool_),
}


def fits(value: object, kind: Any) -> bool:
    """Whether a value is what an annotation says."""
    origin = get_origin(kind)
    if kind in _NUMBERS:
        return isinstance(_scalar(value), _NUMBERS[kind]) and _is_float(value)
    if origin in (Union, UnionType):
        return any(fits(value, one) for one in _alternatives(kind))
    if kind is np.ndarray or origin is np.ndarray:
        return _is_array(value)
    if origin in (tuple, list, Sequence, Mapping):
        return _is_list(value, origin, get_args(kind))
    return isinstance(value, kind) if isinstance(kind, type) else True


def _alternatives(kind: Any) -> list[Any]:
    """Those of a union, where ArrayLike is an array of numbers."""
    args = get_args(kind)
    arrays = get_args(ArrayLike)
    if not set(arrays) <= set(args):
        return list(args)
    return [np.ndarray, *(one for one in args if one not in arrays)]


def _is_list(value: object, origin: object, kinds: tuple[Any, ...]) -> bool:
    if origin is Mapping:
        return isinstance(value, Mapping) and all(
            fits(name, kinds[0]) and fits(each, kinds[1]) for name, each in value.items()
        )
    listed = Sequence if kinds[0] is str else (Sequence, np.ndarray)
    if not isinstance(value, listed) or isinstance(value, (str, bytes)):
        return False
    return all(fits(each, kinds[0]) for each in value)


def _scalar(value: object) -> object:
    """A number, out of an array without axes where it is in one."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _is_float(value: Any) -> bool:
    """Whether a number isn't beyond all floats."""
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _is_array(value: object) -> bool:
    if value is None or isinstance(value, (str, bytes, Mapping)) or callable(value):
        return False
    try:
        return np.asarray(value, dtype=np.float64).ndim > 0
    except (TypeError, ValueError, OverflowError):
        return False


def described(kind: Any) -> str:
    """An annotation as a sentence says it."""
    origin = get_origin(kind)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(map(described, _alternatives(kind))))
    if origin in (tuple, list, Sequence):
        return "a list"
    if origin is Mapping:
        return "a mapping"
    name = _NAMES.get(origin or kind)
    return name or f"a {getattr(origin or kind, '__name__', kind)}"


class _Arguments:
    """The arguments of one callable."""

    def __init__(self, call: Callable[..., Any], bound: bool) -> None:
        self.call = call
        parameters = list(inspect.signature(call).parameters.values())[1 if bound else 0 :]
        self.names = [
            one.name
            for one in parameters
            if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)
        ]

    @cached_property
    def kinds(self) -> dict[str, Any]:
        """The annotation of each, read when it is first called: it may name what is defined
        later.
        """
        return get_type_hints(self.call)

    def fault(self, args: Sequence[object], named: Mapping[str, object]) -> str:
        """The sentence about the first that doesn't fit, "" where all do."""
        kinds = self.kinds
        for name, value in (*zip(self.names, args, strict=False), *named.items()):
            kind = kinds.get(name)
            if kind is None or type(value) is kind or fits(value, kind):
                continue
            return f"{name} is {shown(value)}: it must be {described(kind)}"
        return ""


def typed(refusal: Refusal, *, bound: bool = False) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorates a callable so that it raises `refusal(sentence)` for an argument of another type;
    bound: the first one is left out.
    """

    def decorated(call: Callable[P, R]) -> Callable[P, R]:
        arguments = _Arguments(call, bound)

        @wraps(call)
        def checked(*args: P.args, **named: P.kwargs) -> R:
            fault = arguments.fault(args[1:] if bound else args, named)
            if fault:
                raise refusal(fault)
            return call(*args, **named)

        return checked

    return decorated


def typed_methods(refusal: Refusal) -> Callable[[type[C]], type[C]]:
    """Decorates a class so that its construction and its public methods are `typed`."""

    def decorated(of: type[C]) -> type[C]:
        checked = typed(refusal, bound=True)
        for name, member in list(vars(of).items()):
            if name.startswith("_") and name != "__init__":
                continue
            if inspect.isfunction(member):
                setattr(of, name, checked(member))
            elif isinstance(member, classmethod):
                setattr(of, name, classmethod(checked(member.__func__)))
        return of

    return decorated
