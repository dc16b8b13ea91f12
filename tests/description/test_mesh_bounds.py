"""Meshes of others: too large, cut, or without triangles; nothing of them is dropped without a
word.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from ir_description.files.making import Meshes
from ir_description.files.solid_mesh import read_solid, triangles_from_obj
from ir_description.files.stl_mesh import triangles_from_stl
from ir_values.arrays import number_of
from ir_values.errors import InvalidValueError

FACET = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def ascii_stl(end: str = "endsolid\n") -> bytes:
    faces = ("".join("vertex {} {} {}\n".format(*CORNERS[k]) for k in face) for face in FACES)
    return ("solid x\n" + "".join(FACET.format(each) for each in faces) + end).encode()


def test_an_ascii_stl_that_was_cut_is_refused() -> None:
    assert len(triangles_from_stl(ascii_stl())) == 4
    assert len(triangles_from_stl(ascii_stl("endsolid x\r\n \n"))) == 4
    with pytest.raises(InvalidValueError, match="was it cut"):
        triangles_from_stl(ascii_stl(""))


def test_an_obj_of_too_many_triangles_is_refused_and_not_cut() -> None:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + ["f 1 2 3"] * 5
    assert len(triangles_from_obj("\n".join(lines).encode(), 5)) == 5
    with pytest.raises(InvalidValueError, match=r"must have 4 to 4; export it coarser"):
        triangles_from_obj("\n".join(lines).encode(), 4)


@pytest.mark.parametrize("name", ["part.x_t", "part.SLDPRT", "part.sat"])
def test_files_of_cad_systems_alone_are_refused_with_the_remedy(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("ISO-10303-21;\n")
    with pytest.raises(InvalidValueError, match=r"as \.stl, \.obj or \.glb"):
        read_solid(tmp_path, name)
    with pytest.raises(InvalidValueError, match=r"as \.stl, \.obj or \.glb"):
        Meshes(tmp_path, None).triangles(name)


def test_a_large_mesh_of_a_link_is_contained_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(1)
    triangles = rng.uniform(-1.0, 1.0, (600, 1, 3)) + rng.uniform(-0.05, 0.05, (600, 3, 3))
    lines = [f"v {p[0]!r} {p[1]!r} {p[2]!r}" for p in triangles.reshape(-1, 3).tolist()]
    lines += [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(len(triangles))]
    (tmp_path / "link.obj").write_text("\n".join(lines))
    monkeypatch.setattr(sys.modules[Meshes.__module__], "TRIANGLES_MAX", 500)
    meshes = Meshes(tmp_path, None)
    slabs, _ = meshes.triangles("link.obj")
    assert "600 triangles are taken as the hulls of 32 slabs" in meshes.notes[0]
    assert {tuple(p) for p in slabs.reshape(-1, 3)} <= {tuple(p) for p in triangles.reshape(-1, 3)}
    low = slabs.reshape(-1, 3).min(axis=0)
    high = slabs.reshape(-1, 3).max(axis=0)
    assert (low <= triangles.reshape(-1, 3).min(axis=0)).all()
    assert (high >= triangles.reshape(-1, 3).max(axis=0)).all()


@pytest.mark.parametrize("text", ["1_000", "２", "0x10", "1,5", "", "one"])
def test_what_only_python_takes_for_a_number_is_none(text: str) -> None:
    with pytest.raises(ValueError, match=r"number|float"):
        number_of(text)
