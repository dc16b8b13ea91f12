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
from functools import cache, cached_property, partial, wraps
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, NamedTuple, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from ir_values.arrays import FloatArray
from ir_values.errors import shown

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")
Refusal = Callable[[str], Exception]
Check = Callable[[Any], bool]
_LISTS = (tuple, list, Sequence)
_ROWS = (Sequence, np.ndarray)
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


@cache
def check_of(kind: Any) -> Check:
    """What says of a value whether it is what an annotation says."""
    origin = get_origin(kind)
    if kind in _NUMBERS:
        return partial(_is_number, _NUMBERS[kind])
    if origin in (Union, UnionType):
        checks = tuple(map(check_of, _alternatives(kind)))
        return lambda value: any(check(value) for check in checks)
    if kind is np.ndarray or origin is np.ndarray:
        return _is_array
    if origin is Mapping:
        names, values = map(check_of, get_args(kind))
        return partial(_is_mapping, names, values)
    if origin in _LISTS:
        first = get_args(kind)[0]
        return partial(_is_list, Sequence if first is str else _ROWS, check_of(first))
    return _of_class(kind) if isinstance(kind, type) else _holds_anything


def _of_class(kind: type) -> Check:
    return lambda value: isinstance(value, kind)


def _holds_anything(value: object) -> bool:
    return True


def _alternatives(kind: Any) -> list[Any]:
    """Those of a union, where ArrayLike is an array of numbers."""
    args = get_args(kind)
    arrays = get_args(ArrayLike)
    if not set(arrays) <= set(args):
        return list(args)
    return [np.ndarray, *(one for one in args if one not in arrays)]


def _is_mapping(of_names: Check, of_values: Check, value: object) -> bool:
    return isinstance(value, Mapping) and all(
        of_names(name) and of_values(each) for name, each in value.items()
    )


def _is_list(listed: Any, of_each: Check, value: object) -> bool:
    if not isinstance(value, listed) or isinstance(value, (str, bytes)):
        return False
    return all(map(of_each, value))


def _is_number(numbers: tuple[type, ...], value: object) -> bool:
    """Whether it is a number, or an array without axes that holds one."""
    number = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    return isinstance(number, numbers) and _is_float(number)


def _is_float(value: Any) -> bool:
    """Whether a number isn't beyond all floats."""
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _is_array(value: object) -> bool:
    if isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        return value.ndim > 0
    if value is None or isinstance(value, (str, bytes, Mapping)) or callable(value):
        return False
    try:
        return np.asarray(value, dtype=np.float64).ndim > 0
    except (TypeError, ValueError, OverflowError):
        return False


def _is_float_array(kind: Any) -> bool:
    """Whether lists are taken for arrays of floats alone, or None."""
    alternatives = _alternatives(kind) if get_origin(kind) in (Union, UnionType) else [kind]
    arrays = [one for one in alternatives if one is np.ndarray or one == FloatArray]
    return bool(arrays) and not any(get_origin(one) in _LISTS for one in alternatives)


def _as_array(value: object) -> object:
    """A list of numbers as the array that it stands for; all else as it is."""
    if not isinstance(value, (list, tuple)):
        return value
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        return value


def described(kind: Any) -> str:
    """An annotation as a sentence says it."""
    origin = get_origin(kind)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(map(described, _alternatives(kind))))
    if origin in _LISTS:
        return "a list"
    if origin is Mapping:
        return "a mapping"
    name = _NAMES.get(origin or kind)
    return name or f"a {getattr(origin or kind, '__name__', kind)}"


class _Argument(NamedTuple):
    """One argument; converted: a list is handed on as the array that it was looked at as, so that
    long ones are converted once.
    """

    name: str
    kind: Any
    check: Check
    converted: bool


class _Arguments:
    """The arguments of one callable; `self` has no annotation."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._call = call

    @cached_property
    def _by_name(self) -> dict[str, _Argument]:
        """Read when it is first called: an annotation may name what is defined later."""
        return {
            name: _Argument(name, kind, check_of(kind), _is_float_array(kind))
            for name, kind in get_type_hints(self._call).items()
        }

    @cached_property
    def _in_order(self) -> list[_Argument | None]:
        """Those that may be given by their place; None without an annotation."""
        return [
            self._by_name.get(one.name)
            for one in inspect.signature(self._call).parameters.values()
            if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)
        ]

    @cached_property
    def of_self(self) -> int:
        """How many of the first ones have no annotation: a call with no others isn't looked at."""
        annotated = (k for k, one in enumerate(self._in_order) if one is not None)
        return next(annotated, len(self._in_order))

    def taken(
        self, args: Sequence[Any], named: dict[str, Any], refusal: Refusal
    ) -> tuple[list[Any], dict[str, Any]]:
        """The arguments as they are handed on, `named` as the same mapping; raises `refusal` of the
        first that doesn't fit.
        """
        by_place = list(args)
        for k, (argument, value) in enumerate(zip(self._in_order, args, strict=False)):
            by_place[k] = _taken(argument, value, refusal)
        by_name = self._by_name
        for name, value in named.items():
            argument = by_name.get(name)
            if argument is not None and type(value) is not argument.kind:
                named[name] = _taken(argument, value, refusal)
        return by_place, named


def _taken(argument: _Argument | None, value: Any, refusal: Refusal) -> Any:
    if argument is None or type(value) is argument.kind:
        return value
    if argument.converted:
        value = _as_array(value)
    if argument.check(value):
        return value
    raise refusal(f"{argument.name} is {shown(value)}: it must be {described(argument.kind)}")


def typed(refusal: Refusal) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorates a callable so that it raises `refusal(sentence)` for an argument of another
    type.
    """

    def decorated(call: Callable[P, R]) -> Callable[P, R]:
        arguments = _Arguments(call)

        @wraps(call)
        def checked(*args: P.args, **named: P.kwargs) -> R:
            if not named and len(args) <= arguments.of_self:
                return call(*args, **named)
            by_place, by_name = arguments.taken(args, named, refusal)
            return call(*by_place, **by_name)

        return checked

    return decorated


def typed_methods(refusal: Refusal) -> Callable[[type[C]], type[C]]:
    """Decorates a class so that its construction and its public methods are `typed`."""

    def decorated(of: type[C]) -> type[C]:
        checked = typed(refusal)
        for name, member in list(vars(of).items()):
            if name.startswith("_") and name != "__init__":
                continue
            if inspect.isfunction(member):
                setattr(of, name, checked(member))
            elif isinstance(member, classmethod):
                setattr(of, name, classmethod(checked(member.__func__)))
        return of

    return decorated
