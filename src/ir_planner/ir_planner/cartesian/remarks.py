"""What whoever drives a path should know of its speed."""

from collections.abc import Iterator

from ir_msgs_py.cartesian import CartesianPath
from ir_planner.cartesian.best import DrivenPath

_REACHED = 0.999  # of a speed


def remarks(path: CartesianPath, found: DrivenPath) -> Iterator[tuple[str, str]]:
    """Names and texts of remarks: T1 slows the tool, ramps are long, or the speed isn't reached."""
    if found.slower < 1.0:
        yield "t1", f"{found.slower * path.tool_speed:.4g} m/s, so that the flange keeps 250 mm/s"
    if found.longer:
        yield "speed", f"the axes need long ramps: the tool keeps its speed {_kept_between(found)}"
    asked = found.slower * max(part.tool_speed or path.tool_speed for part in path.segments)
    top = max(float(stroke.law.last.max()) for stroke in found.sent.strokes)
    if top < _REACHED * asked:
        yield (
            "speed",
            f"the path is too short for {asked:.4g} m/s: the tool moves at {top:.4g} m/s at most",
        )


def _kept_between(found: DrivenPath) -> str:
    """Where the tool keeps its speed."""
    where = [
        f"from {stroke.curve.begin + begin:.3f} to {stroke.curve.begin + end:.3f} m"
        for stroke in found.sent.strokes
        for begin, end, even in zip(
            stroke.law.places[:-1], stroke.law.places[1:], stroke.law.even, strict=True
        )
        if even
    ]
    return ", ".join(where) or "nowhere"
