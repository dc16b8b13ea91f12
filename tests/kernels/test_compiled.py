"""How the compiled core gets to its place."""

import mmap
import os
import runpy
from pathlib import Path

import pytest
from setuptools import Distribution

SETUP = Path(__file__).resolve().parents[2] / "src" / "ir_kernels" / "setup.py"


def test_a_rebuilt_core_replaces_the_old_one_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = runpy.run_path(str(SETUP), run_name="setup")["BuildVariants"](Distribution())
    old = b"old" * 5000
    new = b"newer" * 4000
    built = tmp_path / "built.so"
    place = tmp_path / "core.so"
    built.write_bytes(new)
    place.write_bytes(old)
    replace = os.replace
    seen = []

    def watched(source: str, target: str) -> None:
        seen.append((Path(source).read_bytes(), Path(target).read_bytes()))
        replace(source, target)

    monkeypatch.setattr(os, "replace", watched)
    with place.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
        command.copy_file(str(built), str(place))
        assert mapped[:] == old
    assert seen == [(new, old)]
    assert place.read_bytes() == new
    assert sorted(tmp_path.iterdir()) == [built, place]
