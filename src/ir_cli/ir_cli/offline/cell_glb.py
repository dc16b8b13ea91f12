"""A cell's machines as one binary glTF: what a viewer or a CAD program opens."""

from __future__ import annotations

import json
import struct
from typing import Any

from ir_description import Cell
from ir_recorder.report.shapes import body_mesh

_Z_UP = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""Column by column: glTF's y axis points up, the cell's z."""
_FLOAT = 5126
_UINT = 5125
_JSON = 0x4E4F534A
_BIN = 0x004E4942
_MAGIC = 0x46546C67
_VERSION = 2


def cell_glb(cell: Cell) -> bytes:
    """One node per machine, and one below it per body that is there in its state; planes are left
    out.
    """
    nodes: list[dict[str, Any]] = [{"name": cell.name, "matrix": _Z_UP, "children": []}]
    meshes: list[dict[str, Any]] = []
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    binary = bytearray()
    for machine in cell.equipment:
        owner = {
            "name": machine.name,
            "matrix": machine.pose.T.ravel().tolist(),
            "children": list[int](),
        }
        nodes[0]["children"].append(len(nodes))
        nodes.append(owner)
        for body in machine.present_bodies():
            mesh = body_mesh(body)
            if mesh is None:
                continue
            points = mesh.points.astype("<f4")
            corners = mesh.triangles.astype("<u4").ravel()
            for values, kind, shape in ((points, _FLOAT, "VEC3"), (corners, _UINT, "SCALAR")):
                bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
                entry = {
                    "bufferView": len(views),
                    "componentType": kind,
                    "count": len(values),
                    "type": shape,
                }
                accessors.append({**entry, **(bounds if shape == "VEC3" else {})})
                views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
                binary += values.tobytes()
            last = len(accessors) - 1
            meshes.append({"primitives": [{"attributes": {"POSITION": last - 1}, "indices": last}]})
            owner["children"].append(len(nodes))  # type: ignore[attr-defined]
            pose = body.pose.T.ravel().tolist()
            nodes.append({"name": body.name, "matrix": pose, "mesh": len(meshes) - 1})
    for node in nodes:
        if not node.get("children", True):
            del node["children"]
    document: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
    document["nodes"] = nodes
    if meshes:
        document |= {"meshes": meshes, "accessors": accessors, "bufferViews": views}
        document["buffers"] = [{"byteLength": len(binary)}]
    return _container(json.dumps(document, separators=(",", ":")).encode(), bytes(binary))


def _container(text: bytes, binary: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text
    if binary:
        chunks += (
            struct.pack("<II", len(binary), _BIN) + binary
        )  # of four-byte numbers: padded already
    return struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks
