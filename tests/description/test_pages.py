"""docs/cell_format.md is true to the code."""

from __future__ import annotations

import re
from pathlib import Path

from ir_description import cell_from_yaml, cell_to_yaml, check_cell
from ir_description.cell import PAUSE_POWER_MODES, ZONE_KINDS
from ir_description.files import cell_reader, program_reader
from ir_description.files import equipment_reader as body_reader
from ir_description.shapes import KINDS

DOCS = Path(__file__).parents[2] / "docs"
CELL_FORMAT = (DOCS / "cell_format.md").read_text()


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
