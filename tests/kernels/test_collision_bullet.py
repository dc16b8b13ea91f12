"""Our distances of capsules from meshes against PyBullet's."""

import numpy as np
import pybullet
import pytest
from geometry_cases import AT_ZERO, Body, FloatArray, probe, random_pose

AGREEMENT = 1e-4  # [m] PyBullet iterates in its own units, on shapes with a margin


@pytest.mark.parametrize("seed", range(5))
def test_distances_from_meshes_agree_with_pybullet(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body = Body("mesh", "mesh", random_pose(rng, 0.5), np.zeros(3), rng.normal(0.0, 0.3, (12, 3)))
    client = pybullet.connect(pybullet.DIRECT)
    shape = pybullet.createCollisionShape(
        pybullet.GEOM_MESH, vertices=body.vertices.tolist(), physicsClientId=client
    )
    mesh = place(client, shape, body.pose)
    radius = 0.05
    half = 0.2
    rod = pybullet.createCollisionShape(
        pybullet.GEOM_CAPSULE, radius=radius, height=2.0 * half, physicsClientId=client
    )
    try:
        for _ in range(20):
            pose = random_pose(rng, 2.0)
            end = half * pose[:3, 2]
            ours = probe(pose[:3, 3] - end, pose[:3, 3] + end, radius, body).distances(AT_ZERO)[
                0, 0
            ]
            other = place(client, rod, pose)
            points = pybullet.getClosestPoints(mesh, other, 10.0, physicsClientId=client)
            pybullet.removeBody(other, physicsClientId=client)
            if ours > 0.0:
                assert min(point[8] for point in points) == pytest.approx(ours, abs=AGREEMENT)
    finally:
        pybullet.disconnect(client)


def place(client: int, shape: int, pose: FloatArray) -> int:
    """A fixed body of the shape; its collision margin is part of PyBullet's meshes, so it goes."""
    w = np.sqrt(max(0.0, 1.0 + np.trace(pose[:3, :3]))) / 2.0
    r = pose[:3, :3]
    vector = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (4.0 * w)
    body = pybullet.createMultiBody(
        0.0, shape, -1, pose[:3, 3].tolist(), [*vector.tolist(), float(w)], physicsClientId=client
    )
    pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=client)
    return int(body)
