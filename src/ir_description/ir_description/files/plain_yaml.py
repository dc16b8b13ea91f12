"""Small settings files as plain values. What `yaml_tree` refuses is refused: keys that stand
twice.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ir_description.errors import DescriptionFileError
from ir_description.files.file_access import read_regular_file
from ir_description.files.yaml_tree import parse_yaml

BYTES_MAX = 100_000
"""Size of a settings file."""


def plain_yaml(path: Path) -> Any:
    """What the only document of a file holds. DescriptionFileError with path and line."""
    text = read_regular_file(path, BYTES_MAX).decode("utf-8", "replace")
    parse_yaml(text, str(path), DescriptionFileError)
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError) as error:  # ValueError: 2026-99-99 as a date
        raise DescriptionFileError(str(path), 0, " ".join(str(error).split())[:200]) from error
