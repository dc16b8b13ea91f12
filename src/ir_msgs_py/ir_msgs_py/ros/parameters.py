"""Parameters of a node from a frozen settings class: described, with ranges, never half changed.

A change that a range or the class itself refuses is answered with the reason, and the old values
stay. Every request of rclpy's own parameter services is answered, in bounded sentences.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import pairwise
from typing import Any, Generic, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.service_introspection import ServiceIntrospectionState

from ir_msgs_py.ros.rclpy_inside import Convert, CSequence, converter, given_names, lookalike
from ir_msgs_py.ros.serving import ANY, Calls
from ir_values.errors import InvalidValueError, IrError, one_line
from ir_values.settings import Setting, changed, check_settings, setting, tree

PACKAGE = "rcl_interfaces"
Callback = Callable[[Any, Any], Any]


def answer_always(node: Node) -> None:
    """Let every request for parameters of the node be answered; once is enough.

    rclpy converts what comes without a look at it: a type of value that is none raises in its
    callback, and the client waits for ever. A reason repeats the name or the value, however long.
    What can't be set is refused with what was raised, and what comes after it in the request with
    it. Whoever asks for values gets none.
    """
    for service in node.services:
        if service.srv_type.__module__.startswith(PACKAGE) and not hasattr(
            service.callback, "guarded"
        ):
            service.callback = _guarded(service.callback)
            service.srv_type = _bounded_type(service.srv_type)


def _bounded_type(service_type: Any) -> Any:
    """The type of a service that converts no more of a request's entries than tell that they are
    too many: rclpy takes a second for ten thousand, and holds the interpreter meanwhile.

    Requests of all these services begin with the list of their entries.
    """
    metaclass = type(service_type.Request)
    convert = converter(metaclass)
    if convert is None:
        return service_type

    def cut(message: int) -> Any:
        entries = CSequence.from_address(message)
        entries.size = min(entries.size, MOST_ENTRIES + 1)
        return convert(message)

    kept = Convert(cut)
    own = {
        "Request": lookalike(metaclass, kept),
        "kept": kept,
        "__module__": service_type.__module__,
    }
    return type(service_type)(service_type.__name__, (service_type,), own)


def _guarded(callback: Callback) -> Callback:
    def answer(request: Any, response: Any) -> Any:
        if _entries(request) > MOST_ENTRIES:
            return _refused_whole(response)
        try:
            response = callback(request, response)
        except ANY as error:
            response = _refused(request, response, f"{type(error).__name__}: {error}")
        for result in _results(response):
            result.reason = one_line(result.reason)
        return response

    answer.guarded = callback  # type: ignore[attr-defined]
    return answer


def _entries(request: Any) -> int:
    """How many parameters or prefixes a request names."""
    return max(len(getattr(request, name, ())) for name in ("parameters", "names", "prefixes"))


def _refused_whole(response: Any) -> Any:
    """Nothing of the request is done; one result says so for all."""
    reason = f"more than {MOST_ENTRIES} parameters in one request: nothing of it is done"
    refusal = SetParametersResult(successful=False, reason=reason)
    if isinstance(response, SetParameters.Response):
        response.results = [refusal]
    elif isinstance(response, SetParametersAtomically.Response):
        response.result = refusal
    return response


def _refused(request: Any, response: Any, reason: str) -> Any:
    refusal = SetParametersResult(successful=False, reason=reason)
    if isinstance(
        request, SetParameters.Request
    ):  # those before the one that raised have their results
        missing = len(request.parameters) - len(response.results)
        response.results = [*response.results, *[refusal] * missing]
    elif isinstance(request, SetParametersAtomically.Request):
        response.result = refusal
    return response


def _results(response: Any) -> Sequence[Any]:
    if isinstance(response, SetParameters.Response):
        return response.results
    return [response.result] if isinstance(response, SetParametersAtomically.Response) else []


T = TypeVar("T")
_INT64 = 2**63
MOST_ENTRIES = 500
"""Of one request for parameters; rclpy takes 1.5 ms to set one, and the node answers nothing else
meanwhile.
"""
_EVENTS = 100  # of a service that wait for a slow listener


class Parameters(Generic[T]):
    """The parameters of one settings class, its stages included, on a node; `value` is what they
    say now.

    prefix: put before each name ("search."). read_only: all are fixed at the start, also those that
    the class lets change. refuse: asked with the names to be changed, returns the reason why not
    now ("" = go on), for changes that must wait until the robot stands. on_change: called with the
    new settings.

    Raises InvalidValueError when a value that the node was started with is refused.
    """

    def __init__(
        self,
        node: Node,
        settings_class: type[T],
        *,
        prefix: str = "",
        read_only: bool = False,
        refuse: Callable[[tuple[str, ...]], str] = lambda names: "",
        on_change: Callable[[T], None] = lambda settings: None,
    ) -> None:
        self._prefix = prefix
        self._refuse = refuse
        self._on_change = on_change
        defaults = settings_class()
        self._settings = {
            name: replace(each, read_only=read_only or each.read_only)
            for name, each in tree(defaults).items()
        }
        started_with = {
            name: self._declare(node, name, each) for name, each in self._settings.items()
        }
        self._value = changed(defaults, started_with)
        self._check(started_with.items())
        node.add_on_set_parameters_callback(self._answer)
        node.add_post_set_parameters_callback(self._take)
        answer_always(node)

    @property
    def value(self) -> T:
        """The settings in force."""
        return self._value

    def _declare(self, node: Node, name: str, each: Setting) -> Any:
        try:
            parameter = node.declare_parameter(
                self._prefix + name, _default(each), _descriptor(each)
            )
        except InvalidParameterTypeException as error:
            raise InvalidValueError(f"{self._prefix}{name}: {error}") from error
        except InvalidParameterValueException as error:
            raise InvalidValueError(
                f"{self._prefix}{name} must be {each.bounds}: {error}"
            ) from error
        return _typed(each, parameter.value)

    def _mine(self, parameters: Iterable[Parameter]) -> dict[str, Any]:
        mine = {}
        for parameter in parameters:
            name = parameter.name.removeprefix(self._prefix)
            if parameter.name.startswith(self._prefix) and name in self._settings:
                mine[name] = _typed(self._settings[name], parameter.value)
        return mine

    def _check(self, values: Iterable[tuple[str, Any]]) -> None:
        for name, value in values:
            self._settings[name].check(value)

    def _answer(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            changes = self._mine(parameters)
        except InvalidValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if not changes:
            return SetParametersResult(successful=True)
        reason = self._refuse(tuple(changes))
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        try:
            self._check(changes.items())
            changed(self._value, changes)
        except (IrError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _take(self, parameters: list[Parameter]) -> None:
        changes = self._mine(parameters)
        if changes:
            self._value = changed(self._value, changes)
            self._on_change(self._value)


def _descriptor(each: Setting) -> ParameterDescriptor:
    unit = f" [{each.unit}]" if each.unit else ""
    descriptor = ParameterDescriptor(
        description=each.sentence + unit,
        additional_constraints=each.bounds,
        read_only=each.read_only,
        # an integer is taken for a real number, which rclpy refuses where the type is fixed
        dynamic_typing=each.type in (float, tuple[float, ...]),
    )
    bounded = each.minimum is not None or each.maximum is not None
    low = -math.inf if each.minimum is None else each.minimum
    high = math.inf if each.maximum is None else each.maximum
    if bounded and each.type is float:
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    elif bounded and each.type is int:
        ends = (int(max(low, -_INT64)), int(min(high, _INT64 - 1)))
        descriptor.integer_range = [IntegerRange(from_value=ends[0], to_value=ends[1])]
    return descriptor


def _default(each: Setting) -> Any:
    if each.type == tuple[float, ...]:
        return array("d", each.default)
    if isinstance(each.default, tuple):
        if not each.default:
            raise InvalidValueError(
                f"{each.name} is an empty list of texts: ROS can't infer its type"
            )
        return list(each.default)
    return each.default


def _typed(each: Setting, value: Any) -> Any:
    """A parameter's value as the setting has it; InvalidValueError for another type."""
    value = tuple(value) if isinstance(value, (list, array)) else value
    if each.type is float:
        return _real(each.name, value)
    if each.type == tuple[float, ...]:
        return tuple(_real(each.name, element) for element in _elements(each.name, value))
    return value


def _elements(name: str, value: Any) -> tuple[Any, ...]:
    if not isinstance(value, tuple):
        raise InvalidValueError(
            f"{name} is {one_line(str(value), 80)}: it must be a list of numbers"
        )
    return value


def _real(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InvalidValueError(f"{name} is {one_line(str(value), 80)}: it must be a number")
    return float(value)


# What ros2cli's `ros2 service echo` shows.

_INTROSPECTION = {
    "off": ServiceIntrospectionState.OFF,
    "metadata": ServiceIntrospectionState.METADATA,
    "contents": ServiceIntrospectionState.CONTENTS,
}


@dataclass(frozen=True)
class IntrospectionSettings:
    """What every node publishes of its services."""

    service_introspection: str = setting(
        "off",
        "Events of each service on <service>/_service_event, for ros2 service echo: off, metadata "
        "(who asked, and when), or contents (requests and answers too).",
        choices=tuple(_INTROSPECTION),
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


def introspect_services(node: Node) -> None:
    """Declare the parameter of IntrospectionSettings, and let the services of the node that answer
    for this project publish their events as it says. Actions publish none in Jazzy.

    Call it once, when all services are there. Raises InvalidValueError.
    """
    chosen = Parameters(node, IntrospectionSettings).value.service_introspection
    if chosen == "off":
        return
    for service in Calls.of(node).services:
        service.configure_introspection(
            node.get_clock(), QoSProfile(depth=_EVENTS), _INTROSPECTION[chosen]
        )


# Names that no parameter has.


def check_names(node: Node, words: Sequence[str]) -> None:
    """Raise InvalidValueError for a name of the command line `words` that the node does not have.

    Names in files are warned of: a file may hold the parameters of several nodes for all of them.
    """
    unknown = sorted(name for name in given_names(node) if not node.has_parameter(name))
    told = {
        word.partition(":=")[0].rpartition(":")[2]
        for option, word in pairwise(words)
        if option in ("-p", "--param")
    }
    known = sorted(node.get_parameters_by_prefix(""))
    for name in unknown:
        near = get_close_matches(name, known, n=1)
        hint = f": did you mean {near[0]}?" if near else ""
        sentence = f"there is no parameter {one_line(name, 80)!r}{hint}"
        if name in told:
            raise InvalidValueError(sentence)
        node.get_logger().warning(f"{sentence} (in a file of parameters)")
