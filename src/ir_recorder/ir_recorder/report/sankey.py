"""Where the energy goes, as a Sankey diagram: from the mains to the axes' work and back.

Widths are joules: what enters a node leaves it. The same figures stand in a table below.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from textwrap import wrap

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.flows import EnergyFlows, energy_flows
from ir_recorder.report.number_text import share, text, watt_hours
from ir_recorder.report.tables import table

WIDTH = 860.0
TALL = 250.0
GAP = 16.0
BAR = 14.0
_TOP = 26.0
_COLUMNS = (8.0, 240.0, 450.0, 690.0)
_LEAST = 0.002  # share of the mains that is drawn; less is in the table alone
_LINE = 16.0
_WIDEST = 26  # letters of a line between two columns
_SMALL = 0.01  # the same, from which on a narrow bar says its share


@dataclass
class _Node:
    """A bar with its joules; `used_in`, `used_out`: how much of its two sides is taken by flows
    already.
    """

    name: str
    style: str
    column: int
    joules: float
    y: float = 0.0
    used_in: float = field(default=0.0)
    used_out: float = field(default=0.0)


def sankey_section(analysis: Analysis) -> str:
    """Section of the page; "" where no flows were recorded."""
    flows = energy_flows(analysis)
    if flows is None or not flows.known or flows.mains <= 0.0:
        return ""
    over = "of the program" if analysis.steps else "of the recording"
    if analysis.program is not None and analysis.program.unshortened is not None:
        over += " as driven, its pauses shortened"
    hint = (
        f"Energy {over}, {watt_hours(flows.mains)} at the mains. Gross flows: axes that brake "
        "return energy to the DC link, masses that are lowered return it to the axes; both flow "
        "back to the left."
    )
    if flows.split:
        hint += (
            " Lifting follows from posture and load by the data of the robot; friction is "
            "what remains."
        )
    return (
        '<section id="flows"><h2>Where the energy goes</h2>'
        f'<p class="hint">{text(hint)}</p>'
        f'<div class="figure">{sankey(flows)}</div>'
        f"<details><summary>The same as a table</summary>{_table(flows)}</details></section>"
    )


def rows(flows: EnergyFlows) -> list[tuple[str, str, float]]:
    """From, to and joules of each flow."""
    listed = [
        ("mains", "controller and drives at rest", flows.controller),
        ("mains", "tool", flows.tool),
        ("mains", "rectifier loss", flows.rectifier),
        ("mains", "DC link", flows.from_mains),
        ("DC link", "axes", flows.taken),
        ("DC link", "brake resistor", flows.resistor),
        ("DC link", "capacitors", flows.stored),
        *([("DC link", "bleed resistors", flows.bled)] if flows.bled else []),
        ("axes", "back to the DC link", flows.returned),
    ]
    if flows.split:
        listed += [
            ("axes", "losses of motors and inverters", flows.motors),
            ("axes", "friction of gears and bearings", flows.friction),
            ("axes", "lifting", flows.lifted),
            ("lifting", "back to the axes", flows.lowered),
        ]
    return listed


def _table(flows: EnergyFlows) -> str:
    cells = (
        (
            text(f"{source} to {to}"),
            f"<b>{watt_hours(value)}</b><small>{share(value, flows.mains)}</small>",
        )
        for source, to, value in rows(flows)
    )
    return table(("flow", ">energy, and share of the mains"), cells, caption="Energy flows")


def sankey(flows: EnergyFlows) -> str:
    """The diagram as SVG."""
    nodes, links = _graph(flows)
    least = _LEAST * flows.mains
    shown = [node for node in nodes.values() if node.joules > least]
    above = flows.mains - flows.from_mains
    scale = TALL / max(
        flows.mains, nodes["bus"].joules + above, nodes["axes"].joules + flows.resistor
    )
    bottom = _place(shown, scale)
    paths = []
    for source, to, value in links:
        if value <= least:
            continue
        if nodes[source].column < nodes[to].column:
            paths.append(_forward(nodes[source], nodes[to], value, scale))
        else:
            path, bottom = _back(nodes[source], nodes[to], value, scale, bottom)
            paths.append(path)
    bars = [_bar(node, scale, flows.mains) for node in shown]
    label = (
        f"Energy flows of {watt_hours(flows.mains)} from the mains; the table below has the figures"
    )
    return (
        f'<svg class="sankey" id="sankey" viewBox="0 0 {WIDTH:g} {bottom + 8.0:.0f}" role="img" '
        f'aria-label="{text(label)}">{"".join(paths)}{"".join(bars)}</svg>'
    )


def _graph(flows: EnergyFlows) -> tuple[dict[str, _Node], list[tuple[str, str, float]]]:
    """The nodes from top to bottom, and the links between them, backward ones last."""
    lowered = flows.lowered if flows.split else 0.0
    work = flows.friction if flows.split else flows.taken - flows.returned
    nodes = {
        "mains": _Node("mains", "mains", 0, flows.mains),
        "base": _Node("controller and drives at rest", "base", 1, flows.controller),
        "tool": _Node("tool", "tool", 1, flows.tool),
        "rectifier": _Node("rectifier loss", "dissipated", 1, flows.rectifier),
        "bus": _Node("DC link", "bus", 1, flows.from_mains + flows.returned),
        "resistor": _Node("brake resistor", "dissipated", 2, flows.resistor),
        "axes": _Node("axes", "axes", 2, flows.taken + lowered),
        "friction": _Node(
            "friction" if flows.split else "losses and friction", "friction", 3, work
        ),
        "motors": _Node("motors, inverters", "loss", 3, flows.motors if flows.split else 0.0),
        "lifting": _Node("lifting", "lift", 3, flows.lifted if flows.split else 0.0),
    }
    into = {
        "base": flows.controller,
        "tool": flows.tool,
        "rectifier": flows.rectifier,
        "bus": flows.from_mains,
    }
    links = [("mains", name, value) for name, value in into.items()]
    links += [("bus", "resistor", flows.resistor), ("bus", "axes", flows.taken)]
    links += [("axes", name, nodes[name].joules) for name in ("friction", "motors", "lifting")]
    return nodes, [*links, ("axes", "bus", flows.returned), ("lifting", "axes", lowered)]


def _place(nodes: Sequence[_Node], scale: float) -> float:
    """Sets the y of every node, column by column, and returns the lowest edge."""
    bottom = 0.0
    for column in range(len(_COLUMNS)):
        y = _TOP
        for node in (n for n in nodes if n.column == column):
            node.y = y
            y += max(node.joules * scale, 2.0) + GAP * 1.6
        bottom = max(bottom, y - GAP * 1.6)
    return bottom


def _forward(source: _Node, to: _Node, value: float, scale: float) -> str:
    """A ribbon from the right side of a node to the left side of one further right."""
    high = value * scale
    x0 = _COLUMNS[source.column] + BAR
    x1 = _COLUMNS[to.column]
    y0 = source.y + source.used_out
    y1 = to.y + to.used_in
    source.used_out += high
    to.used_in += high
    middle = (x0 + x1) / 2.0
    path = (
        f"M{x0:.1f} {y0:.1f}C{middle:.1f} {y0:.1f} {middle:.1f} {y1:.1f} {x1:.1f} "
        f"{y1:.1f}V{y1 + high:.1f}"
        f"C{middle:.1f} {y1 + high:.1f} {middle:.1f} {y0 + high:.1f} {x0:.1f} {y0 + high:.1f}Z"
    )
    return f'<path class="flow {to.style}" d="{path}">{_title(source.name, to.name, value)}</path>'


def _back(source: _Node, to: _Node, value: float, scale: float, bottom: float) -> tuple[str, float]:
    """A ribbon from the right side of a node below everything to one further left, and the new
    bottom.
    """
    high = value * scale
    x0 = _COLUMNS[source.column] + BAR
    x1 = _COLUMNS[to.column]
    y0 = source.y + source.used_out + high / 2.0
    y1 = to.y + to.used_in + high / 2.0
    source.used_out += high
    to.used_in += high
    under = bottom + GAP + high / 2.0
    r0 = min((under - y0) / 2.0, 46.0)
    r1 = min((under - y1) / 2.0, 46.0)
    path = (
        f"M{x0:.1f} {y0:.1f}{_arc(r0, 1, 1)}V{under - r0:.1f}{_arc(r0, -1, 1)}H{x1:.1f}"
        f"{_arc(r1, -1, -1)}V{y1 + r1:.1f}{_arc(r1, 1, -1)}"
    )
    middle = (x0 + x1) / 2.0
    words = f"back {watt_hours(value)}"
    label = (
        f'<text x="{middle:.1f}" y="{under + 4.0:.1f}" text-anchor="middle">{text(words)}</text>'
    )
    title = _title(source.name, to.name, value)
    drawn = f'<path class="back" stroke-width="{max(high, 1.0):.1f}" d="{path}">{title}</path>'
    return drawn + label, under + max(high / 2.0, 8.0)


def _arc(radius: float, right: int, down: int) -> str:
    """A quarter of a circle, clockwise."""
    return f"a{radius:.1f} {radius:.1f} 0 0 1 {right * radius:.1f} {down * radius:.1f}"


def _bar(node: _Node, scale: float, mains: float) -> str:
    x = _COLUMNS[node.column]
    high = max(node.joules * scale, 2.0)
    energy = watt_hours(node.joules)
    words = f"{energy}, {share(node.joules, mains)}" if math.isfinite(node.joules) else ""
    rect = (
        f'<rect class="{node.style}" x="{x:g}" y="{node.y:.1f}" width="{BAR:g}" '
        f'height="{high:.1f}"/>'
    )
    at = x + BAR + 6.0
    if node.column < len(_COLUMNS) - 1 and high < 2.4 * GAP and node.column:
        own = words if node.joules > _SMALL * mains else energy
        lines = [("", line) for line in wrap(f"{node.name} {own}", _WIDEST)]
    else:
        lines = [(' class="name"', line) for line in wrap(node.name, _WIDEST)]
        lines.append(("", words))
    y = node.y + min(high / 2.0, 60.0) + 5.0 - _LINE * (len(lines) - 1) / 2.0
    said = (
        f'<text x="{at:g}" y="{y + _LINE * k:.1f}"{kind}>{text(line)}</text>'
        for k, (kind, line) in enumerate(lines)
    )
    return rect + "".join(said)


def _title(source: str, to: str, value: float) -> str:
    return f"<title>{text(source)} to {text(to)}: {text(watt_hours(value))}</title>"
