"""Files stay below their folders, whatever a path says; what is there is replaced only where it is
known.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from ir_values.errors import FileRefusedError
from ir_values.files import ENVIRONMENT, FileRoots


@pytest.fixture
def roots(tmp_path: Path) -> FileRoots:
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "secret").write_text("root:x:0:0")
    return FileRoots.of([tmp_path / "in"])


def test_links_and_dots_lead_nowhere_else(roots: FileRoots, tmp_path: Path) -> None:
    (tmp_path / "in" / "link").symlink_to(tmp_path / "out" / "secret")
    (tmp_path / "in" / "folder").symlink_to(tmp_path / "out")
    for name in ("link", "folder/secret", "../out/secret", "folder/../../out/secret"):
        with pytest.raises(FileRefusedError, match="lies outside") as refused:
            roots.open_to_read(tmp_path / "in" / name)
        assert "root:x" not in str(refused.value)
        with pytest.raises(FileRefusedError, match="lies outside"):
            roots.write(tmp_path / "in" / name, b"x", b"root")
    assert (tmp_path / "out" / "secret").read_text() == "root:x:0:0"


def test_a_link_that_stays_inside_is_followed(roots: FileRoots, tmp_path: Path) -> None:
    (tmp_path / "in" / "a").write_text("a")
    (tmp_path / "in" / "b").symlink_to("a")
    with roots.open_to_read(tmp_path / "in" / "b") as stream:
        assert stream.read() == b"a"


def test_a_folder_with_the_same_beginning_is_another_one(roots: FileRoots, tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    with pytest.raises(FileRefusedError):
        roots.inside(tmp_path / "inside" / "a")


def test_fifos_folders_and_devices_are_refused_without_waiting(
    roots: FileRoots, tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "in" / "pipe")
    for path, allowed in (
        (tmp_path / "in" / "pipe", roots),
        (Path("/dev/zero"), FileRoots((Path("/"),))),
    ):
        with pytest.raises(FileRefusedError, match="not a regular file"):
            allowed.open_to_read(path)
    with pytest.raises((FileRefusedError, IsADirectoryError)):
        roots.write(tmp_path / "in", b"", b"x")


def test_only_a_known_kind_is_replaced(roots: FileRoots, tmp_path: Path) -> None:
    path = tmp_path / "in" / "a"
    roots.write(path, b"KIND one and more")
    with pytest.raises(FileExistsError):
        roots.write(path, b"KIND two")
    with pytest.raises(FileRefusedError, match="another kind"):
        roots.write(path, b"OTHER two", b"OTHER")
    assert path.read_bytes() == b"KIND one and more"
    roots.write(path, b"KIND two", b"KIND")
    assert path.read_bytes() == b"KIND two"


def test_folders_come_from_the_caller_then_the_environment_then_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(ENVIRONMENT, raising=False)
    assert FileRoots.of([""]).folders == (tmp_path.resolve(),)
    monkeypatch.setenv(ENVIRONMENT, f"/usr{os.pathsep}/opt")
    assert FileRoots.of().folders == (Path("/usr"), Path("/opt"))
    assert FileRoots.of(["/etc"]).folders == (Path("/etc"),)


@pytest.mark.parametrize("path", ["a\0b", "~nobody_has_this_name/a"])
def test_what_is_no_path_is_refused(roots: FileRoots, path: str) -> None:
    with pytest.raises(FileRefusedError):
        roots.inside(path)
