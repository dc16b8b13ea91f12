"""A figure of a robot or power file: its value with its source and confidence."""

from __future__ import annotations

from ir_description.files.items import Item

CONFIDENCES = ("H", "M", "L")


def figure(item: Item) -> Item:
    """Return the value of a figure: a mapping of value, source, confidence and perhaps a note."""
    table = item.table(("value", "source", "confidence"), ("note",))
    table["source"].text()
    table["confidence"].choice(CONFIDENCES)
    if "note" in table:
        table["note"].text(400)
    return table["value"]
