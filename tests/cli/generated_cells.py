"""Small cells as people write them, with what they get wrong: contacts, zones, approaches,
heights.
"""

from __future__ import annotations

from typing import Any

import yaml
from hypothesis import strategies as st

from ir_cli.new_cell import cell_text
from ir_description import Cell, cell_from_yaml, load_robot

ROBOTS = ("kr6_r900_2", "kr210_r2700_extra")
Document = dict[str, Any]


@st.composite
def broken_documents(draw: st.DrawFn) -> Document:
    """A begun cell whose table stands where somebody measured it badly, with a part, in one of two
    sizes.
    """
    name = draw(st.sampled_from(ROBOTS))
    document: Document = yaml.safe_load(cell_text("generated", name, load_robot(name)))
    scale = 1.0 if name == "kr210_r2700_extra" else 0.35
    for machine in document["equipment"]:
        size = machine["bodies"][0]["size"]
        station = machine["stations"][0]
        station["pose"]["xyz"][2] = size[2] + draw(st.sampled_from((0.06, 0.03, 0.012, 0.004)))
        approach = draw(st.sampled_from((None, 0.0, 0.05, 0.15 * scale, 4.0)))
        if approach is None:
            del station["approach_distance"]
        else:
            station["approach_distance"] = approach
        zone = draw(st.sampled_from(("OPEN", "tight", "none")))
        if zone == "tight":  # around the table's foot: contacts would not hold at the station
            machine["zone"] = {"kind": "OPEN", "size": [size[0], size[1], 0.5 * size[2]]}
            machine["zone"]["xyz"] = [0, 0, 0.25 * size[2]]
        elif zone == "OPEN":
            machine["zone"] = "OPEN"
        if draw(st.booleans()):
            hood = {"name": f"{machine['name']}_hood", "kind": "box", "size": [*size[:2], 0.05]}
            hood["xyz"] = [0, 0, size[2] + draw(st.sampled_from((0.3, 1.5))) * (0.4 + scale)]
            machine["bodies"].append(hood)
    document["program"] = [{"station": "pick"}, {"station": "place"}, {"posture": "home"}]
    return document


def cell_of(document: Document) -> Cell:
    """The cell that a file of this content describes."""
    return cell_from_yaml(yaml.safe_dump(document, sort_keys=False))


def pasted(document: Document, subject: str, lines: str) -> None:
    """Put suggested lines where a person would: into the station or the machine of that name."""
    for machine in document["equipment"]:
        for thing in (machine, *machine["stations"]):
            if thing["name"] == subject:
                thing.update(yaml.safe_load(lines))
                return
    raise AssertionError(f"nothing is called {subject}")
