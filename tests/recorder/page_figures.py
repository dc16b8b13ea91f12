"""Figures of a page as people read them: the name of each, its value and how far it is rounded."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser

UNITS = {
    "kWh": 3.6e6,
    "Wh": 3600.0,
    "kJ": 1000.0,
    "J": 1.0,
    "W": 1.0,
    "min": 60.0,
    "s": 1.0,
    "mm": 0.001,
    "%": 0.01,
    "kg": 1.0,
    "EUR": 1.0,
}
KINDS = {"kWh": "J", "Wh": "J", "kJ": "J", "min": "s"}
_FIGURE = re.compile(r"(-?\d[\d\s\u202f]*(?:\.\d+)?) ?(kWh|Wh|kJ|J|W|min|s|mm|%|kg|EUR)(?![\w])")
_VOID = ("br", "meta", "link", "input", "wbr", "col", "img")


@dataclass(frozen=True)
class Figure:
    """A value in SI units with half of its last digit; kind: J, W, s, m, %, kg or EUR."""

    name: str
    kind: str
    value: float
    half: float

    def agrees(self, other: Figure) -> bool:
        """Whether one value may be behind both."""
        return abs(self.value - other.value) <= 1.001 * (self.half + other.half)

    def shows(self, value: float) -> bool:
        """Whether it is this value, rounded."""
        return abs(self.value - value) <= 1.001 * self.half + 1e-9 * abs(value)


def plain(page: str) -> str:
    """The page without the elements of its amounts of money."""
    return re.sub(r"<data [^>]*>|</data>", "", page)


def figures_in(words: str, name: str) -> Iterator[Figure]:
    """All figures of a text; of the two ends of an interval the one with the unit."""
    for number, unit in _FIGURE.findall(words):
        digits = re.sub(r"[\s\u202f]", "", number)
        decimals = len(digits.partition(".")[2])
        scale = UNITS[unit]
        kind = KINDS.get(unit, "m" if unit == "mm" else unit)
        half = 0.5 * 10.0**-decimals * scale
        yield Figure(name, kind, float(digits) * scale, half)


@dataclass
class _Cell:
    text: str = ""
    bold: str = ""


@dataclass(eq=False)
class _Reader(HTMLParser):
    """Tiles and tables of a page: each cell by its row's and its column's head."""

    found: list[Figure] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._open: list[tuple[str, str]] = []
        self._heads: list[str] = []
        self._row: list[_Cell] = []
        self._tile: dict[str, str] = {}
        self._caption = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in (*_VOID, "data"):  # data: an amount within its words
            return
        kind = dict(attrs).get("class") or ""
        self._open.append((tag, kind))
        if tag == "table":
            self._heads = []
            self._caption = ""
        if tag in ("th", "td"):
            self._row.append(_Cell())
        if kind == "tile":
            self._tile = {"span": "", "b": "", "small": ""}

    def handle_data(self, data: str) -> None:
        tags = [tag for tag, _ in self._open]
        if any(kind == "tile" for _, kind in self._open) and tags[-1] in self._tile:
            self._tile[tags[-1]] += f"{data} "
        if "caption" in tags:
            self._caption += data
        if self._row and ("td" in tags or "th" in tags):
            if "small" not in tags:
                self._row[-1].text += data
            if "b" in tags:
                self._row[-1].bold += data

    def handle_endtag(self, tag: str) -> None:
        if tag == "data":
            return
        while self._open:
            name, kind = self._open.pop()
            if kind == "tile":
                shown = self._tile
                self.found += figures_in(shown["b"], shown["span"].strip())
            if name == "tr":
                self._end_row()
            if name == tag:
                return

    def _end_row(self) -> None:
        cells = [cell.text.strip() for cell in self._row]
        if not self._heads:
            self._heads = cells
        elif cells:
            of = " a year" if "a year" in self._caption else ""
            for head, cell in zip(self._heads[1:], self._row[1:], strict=False):
                words = cell.bold or cell.text
                self.found += figures_in(words, f"{cells[0]}: {head}{of}")
        self._row = []


def figures_of(page: str) -> list[Figure]:
    """All tiles and cells of tables of a page."""
    reader = _Reader()
    reader.feed(re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL))
    return reader.found


def called(figures: list[Figure], *names: str) -> list[Figure]:
    """Those with one of these names."""
    return [figure for figure in figures if figure.name in names]
