"""Signed distances of capsules on a chain from the bodies of a scene and from each other, with
witnesses.
"""

import numpy as np

from ir_kernels.geometry import Geometry
from ir_kernels.reference import chain
from ir_kernels.reference.segments import Witness, segment_body, segment_segment
from ir_values.arrays import BoolArray, FloatArray, IntArray


def poses(model: Geometry, q: FloatArray) -> FloatArray:
    """(N, n + 1, 4, 4): link poses at q (N, n)."""
    arm = model.chain
    return chain.link_poses(arm.joint_origin, arm.joint_axis, arm.base_pose, q, arm.first_slides)


def ends(model: Geometry, link_poses: FloatArray) -> FloatArray:
    """(N, C, 2, 3): ends of the capsules' axes in the world."""
    frames = link_poses[:, model.capsules.link]
    turned = np.einsum("ncab,ceb->ncea", frames[..., :3, :3], model.capsules.ends)
    result: FloatArray = turned + frames[:, :, None, :3, 3]
    return result


def _inflate(axis: Witness, radius_a: FloatArray, radius_b: FloatArray) -> Witness:
    """Witness of the surfaces, from that of the axes."""
    return Witness(
        axis.distance - radius_a - radius_b,
        axis.on_segment - radius_a[:, None] * axis.normal,
        axis.on_body + radius_b[:, None] * axis.normal,
        axis.normal,
    )


def witnesses(model: Geometry, segments: FloatArray, pairs: IntArray) -> Witness:
    """One pair (N,) of each row of capsule ends (N, C, 2, 3) [m]: distance, points on both
    surfaces, normal from b to a. Pairs with bodies come first, then those of the arm with itself.
    """
    count = len(pairs)
    on_first = np.empty((count, 3))
    on_second = np.empty((count, 3))
    normal = np.empty((count, 3))
    result = Witness(np.empty(count), on_first, on_second, normal)

    # all rows of one body together: -1 stands for pairs of two capsules
    outside = len(model.environment)
    is_outside = pairs < outside
    body_of = np.full(count, -1)
    body_of[is_outside] = model.environment[pairs[is_outside], 1]
    for body in np.unique(body_of):
        rows = np.flatnonzero(body_of == body)
        if body < 0:
            found = _between_capsules(model, segments[rows], pairs[rows] - outside)
        else:
            capsule = model.environment[pairs[rows], 0]
            found = _to_body(model, segments[rows, capsule], capsule, body)
        for whole, part in zip(result, found, strict=True):
            whole[rows] = part
    return result


def _between_capsules(model: Geometry, segments: FloatArray, pairs: IntArray) -> Witness:
    """Of pairs (N,) among the arm's own, at capsule ends (N, C, 2, 3)."""
    radius = model.capsules.radius
    a, b = model.self_pairs[pairs].T
    rows = np.arange(len(pairs))
    first = segments[rows, a]
    second = segments[rows, b]
    found = segment_segment(first[:, 0], first[:, 1], second[:, 0], second[:, 1])
    return _inflate(found, radius[a], radius[b])


def _to_body(model: Geometry, ends: FloatArray, capsule: IntArray, body: int) -> Witness:
    """Of capsules (N,) with ends (N, 2, 3) and one body: computed in the body's frame, where its
    shape is simple.
    """
    rotation = model.scene.pose[body, :3, :3]
    origin = model.scene.pose[body, :3, 3]
    local = (ends - origin) @ rotation
    hull = model.scene.hulls[body]
    kind = int(model.scene.kind[body])
    found = segment_body(local[:, 0], local[:, 1], kind, model.scene.size[body], hull)
    found = _inflate(found, model.capsules.radius[capsule], np.zeros(len(capsule)))
    return Witness(
        found.distance,
        found.on_segment @ rotation.T + origin,
        found.on_body @ rotation.T + origin,
        found.normal @ rotation.T,
    )


def distances(model: Geometry, segments: FloatArray) -> FloatArray:
    """(N, Z): signed distances [m] of all pairs, from capsule ends (N, C, 2, 3); penetration is
    negative.
    """
    rows = len(segments)
    count = len(model.environment) + len(model.self_pairs)
    pairs = np.tile(np.arange(count), rows)
    found = witnesses(model, np.repeat(segments, count, axis=0), pairs)
    return found.distance.reshape(rows, count)


def nearest(distance: FloatArray, offset: FloatArray) -> IntArray:
    """(N,): the pair with the least distance - offset (Z,), the first of equals; -1 where there is
    none.
    """
    if distance.shape[1] == 0:
        return np.full(len(distance), -1)
    excess = distance - offset
    best = excess.argmin(axis=1)
    return np.where(np.isinf(excess[np.arange(len(best)), best]), -1, best)


def gradient(
    model: Geometry, link_poses: FloatArray, found: Witness, pairs: IntArray
) -> FloatArray:
    """(N, n): derivative of the distance of `pairs` (N,) by q [m/rad], along the witness' normal
    (Danskin's theorem).
    """
    outside = len(model.environment)
    own = pairs >= outside
    both = np.concatenate([model.environment * [1, 0], model.self_pairs])[pairs]
    link = model.capsules.link[both]
    axis = model.chain.joint_axis
    slides = model.chain.first_slides
    second = np.where(own, link[:, 1], 0)
    moved_a = chain.point_jacobian(axis, link_poses, found.on_segment, link[:, 0], slides)
    moved_b = chain.point_jacobian(axis, link_poses, found.on_body, second, slides)
    result: FloatArray = np.einsum("na,nai->ni", found.normal, moved_a - moved_b)
    return result


def is_free(distance: FloatArray, threshold: FloatArray) -> BoolArray:
    """(N,): whether all distances (N, Z) exceed their threshold (Z,)."""
    return np.asarray((distance > threshold).all(axis=1))
