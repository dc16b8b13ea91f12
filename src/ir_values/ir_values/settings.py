"""Settings of a stage: one frozen dataclass whose fields carry default, unit, range and a sentence.

ROS parameters and the tables of the documentation derive from it; a core that never meets ROS reads
the same class. A field may hold the settings of another stage (`stage(...)`), or several by name in
a mapping: then they form a tree, and a setting in it has a dotted name, "genetic.population".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, TypeVar, get_type_hints

from ir_values.errors import InvalidValueError, one_line

T = TypeVar("T")
_KEY = "setting"
_STAGE = "stage"
_SHOWN = 80  # characters of a value that is no choice
SETTING_TYPES = (bool, int, float, str, tuple[float, ...], tuple[str, ...])


@dataclass(frozen=True)
class Setting:
    """What one field promises; minimum and maximum are inclusive and count for each element of a
    tuple.
    """

    name: str
    type: Any
    default: Any
    sentence: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False

    @property
    def bounds(self) -> str:
        """The range as text with its unit, "" where there is none."""
        unit = f" {self.unit}" if self.unit else ""
        if self.choices:
            return ", ".join(self.choices)
        if self.minimum is not None and self.maximum is not None:
            return f"{self.minimum:g} .. {self.maximum:g}{unit}"
        if self.minimum is not None:
            return f"at least {self.minimum:g}{unit}"
        return f"at most {self.maximum:g}{unit}" if self.maximum is not None else ""

    def check(self, value: Any) -> None:
        """Raise InvalidValueError with the value, its bound and the unit."""
        for element in value if isinstance(value, tuple) else (value,):
            if isinstance(element, float) and not math.isfinite(element):
                raise InvalidValueError(f"{self.name} is {element}: it must be finite")
            if self.choices and element not in self.choices:
                shown = one_line(str(element), _SHOWN)
                raise InvalidValueError(f'{self.name} is "{shown}": known are {self.bounds}')
            below = self.minimum is not None and element < self.minimum
            above = self.maximum is not None and element > self.maximum
            if below or above:
                unit = f" {self.unit}" if self.unit else ""
                raise InvalidValueError(
                    f"{self.name} is {element:g}{unit}: it must be {self.bounds}"
                )


def setting(
    default: T,
    sentence: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    read_only: bool = False,
) -> T:
    """Describe a field of a settings class: `timeout: float = setting(2.0, "Longest wait.",
    unit="s")`.
    """
    metadata = {
        "sentence": sentence,
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "choices": choices,
        "read_only": read_only,
    }
    return field(default=default, metadata={_KEY: metadata})


def stage(make: Callable[[], T]) -> T:
    """Describe a field that holds the settings of a stage, or a mapping of such by name; `make`:
    its default.

    The settings of the one stage are named `field.setting`, those in a mapping `key.setting`.
    """
    return field(default_factory=make, metadata={_STAGE: True})


def describe(settings_class: type[Any]) -> tuple[Setting, ...]:
    """The class's own settings, in order; InvalidValueError for a field that no parameter can stand
    for.
    """
    types = get_type_hints(settings_class)
    settings = []
    for each in fields(settings_class):
        where = f"{settings_class.__name__}.{each.name}"
        if _STAGE in each.metadata:
            continue
        if _KEY not in each.metadata or each.default is MISSING:
            raise InvalidValueError(
                f"{where} has no description: use setting(default, sentence, ...)"
            )
        if types[each.name] not in SETTING_TYPES:
            raise InvalidValueError(
                f"{where} is a {types[each.name]}: a parameter is one of {SETTING_TYPES}"
            )
        settings.append(Setting(each.name, types[each.name], each.default, **each.metadata[_KEY]))
    return tuple(settings)


def stages(settings: Any) -> dict[str, Any]:
    """The settings of stages that a settings object holds, by the prefix of their names without its
    dot.
    """
    found: dict[str, Any] = {}
    for each in fields(settings):
        if _STAGE in each.metadata:
            value = getattr(settings, each.name)
            found.update(value if isinstance(value, Mapping) else {each.name: value})
    return found


def tree(settings: Any) -> dict[str, Setting]:
    """All settings of an object and of its stages, by their dotted names; defaults are its
    values.
    """
    found = {
        each.name: replace(each, default=getattr(settings, each.name))
        for each in describe(type(settings))
    }
    for prefix, inner in stages(settings).items():
        found |= {f"{prefix}.{name}": each for name, each in tree(inner).items()}
    return found


def changed(settings: T, values: Mapping[str, Any]) -> T:
    """The settings with other values by their dotted names. Raises what the classes raise for
    them.
    """
    own: dict[str, Any] = {name: value for name, value in values.items() if "." not in name}
    for each in fields(settings):  # type: ignore[arg-type]
        if _STAGE in each.metadata:
            held = getattr(settings, each.name)
            if isinstance(held, Mapping):
                own[each.name] = {
                    key: changed(inner, _inside(key, values)) for key, inner in held.items()
                }
            else:
                own[each.name] = changed(held, _inside(each.name, values))
    return replace(settings, **own)  # type: ignore[type-var]


def _inside(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    head = prefix + "."
    return {
        name.removeprefix(head): value for name, value in values.items() if name.startswith(head)
    }


def check_settings(settings: Any) -> None:
    """Check each value against its range; for the __post_init__ of a settings class."""
    for each in describe(type(settings)):
        each.check(getattr(settings, each.name))


def settings_table(settings: Any, prefix: str = "") -> str:
    """Write the settings, with those of their stages, as a Markdown table for the documentation."""
    rows = ["| Parameter | Default | Unit | Range | Meaning |", "|---|---|---|---|---|"]
    for name, each in tree(settings).items():
        fixed = " Fixed at start." if each.read_only else ""
        default = str(each.default).lower() if isinstance(each.default, bool) else str(each.default)
        rows.append(
            f"| `{prefix}{name}` | {default} | {each.unit} | {each.bounds} | "
            f"{each.sentence}{fixed} |"
        )
    return "\n".join(rows) + "\n"
