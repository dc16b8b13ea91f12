"""tools/extra_interfaces.py: what it builds, in which order, what it refuses; nothing is built."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = "rosidl_default_generators"
MANIFEST = """<package format="3"><name>{name}</name><version>{version}</version>
<buildtool_depend>{generator}</buildtool_depend>{needs}</package>"""


@pytest.fixture
def tool(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    import extra_interfaces

    monkeypatch.delitem(sys.modules, "extra_interfaces")
    return extra_interfaces


def package(
    folder: Path,
    name: str,
    *needs: str,
    version: str = "1.2.3",
    generator: str = GENERATOR,
) -> Path:
    made = folder / "src" / f"of_{name}" / name
    (made / "msg").mkdir(parents=True)
    (made / "msg" / "Thing.msg").write_text("float64 value\n")
    depends = "".join(f"<depend>{need}</depend>" for need in needs)
    text = MANIFEST.format(name=name, version=version, generator=generator, needs=depends)
    (made / "package.xml").write_text(text)
    return made


def test_a_package_comes_after_what_it_needs_and_what_is_there_is_left(
    tool: ModuleType, tmp_path: Path
) -> None:
    package(tmp_path, "top_msgs", "middle_msgs", "base_msgs", "std_msgs", "rclcpp")
    package(tmp_path, "middle_msgs", "base_msgs")
    package(tmp_path, "base_msgs", "geometry_msgs")
    package(tmp_path, "other_msgs")
    package(tmp_path, "of_ros_1_msgs", generator="catkin")
    found = tool.sources(tmp_path)
    assert "of_ros_1_msgs" not in found
    built = [source.name for source in tool.order(["top_msgs", "base_msgs"], found)]
    assert built == ["base_msgs", "middle_msgs", "top_msgs"]


@pytest.mark.parametrize(
    ("needs", "sentence"),
    [
        (("lost_msgs",), "lost_msgs is needed by top_msgs and is not below the folder"),
        (("top_msgs",), "top_msgs needs top_msgs: a circle"),
    ],
)
def test_what_can_t_be_built_is_refused_by_name(
    tool: ModuleType, tmp_path: Path, needs: tuple[str, ...], sentence: str
) -> None:
    package(tmp_path, "top_msgs", *needs)
    with pytest.raises(tool.ExtraError, match=sentence):
        tool.order(["top_msgs"], tool.sources(tmp_path))
    with pytest.raises(tool.ExtraError, match="wanted_msgs was asked for and is not below"):
        tool.order(["wanted_msgs"], tool.sources(tmp_path))


def test_two_of_a_name_and_bad_manifests_are_refused(tool: ModuleType, tmp_path: Path) -> None:
    made = package(tmp_path, "top_msgs")
    package(tmp_path / "again", "top_msgs")
    with pytest.raises(tool.ExtraError, match="top_msgs is there twice"):
        tool.sources(tmp_path)
    (made / "package.xml").write_text(
        MANIFEST.format(name="a b", version="1", generator=GENERATOR, needs="")
    )
    with pytest.raises(tool.ExtraError, match="names 'a b'"):
        tool.sources(tmp_path / "src")
    (made / "package.xml").write_text("<package>")
    with pytest.raises(tool.ExtraError, match=r"package\.xml can't be read"):
        tool.sources(tmp_path / "src")


def test_the_project_is_ours_with_their_interfaces(tool: ModuleType, tmp_path: Path) -> None:
    package(tmp_path, "top_msgs", "std_msgs", "rclcpp", version="5.8.0")
    source = tool.sources(tmp_path)["top_msgs"]
    made = tool.project(source, tmp_path)
    cmake = (made / "CMakeLists.txt").read_text()
    assert "project(top_msgs)" in cmake
    assert "set(interface_packages std_msgs)" in cmake
    build = (made / "pyproject.toml").read_text()
    assert 'name = "top-msgs"' in build
    assert 'version = "5.8.0"' in build
    for text in (cmake, build):
        assert "ir_msgs)" not in text
        assert "ir-msgs" not in text
    assert (made / "msg" / "Thing.msg").read_text() == "float64 value\n"
    assert (made / "pip" / "venv_prefix.cmake").is_file()
