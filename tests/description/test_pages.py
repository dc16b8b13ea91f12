"""docs/cell_format.md and docs/robot_data.md are true to the code and the data."""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import yaml

from ir_description import cell_from_yaml, cell_to_yaml, check_cell
from ir_description.cell import PAUSE_POWER_MODES, ZONE_KINDS
from ir_description.files import cell_reader, program_reader
from ir_description.files import equipment_reader as body_reader
from ir_description.shapes import KINDS

DOCS = Path(__file__).parents[2] / "docs"
DATA = files("ir_description") / "data"
CELL_FORMAT = (DOCS / "cell_format.md").read_text()
ROBOT_DATA = (DOCS / "robot_data.md").read_text()


def test_the_example_of_the_page_is_a_cell_without_findings() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", CELL_FORMAT, re.DOTALL)
    cell = cell_from_yaml(example)
    assert check_cell(cell) == ()
    assert cell_to_yaml(cell_from_yaml(cell_to_yaml(cell))) == cell_to_yaml(cell)


def test_the_page_names_every_word_of_the_format() -> None:
    words = [
        *cell_reader._REQUIRED,
        *cell_reader._OPTIONAL,
        *body_reader.POSE_KEYS,
        *body_reader._ALL_SHAPE_KEYS,
        *program_reader._STEP_KEYS,
        *KINDS,
        *ZONE_KINDS,
        *PAUSE_POWER_MODES,
        cell_reader.FORMAT,
    ]
    missing = [word for word in words if not re.search(rf"`{re.escape(word)}\b", CELL_FORMAT)]
    assert missing == []


def figures(value: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every figure of a data file with its path."""
    if isinstance(value, dict) and {"value", "source", "confidence"} <= set(value):
        yield path, value
    elif isinstance(value, dict):
        for key, entry in value.items():
            yield from figures(entry, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for i, entry in enumerate(value):
            name = entry.get("name", i) if isinstance(entry, dict) else i
            yield from figures(entry, f"{path}.{name}")


@pytest.mark.parametrize("name", ["robots/kr210_r2700_extra.yaml", "power/kr_c4.yaml"])
def test_the_page_shows_every_figure_with_source_and_confidence(name: str) -> None:
    data = yaml.safe_load((DATA / name).read_text())
    rows = [
        f"| `{path}` | {figure['value']} | {figure['source']} | {figure['confidence']} |"
        for path, figure in figures(data)
    ]
    assert len(rows) > 20
    assert [row for row in rows if row not in ROBOT_DATA] == []
