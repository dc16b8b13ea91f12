"""Ports served by installed packages: known by name, loaded when asked for, refused with the
reason.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from ir_values.errors import DescriptionError, InvalidValueError
from ir_values.extensions import Registry, extension_modules, installed_extensions

Install = Callable[..., None]
GROUP = "ir_planner.searches"


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Installs a package of one module with entry points of a group, as pip would."""

    def install(package: str, source: str, group: str = GROUP, **entries: str) -> None:
        site = tmp_path / package
        info = site / f"{package}-1.2.dist-info"
        info.mkdir(parents=True)
        (site / f"{package}_module.py").write_text(source)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
        lines = [f"{name} = {package}_module:{value}" for name, value in entries.items()]
        (info / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))
        monkeypatch.syspath_prepend(str(site))
        monkeypatch.delitem(sys.modules, f"{package}_module", raising=False)

    return install


def made(name: str, value: Any) -> int:
    if not isinstance(value, int):
        raise InvalidValueError("must be a whole number")
    return value


def registry(**own: int) -> Registry[int]:
    return Registry(GROUP, own, made, reserved=("settings",))


def test_an_installed_name_follows_the_own_ones(install: Install) -> None:
    install("numbers_of_mine", "SEVEN = 7", seven="SEVEN")
    found = registry(nine=9, one=1)
    assert list(found) == ["nine", "one", "seven"]
    assert found["seven"] == 7
    assert (found.origin("seven"), found.origin("one")) == ("numbers_of_mine 1.2", "")
    assert "numbers_of_mine 1.2 (searches: seven)" in installed_extensions()
    assert "numbers_of_mine_module" in extension_modules()


def test_a_package_is_not_imported_by_being_there(install: Install) -> None:
    install("loud", "raise SystemError('imported')", loud="X")
    found = registry(one=1)
    assert "loud" in found
    assert found.get("one") == 1


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("raise SystemError('no way')", "SystemError: no way"),
        ("import nothing_like_it", "ModuleNotFoundError"),
        ("Y = 1", "AttributeError"),
        ("X = 'text'", "must be a whole number"),
    ],
)
def test_what_cannot_be_used_says_why(install: Install, source: str, said: str) -> None:
    install("wrong", source, wrong="X")
    found = registry(one=1)
    with pytest.raises(DescriptionError, match=said) as refused:
        found["wrong"]
    assert "wrong 1.2" in str(refused.value)
    assert said in found.why_not("wrong")
    assert found["one"] == 1


def test_names_of_the_project_are_not_taken(install: Install) -> None:
    install("greedy", "X = 7", one="X", settings="X")
    found = registry(one=1)
    with pytest.warns(RuntimeWarning, match=r"of greedy 1.2 is left out"):
        assert list(found) == ["one"]
    assert found["one"] == 1
    assert found.origin("one") == ""


def test_two_packages_of_one_name_are_both_refused(install: Install) -> None:
    install("first", "X = 1", same="X")
    install("second", "X = 2", same="X")
    with pytest.raises(DescriptionError, match=r"first 1.2 and second 1.2: two packages"):
        registry()["same"]


def test_a_stand_in_refuses_when_it_is_asked(install: Install) -> None:
    install("absent", "", absent="X")
    found = Registry(GROUP, {}, made, stand_in=len)
    assert found["absent"] > 20


def test_an_unknown_name_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        registry()["nobody"]
