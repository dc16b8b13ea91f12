"""Faces of packages whose names are imported when they are first used (PEP 562), as SciPy's are."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def on_first_use(
    face: dict[str, Any], homes: Mapping[str, tuple[str, ...]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The `__getattr__` and the `__dir__` of a package with the globals `face`, whose names are
    those of the modules `homes`.
    """
    home_of = {name: home for home, names in homes.items() for name in names}

    def imported(name: str) -> Any:
        if name not in home_of:
            raise AttributeError(f"module {face['__name__']!r} has no attribute {name!r}")
        face[name] = getattr(import_module(home_of[name]), name)
        return face[name]

    return imported, lambda: sorted({*face, *home_of})
