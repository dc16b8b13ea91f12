"""Files that the report writes."""

from __future__ import annotations

from pathlib import Path

from ir_recorder.errors import RecorderError
from ir_values.errors import FileRefusedError
from ir_values.files import FileRoots


def write_output(path: str | Path, content: bytes, replaces: bytes, roots: FileRoots) -> Path:
    """Writes a file below `roots` and makes its folder; returns its absolute path.

    A file that is there is replaced only where it starts with `replaces`, whole or not at all.
    RecorderError when it can't be written.
    """
    target = Path(path).absolute()
    try:
        roots.inside(target).parent.mkdir(parents=True, exist_ok=True)
        roots.write(target, content, replaces)
    except FileRefusedError as error:
        raise RecorderError(str(error)) from error
    except OSError as error:
        raise RecorderError(f"{target} can't be written: {error.strerror}") from error
    return target
