"""Reads and writes power parameters (`ir_description/power_parameters/1`): what a fit found, with
covariance.

A file names the parameters that it knows; the others stay as the data of its robot and controller
have them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ir_description.errors import RobotFileError
from ir_description.files.items import Item, read_items
from ir_description.robot import PowerParameters, parameter_unit
from ir_msgs_py.arrays import FloatArray

FORMAT = "ir_description/power_parameters/1"
_DIGITS = ".9g"
_BIG = 1e12


def power_parameters_from_yaml(
    text: str, source: str, data_sheet: Callable[[str, str], PowerParameters]
) -> PowerParameters:
    """Return the parameters a text describes; data_sheet: those of a robot and a controller by
    their names. Errors name file and line.
    """
    root = read_items(text, source, RobotFileError)
    top = root.table(
        ("format", "name", "robot", "controller", "parameters"), ("source", "correlation")
    )
    top["format"].choice((FORMAT,))
    if "source" in top:
        top["source"].text(400)
    with root.blamed():
        start = data_sheet(top["robot"].name(), top["controller"].name())
    mean, deviation, sources = _given(top["parameters"], start)
    correlation = _correlation(top.get("correlation"), start.names)
    with root.blamed():
        return PowerParameters(
            name=top["name"].name(),
            robot=start.robot,
            controller=start.controller,
            joints=start.joints,
            modes=start.modes,
            mean=mean,
            covariance=correlation * np.outer(deviation, deviation),
            sources=sources,
        )


def _given(item: Item, start: PowerParameters) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Mean, deviations and sources with those that the file names, else those of `start`."""
    mean = start.mean.copy()
    deviation = start.deviation.copy()
    sources = list(start.sources)
    known: list[str] = []
    for entry in item.list(0, len(start.names)):
        row = entry.table(("name", "value", "deviation"), ("unit", "source"))
        name = row["name"].choice(start.names)
        if name in known:
            row["name"].fail(f"is {name}, which is named twice")
        if "unit" in row and row["unit"].text() != parameter_unit(name):
            row["unit"].fail(f"must be {parameter_unit(name)}, which is the unit of {name}")
        known.append(name)
        k = start.index(name)
        mean[k] = row["value"].number(-_BIG, _BIG)
        deviation[k] = row["deviation"].number(0.0, _BIG)
        sources[k] = row["source"].text() if "source" in row else "file"
    return mean, deviation, tuple(sources)


def power_parameters_to_yaml(parameters: PowerParameters, source: str = "") -> str:
    """Return the file of all parameters; source: one line that says where they are from."""
    lines = [f"format: {FORMAT}", f"name: {parameters.name}"]
    lines += [f"robot: {parameters.robot}", f"controller: {parameters.controller}"]
    lines += [f"source: {_quoted(source)}"] if source else []
    lines.append("parameters:")
    rows = zip(
        parameters.names, parameters.mean, parameters.deviation, parameters.sources, strict=True
    )
    for name, value, deviation, origin in rows:
        unit = parameter_unit(name)
        shown = f", unit: {_quoted(unit)}" if unit else ""
        lines.append(
            f"  - {{name: {name}, value: "
            f"{value:{_DIGITS}}, deviation: {deviation:{_DIGITS}}{shown}, source: {_quoted(origin)}}}"  # noqa: E501
        )
    return "\n".join([*lines, *_correlation_lines(parameters)]) + "\n"


def _correlation(item: Item | None, names: tuple[str, ...]) -> FloatArray:
    """Correlation (P, P) of a list of names and the rows below the diagonal; 0 where nothing is
    said.
    """
    matrix = np.eye(len(names))
    if item is None:
        return matrix
    table = item.table(("names", "below"))
    listed = [entry.choice(names) for entry in table["names"].list(2, len(names))]
    if len(set(listed)) < len(listed):
        table["names"].fail("names a parameter twice")
    places = [names.index(name) for name in listed]
    rows = table["below"].list(len(places) - 1, len(places) - 1)
    for k, row in enumerate(rows, start=1):
        values = row.numbers(k, -1.0, 1.0)
        matrix[places[k], places[:k]] = values
        matrix[places[:k], places[k]] = values
    return matrix


def _correlation_lines(parameters: PowerParameters) -> list[str]:
    deviation = parameters.deviation
    scale = np.where(deviation > 0.0, deviation, 1.0)
    matrix = parameters.covariance / np.outer(scale, scale)
    off = np.abs(matrix - np.diag(np.diag(matrix))).max(axis=1)
    places = np.flatnonzero(off > 1e-9)
    if len(places) < 2:
        return []
    names = ", ".join(parameters.names[k] for k in places)
    lines = ["correlation:", f"  names: [{names}]", "  below: # the diagonal, row by row"]
    for row in range(1, len(places)):
        values = ", ".join(f"{value:.6g}" for value in matrix[places[row], places[:row]])
        lines.append(f"    - [{values}]")
    return lines


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
