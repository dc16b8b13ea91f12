"""Obstacles from depth: a point cloud (PLY, PCD, NumPy) or a height map as boxes that contain it.

Space is divided into cubes (voxels). Those that hold a point are joined to boxes, and every box is
widened by the margin: the ball of that radius about each point lies in one of them. So a clearance
that is certified against the boxes holds against every surface that stays within the margin of the
points.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import permutations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ir_description.files.solid_mesh import MISSING
from ir_description.files.solid_reader import SIZE_MAX, UNITS
from ir_description.files.stl_mesh import mesh_path
from ir_values.arrays import FloatArray, IntArray
from ir_values.errors import InvalidValueError, shown
from ir_values.files import read_regular_file
from ir_values.yaml_items import Table

SUFFIXES = (".ply", ".pcd", ".npy")
BYTES_MAX = 100_000_000
POINTS_MAX = 5_000_000
BOXES_MAX = 2_000
"""Boxes of one cloud."""
VOXEL = 0.05
VOXEL_MIN = 0.001
VOXEL_MAX = 1.0
MARGIN_MAX = 1.0
PITCH_MAX = 10.0
ROUNDING = 1e-9
"""Added to every margin [m]: more than all rounding of the places of boxes."""


class SensedPoints(NamedTuple):
    """What a depth sensor saw, in the file's unit: points (N, 3), or heights (R, C) over a grid
    whose sample [r, c] stands at x = c pitch, y = r pitch (NaN where nothing was seen).

    notes: what was left out, a sentence each.
    """

    points: FloatArray | None
    heights: FloatArray | None
    notes: tuple[str, ...]


class CloudBoxes(NamedTuple):
    """Boxes along the cloud's axes: lower and upper corners (B, 3) [m].

    No point of a box is farther than `protrusion` [m] from the cloud, or from what is solid below a
    height map.
    """

    lower: FloatArray
    upper: FloatArray
    protrusion: float
    notes: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """How many boxes, and how much larger than the cloud."""
        return (
            f"{len(self.lower)} boxes, none of which sticks out of the cloud by more than "
            f"{1000.0 * self.protrusion:.3g} mm"
        )


@dataclass(frozen=True)
class CloudSettings:
    """unit: of the file. voxel: edge of the cubes [m]. margin: radius [m] of the ball about each
    point that is kept free of the robot. pitch: distance [m] of a height map's samples, None for
    a cloud. crop: lower and upper corner (2, 3) [m] of what is taken, None for all.
    """

    unit: str
    voxel: float
    margin: float
    pitch: float | None = None
    crop: tuple[tuple[float, ...], tuple[float, ...]] | None = None


class CloudReader:
    """Reads the entries `cloud: scan.ply` of one cell file."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    def read(self, table: Table) -> CloudBoxes:
        """Return the boxes of the cloud that an entry describes. Raises InvalidValueError for an
        entry that makes no sense or a file that may not be read.
        """
        crop = None
        if "crop" in table:
            rows = table["crop"].rows(3, -SIZE_MAX, SIZE_MAX, "m", count=(2, 2))
            if not (rows[0] < rows[1]).all():
                table["crop"].fail("must be the lower corner, then the upper one")
            crop = (tuple(rows[0].tolist()), tuple(rows[1].tolist()))
        settings = CloudSettings(
            unit=table["unit"].choice(tuple(UNITS)),
            voxel=table["voxel"].number(VOXEL_MIN, VOXEL_MAX, "m") if "voxel" in table else VOXEL,
            margin=table["margin"].number(0.0, MARGIN_MAX, "m"),
            pitch=table["pitch"].number(0.0, PITCH_MAX, "m", above=True)
            if "pitch" in table
            else None,
            crop=crop,
        )
        name = table["cloud"].text()
        with table["cloud"].blamed():
            if self._folder is None:
                raise InvalidValueError(
                    "a point cloud can be named only in a cell file, this is a text"
                )
            return cloud_boxes(self._folder, name, settings)


def cloud_boxes(folder: Path, name: str, settings: CloudSettings) -> CloudBoxes:
    """Return the boxes of a file beside the cell file. Raises InvalidValueError."""
    measured = read_cloud(folder, name, heights=settings.pitch is not None)
    scale = UNITS[settings.unit]
    if measured.heights is not None:
        if settings.pitch is None:
            raise InvalidValueError(
                "is a height map of "
                f"{measured.heights.shape[0]} x {measured.heights.shape[1]} samples: "
                "say their distance (pitch: 0.01)"
            )
        if settings.crop is not None:
            raise InvalidValueError("is a height map, which can't be cropped: cut the array")
        low, high, notes = _columns(measured.heights * scale, settings.pitch, settings.voxel)
    else:
        if settings.pitch is not None:
            raise InvalidValueError("is a point cloud, which has no pitch; a height map has one")
        assert measured.points is not None
        points, notes = _taken(measured.points * scale, settings)
        low, high = _voxels(points, settings.voxel)
    return _merged(low, high, settings, (*measured.notes, *notes))


def _taken(points: FloatArray, settings: CloudSettings) -> tuple[FloatArray, tuple[str, ...]]:
    notes = []
    if settings.crop is not None:
        inside = ((points >= settings.crop[0]) & (points <= settings.crop[1])).all(axis=1)
        if not inside.all():
            notes.append(f"{np.count_nonzero(~inside)} points lie outside of the crop: left out")
        points = points[inside]
        if not len(points):
            raise InvalidValueError("has no point inside the crop")
    _check_reach(points, settings.unit)
    return points, tuple(notes)


def _check_reach(points: FloatArray, unit: str) -> None:
    reach = float(np.abs(points).max())
    if reach > SIZE_MAX:
        raise InvalidValueError(
            f"the cloud reaches {reach:g} m in {unit}, must stay within {SIZE_MAX:g} m: "
            "is its unit another, or is a crop missing?"
        )


def _voxels(points: FloatArray, voxel: float) -> tuple[IntArray, IntArray]:
    """Lower and upper corners (V, 3) of the cubes that hold a point, in edges of a cube."""
    low = np.unique(np.floor(points / voxel).astype(np.int64), axis=0)
    return low, low + 1


def _columns(
    heights: FloatArray, pitch: float, voxel: float
) -> tuple[IntArray, IntArray, tuple[str, ...]]:
    """Columns of cubes from the lowest height up to the highest sample above each: their low and
    high corners (C, 3) as numbers of cubes, and notes.

    heights (rows, columns) [m], NaN where nothing was seen; pitch [m] between samples; voxel [m]:
    edge of a cube. A sample stands for the square of one pitch around it.
    """
    seen = np.isfinite(heights)
    row, column = np.nonzero(seen)
    top = heights[seen]
    places = np.stack([column * pitch, row * pitch], axis=1)
    _check_reach(np.column_stack([places, top]), "m")
    first = np.floor((places - pitch / 2.0) / voxel).astype(np.int64)
    last = np.ceil((places + pitch / 2.0) / voxel).astype(np.int64) - 1
    count = int((last - first).max()) + 1
    covered_at_most = len(top) * count * count
    if count > 2 and covered_at_most > POINTS_MAX:
        raise InvalidValueError(
            f"the height map has {covered_at_most} columns of {voxel:g} m, must have at "
            f"most {POINTS_MAX}: take a larger voxel"
        )
    level = np.ceil(top / voxel).astype(np.int64)
    cells = []
    levels = []
    for dx in range(count):
        for dy in range(count):
            cell = first + np.array([dx, dy])
            covered = np.all(cell <= last, axis=1)
            cells.append(cell[covered])
            levels.append(level[covered])

    # several samples may cover a cell: the highest counts
    unique, owner = np.unique(np.concatenate(cells), axis=0, return_inverse=True)
    highest = np.full(len(unique), np.iinfo(np.int64).min)
    np.maximum.at(highest, owner.reshape(-1), np.concatenate(levels))
    bottom = np.floor(top.min() / voxel).astype(np.int64)
    low = np.column_stack([unique, np.full(len(unique), bottom)])
    high = np.column_stack([unique + 1, np.maximum(highest, bottom + 1)])
    unseen = int(np.count_nonzero(~seen))
    notes = (f"{unseen} samples of the height map saw nothing: free space there",) if unseen else ()
    return low, high, notes


def _merged(
    low: IntArray, high: IntArray, settings: CloudSettings, notes: tuple[str, ...]
) -> CloudBoxes:
    """Few boxes whose union is that of the given ones, widened by the margin."""
    joined = [_joined_boxes(low, high, axes) for axes in permutations(range(3))]
    lower, upper = min(joined, key=lambda each: len(each[0]))
    if len(lower) > BOXES_MAX:
        raise InvalidValueError(
            f"the cloud needs {len(lower)} boxes of voxels of {settings.voxel:g} m, must need at "
            f"most {BOXES_MAX}: take a larger voxel"
            + ("" if settings.pitch is not None else ", or crop what is far")
        )
    wide = settings.margin + ROUNDING
    reach = np.sqrt(3.0) * (settings.voxel + wide)
    return CloudBoxes(
        lower=np.asarray(lower * settings.voxel - wide, dtype=np.float64),
        upper=np.asarray(upper * settings.voxel + wide, dtype=np.float64),
        protrusion=float(reach),
        notes=notes,
    )


def _joined_boxes(
    low: IntArray, high: IntArray, axes: tuple[int, ...]
) -> tuple[IntArray, IntArray]:
    """Boxes that touch with a whole side are joined, along one axis after the other."""
    for axis in axes:
        others = [other for other in range(3) if other != axis]
        keys = [low[:, axis], *(side[:, other] for other in others for side in (low, high))]
        order = np.lexsort(keys)
        low = low[order]
        high = high[order]
        same = (low[1:, others] == low[:-1, others]).all(axis=1)
        same &= (high[1:, others] == high[:-1, others]).all(axis=1)
        same &= low[1:, axis] == high[:-1, axis]
        starts = np.flatnonzero(np.concatenate([[True], ~same]))
        ends = np.concatenate([starts[1:], [len(low)]]) - 1
        last = high[ends, axis]
        low = low[starts]
        high = high[starts]
        high[:, axis] = last
    return low, high


# Files


def read_cloud(folder: Path, name: str, *, heights: bool = False) -> SensedPoints:
    """Return what a file beside the cell file holds; nothing outside the folder is opened.

    heights: whether an array (R, 3) is three columns of a height map, not R points. Raises
    InvalidValueError.
    """
    path = mesh_path(folder, name, SUFFIXES)
    content = read_regular_file(path, BYTES_MAX)
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _from_array(content, heights=heights)
    if suffix == ".pcd":
        points, notes = _from_pcd(content)
    else:
        points = _from_ply(content)
        notes = ()
    return _of_points(points, notes)


def _of_points(points: FloatArray, notes: tuple[str, ...] = ()) -> SensedPoints:
    if len(points) > POINTS_MAX:
        raise InvalidValueError(f"has {len(points)} points, must have at most {POINTS_MAX}")
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise InvalidValueError("has no point with three finite coordinates")
    if not finite.all():
        left = np.count_nonzero(~finite)
        notes = (*notes, f"{left} points are not finite (nothing was seen there): left out")
    return SensedPoints(points[finite], None, notes)


def _from_array(content: bytes, *, heights: bool) -> SensedPoints:
    """Points (N, 3), an organised cloud (R, C, 3), or heights (R, C)."""
    try:
        array: Any = np.load(io.BytesIO(content), allow_pickle=False)
    except Exception as error:  # whatever a broken file makes NumPy raise
        raise InvalidValueError(f"is no NumPy array: {shown(str(error), 120)}") from error
    if not (isinstance(array, np.ndarray) and array.dtype.kind in "fiu"):
        raise InvalidValueError("must be one NumPy array of numbers")
    values = array.astype(np.float64)
    columns = heights and values.ndim == 2
    if values.ndim in (2, 3) and values.shape[-1] == 3 and values.size and not columns:
        return _of_points(values.reshape(-1, 3))
    if values.ndim != 2 or min(values.shape) < 2:
        raise InvalidValueError(
            f"has the shape {values.shape}, must be points (N, 3), an organised cloud (R, C, 3) "
            "or heights (R, C) of at least 2 x 2 samples"
        )
    if values.size > POINTS_MAX:
        raise InvalidValueError(f"has {values.size} samples, must have at most {POINTS_MAX}")
    if not np.isfinite(values).any():
        raise InvalidValueError("has no finite height")
    if np.isposinf(values).any():
        raise InvalidValueError("has an infinite height: NaN is where nothing was seen")
    return SensedPoints(None, values, ())


def _from_ply(content: bytes) -> FloatArray:
    if find_spec("trimesh") is None:
        raise InvalidValueError(f"a .ply file {MISSING}")
    import trimesh

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded: Any = trimesh.load(io.BytesIO(content), file_type="ply", process=False)
    except Exception as error:  # of trimesh, of any kind
        raise InvalidValueError(f"the PLY can't be read: {shown(str(error), 120)}") from error
    if len(getattr(loaded, "faces", ())):
        raise InvalidValueError(
            f"has {len(loaded.faces)} faces: it is a mesh, whose faces a cloud would lose; "
            "save it as .stl, .obj or .glb and name it as mesh:"
        )
    points = np.asarray(getattr(loaded, "vertices", np.zeros((0, 3))), dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InvalidValueError("the PLY has no vertices with x, y and z")
    return points


_PCD_TYPES = {
    ("F", "4"): "<f4",
    ("F", "8"): "<f8",
    ("I", "1"): "<i1",
    ("I", "2"): "<i2",
    ("I", "4"): "<i4",
    ("I", "8"): "<i8",
    ("U", "1"): "<u1",
    ("U", "2"): "<u2",
    ("U", "4"): "<u4",
    ("U", "8"): "<u8",
}
_PCD_HEADER_MAX = 4096
_PCD_COUNT_MAX = 4096
_NO_VIEWPOINT = ["0", "0", "0", "1", "0", "0", "0"]


def _from_pcd(content: bytes) -> tuple[FloatArray, tuple[str, ...]]:
    """Points (N, 3) of a PCD file of version 0.6 or 0.7, in its three encodings."""
    header, body = _pcd_header(content)
    record = _pcd_record(header)
    try:
        count = int(header["POINTS"][0] if "POINTS" in header else header["WIDTH"][0])
    except (KeyError, ValueError) as error:
        raise InvalidValueError("the PCD doesn't say how many POINTS it has") from error
    if not 1 <= count <= POINTS_MAX:
        raise InvalidValueError(f"the PCD has {count} points, must have 1 to {POINTS_MAX}")
    encoding = header["DATA"][0].lower()
    if encoding == "ascii":
        points = _pcd_ascii(body, record, count)
    elif encoding == "binary":
        _check_bytes(len(body), record.itemsize * count)
        points = _coordinates(np.frombuffer(body, record, count))
    elif encoding == "binary_compressed":
        points = _pcd_compressed(body, record, count)
    else:
        raise InvalidValueError(f"the PCD's DATA is {shown(encoding)}")
    viewpoint = header.get("VIEWPOINT", _NO_VIEWPOINT)
    moved = [float(one) for one in viewpoint] != [float(one) for one in _NO_VIEWPOINT]
    note = "the PCD's VIEWPOINT is not applied: the points are taken as they stand in the file"
    return points, (note,) if moved else ()


def _pcd_header(content: bytes) -> tuple[dict[str, list[str]], bytes]:
    header: dict[str, list[str]] = {}
    at = 0
    while at < min(len(content), _PCD_HEADER_MAX):
        end = content.find(b"\n", at)
        if end < 0:
            break
        words = content[at:end].decode("ascii", errors="replace").split()
        at = end + 1
        if not words or words[0].startswith("#"):
            continue
        if len(words) < 2:
            raise InvalidValueError(f"the PCD's line {shown(words[0])} has no value")
        header[words[0].upper()] = words[1:]
        if words[0].upper() == "DATA":
            _check_viewpoint(header)
            return header, content[at:]
    raise InvalidValueError("has no PCD header that ends with DATA")


def _check_viewpoint(header: dict[str, list[str]]) -> None:
    viewpoint = header.get("VIEWPOINT", _NO_VIEWPOINT)
    try:
        numbers = [float(one) for one in viewpoint]
    except ValueError as error:
        raise InvalidValueError("the PCD's VIEWPOINT must be seven numbers") from error
    if len(numbers) != 7:
        raise InvalidValueError("the PCD's VIEWPOINT must be seven numbers")


def _pcd_record(header: dict[str, list[str]]) -> np.dtype[Any]:
    """One point, as its fields say."""
    names = [name.lower() for name in header.get("FIELDS", [])]
    sizes = header.get("SIZE", [])
    kinds = [kind.upper() for kind in header.get("TYPE", [])]
    counts = header.get("COUNT", ["1"] * len(names))
    if not (len(names) == len(sizes) == len(kinds) == len(counts)):
        raise InvalidValueError("the PCD's FIELDS, SIZE, TYPE and COUNT differ in their number")
    for axis in "xyz":
        if names.count(axis) != 1:
            raise InvalidValueError(f"the PCD has {names.count(axis)} fields {axis}, must have one")
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for place, (name, size, kind, many) in enumerate(zip(names, sizes, kinds, counts, strict=True)):
        if (kind, size) not in _PCD_TYPES:
            raise InvalidValueError(f"the PCD's field {shown(name)} has TYPE {kind}, SIZE {size}")
        if not (many.isdigit() and 1 <= int(many) <= _PCD_COUNT_MAX):
            raise InvalidValueError(f"the PCD's field {shown(name)} has COUNT {shown(many)}")
        if name in "xyz" and many != "1":
            raise InvalidValueError(f"the PCD's field {name} has COUNT {many}, must have 1")
        key = name if name in ("x", "y", "z") else f"other {place}"
        fields.append((key, _PCD_TYPES[kind, size], (int(many),)))
    return np.dtype(fields)


def _coordinates(records: Any) -> FloatArray:
    axes = [records[axis].reshape(-1).astype(np.float64) for axis in ("x", "y", "z")]
    return np.stack(axes, axis=1)


def _check_bytes(there: int, needed: int) -> None:
    if there < needed:
        raise InvalidValueError(
            f"the PCD has {there} bytes of points, its header says {needed}: was it cut?"
        )


def _pcd_ascii(body: bytes, record: np.dtype[Any], count: int) -> FloatArray:
    lines = [line for line in body.splitlines() if line.strip()]
    if len(lines) != count:
        raise InvalidValueError(
            f"the PCD has {len(lines)} lines of points, its header says {count}"
        )
    widths = [int(np.prod(record[name].shape)) for name in record.names or ()]
    starts = dict(zip(record.names or (), np.cumsum([0, *widths[:-1]]).tolist(), strict=True))
    points = np.empty((count, 3))
    for number, line in enumerate(lines):
        words = line.split()
        if len(words) != sum(widths):
            raise InvalidValueError(
                f"point {number + 1} of the PCD has {len(words)} numbers, its fields {sum(widths)}"
            )
        try:
            points[number] = [float(words[starts[axis]]) for axis in "xyz"]
        except ValueError as error:
            raise InvalidValueError(f"point {number + 1} of the PCD is no number") from error
    return points


def _pcd_compressed(body: bytes, record: np.dtype[Any], count: int) -> FloatArray:
    """LZF of all x, then all y and so on."""
    _check_bytes(len(body), 8)
    packed, size = (int(number) for number in np.frombuffer(body, "<u4", 2))
    if size != record.itemsize * count:
        raise InvalidValueError(
            f"the PCD unpacks to {size} bytes, its header says {record.itemsize * count}"
        )
    _check_bytes(len(body) - 8, packed)
    data = _unpacked(body[8 : 8 + packed], size)
    at = 0
    found: dict[str, FloatArray] = {}
    for name in record.names or ():
        field = record[name]
        if name in ("x", "y", "z"):
            found[name] = np.frombuffer(data, field.base, count, at).astype(np.float64)
        at += field.itemsize * count
    return np.stack([found[axis] for axis in ("x", "y", "z")], axis=1)


def _unpacked(data: bytes, size: int) -> bytes:
    """LZF: runs of literal bytes, and copies of what came before. Raises InvalidValueError."""
    found = bytearray()
    at = 0
    try:
        while at < len(data):
            control = data[at]
            at += 1
            if control < 32:
                found += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            start = len(found) - ((control & 31) << 8) - data[at] - 1
            at += 1
            if start < 0 or len(found) > size:
                break
            for place in range(start, start + length + 2):
                found.append(found[place])
    except IndexError:
        pass
    if len(found) != size:
        raise InvalidValueError("the PCD's compressed points are damaged")
    return bytes(found)
