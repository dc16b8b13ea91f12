"""The robot in the picture is made of closed pieces that lie about its collision capsules."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import load_robot
from ir_description.shapes import Capsule
from ir_recorder.report.shapes import Mesh, SurfacePart, lathe, robot_parts
from ir_values.arrays import FloatArray

RIM = 0.13  # m: ends of beams, the counterbalance's pivot aside
ROBOT = load_robot()
PARTS = robot_parts(ROBOT)


def volume(part: SurfacePart) -> float:
    mesh = part.mesh
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    return float(np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6.0)


def outside(points: FloatArray, capsule: Capsule) -> FloatArray:
    axis = capsule.p1 - capsule.p0
    along = np.clip((points - capsule.p0) @ axis / max(float(axis @ axis), 1e-12), 0.0, 1.0)
    nearest = capsule.p0 + along[:, None] * axis
    return np.asarray(np.linalg.norm(points - nearest, axis=1) - capsule.radius)


def test_every_capsule_has_a_piece_and_every_link_one() -> None:
    assert len(PARTS) > len(ROBOT.capsules)
    assert {part.link for part in PARTS} == set(range(len(ROBOT.joint_axis) + 1))


@pytest.mark.parametrize("part", PARTS, ids=lambda part: f"{part.kind} of link {part.link}")
def test_pieces_are_closed_and_seen_from_outside(part: SurfacePart) -> None:
    """By the divergence theorem, from two origins: an open surface would give two volumes."""
    mesh = part.mesh
    moved = SurfacePart(part.link, part.kind, Mesh(mesh.points + 1.0, mesh.normals, mesh.triangles))
    assert volume(part) > 1e-4
    assert volume(moved) == pytest.approx(volume(part), rel=1e-6)
    assert np.isfinite(part.mesh.normals).all()
    np.testing.assert_allclose(np.linalg.norm(part.mesh.normals, axis=1), 1.0, atol=1e-6)
    corners = part.mesh.points[part.mesh.triangles]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shaded = part.mesh.normals[part.mesh.triangles].mean(axis=1)
    area = np.linalg.norm(flat, axis=1)
    assert (np.einsum("ti,ti->t", flat, shaded)[area > 1e-9] > 0.0).all()


@pytest.mark.parametrize("capsule", ROBOT.capsules, ids=lambda capsule: capsule.name)
def test_pieces_lie_within_the_capsules_but_for_their_rims(capsule: Capsule) -> None:
    index = list(ROBOT.capsules).index(capsule)
    own = [c for c in ROBOT.capsules if c.link == capsule.link]
    excess = np.min([outside(PARTS[index].mesh.points, c) for c in own], axis=0)
    assert excess.max() < RIM


def test_a_turned_profile_has_the_volume_of_its_cone() -> None:
    cone = lathe(np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 3.0)]))
    assert volume(SurfacePart(0, "link", cone)) == pytest.approx(np.pi, rel=0.02)
