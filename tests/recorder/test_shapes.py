"""Triangles of bodies and capsules are right."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import Body
from ir_description.shapes import Capsule
from ir_recorder.report.shapes import body_mesh, capsule_mesh

BODIES = [
    Body("b", "box", np.eye(4), np.array([0.4, 0.6, 0.8])),
    Body("c", "cylinder", np.eye(4), np.array([0.3, 1.0, 0.0])),
    Body("s", "sphere", np.eye(4), np.array([0.5, 0.0, 0.0])),
    Body("k", "capsule", np.eye(4), np.array([0.2, 0.7, 0.0])),
    Body(
        "m",
        "mesh",
        np.eye(4),
        np.zeros(3),
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    ),
]


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.kind)
def test_triangles_close_around_the_bodys_volume(body: Body) -> None:
    """The divergence theorem: a closed surface seen from outside has the volume of the body."""
    mesh = body_mesh(body)
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    volume = float(np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6.0)
    r = body.size[0]
    length = body.size[1]
    expected = {
        "box": float(np.prod(body.size)),
        "cylinder": np.pi * r**2 * length,
        "sphere": 4 / 3 * np.pi * r**3,
        "capsule": np.pi * r**2 * length + 4 / 3 * np.pi * r**3,
        "mesh": 1 / 6,
    }[body.kind]
    assert volume == pytest.approx(expected, rel=0.04)  # flat faces lie inside a round surface
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-9)


def test_a_capsule_between_two_points_has_its_radius_all_round() -> None:
    capsule = Capsule("c", 1, np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.1, 0.9]), 0.15)
    mesh = capsule_mesh(capsule)
    axis = capsule.p1 - capsule.p0
    along = np.clip((mesh.points - capsule.p0) @ axis / (axis @ axis), 0.0, 1.0)
    distance = np.linalg.norm(mesh.points - (capsule.p0 + along[:, None] * axis), axis=1)
    np.testing.assert_allclose(distance, 0.15, atol=1e-9)
