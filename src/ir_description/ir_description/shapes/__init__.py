"""Solids: bodies of a scene, capsules around links, and distances between them."""

from ir_description.shapes.body import KINDS, SIZE_MAX, Body, BodyKind, floor_body
from ir_description.shapes.bounds import overlapping
from ir_description.shapes.capsule import Capsule
from ir_description.shapes.convex_distance import capsule_distance, point_distance

__all__ = [
    "KINDS",
    "SIZE_MAX",
    "Body",
    "BodyKind",
    "Capsule",
    "capsule_distance",
    "floor_body",
    "overlapping",
    "point_distance",
]
