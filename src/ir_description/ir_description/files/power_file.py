"""Power data as files: the figures of a controller, fitted parameters, marks of confidence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from ir_description.robot import (
    CENTRES,
    USUAL_LINK,
    ControllerMode,
    DcLink,
    EnergyShare,
    MeasuredPower,
    PlcBit,
    PowerData,
    PowerParameters,
    RestRow,
    RestTable,
    parameter_unit,
    without_table,
)
from ir_values.arrays import FloatArray
from ir_values.errors import DescriptionError, InvalidValueError, RobotFileError, UnknownNameError
from ir_values.extensions import Registry
from ir_values.files import inside, is_path, read_regular_file, text_of
from ir_values.yaml_items import Item, Table, read_items
from ir_values.yaml_tree import Node, Scalar, parse_yaml

# The confidence mark of each figure of a robot or power file, by its place.


def marks_of(node: Node) -> dict[str, str]:
    """Return H, M or L by place: "drives.friction_viscous_nms_rad", "links.link_2.mass_kg",
    "modes.HIBERNATION.controller_w". Entries of lists go by their name.
    """
    return {place: _text(figure, "confidence") for place, figure in _figures(node, "")}


ESTIMATE = "estimate"
"""The source of a figure that a rule estimated from others: only its order is known."""


def estimates_of(node: Node) -> frozenset[str]:
    """The places of the figures of a tree whose source is ESTIMATE."""
    return frozenset(
        place for place, figure in _figures(node, "") if _text(figure, "source") == ESTIMATE
    )


def _figures(node: Node, place: str) -> Iterator[tuple[str, Node]]:
    """Every figure of a tree with its place."""
    content = node.content
    if isinstance(content, list):
        for i, element in enumerate(content):
            yield from _figures(element, f"{place}.{_text(element, 'name') or i}")
    elif isinstance(content, dict):
        if _text(node, "confidence") and "value" in content:
            yield place, node
            return
        for key, entry in content.items():
            yield from _figures(entry.node, f"{place}.{key}" if place else key)


def _text(node: Node, key: str) -> str:
    """The text under a key of a mapping, "" where there is none."""
    content = node.content
    if not isinstance(content, dict) or key not in content:
        return ""
    value = content[key].node.content
    return value.text if isinstance(value, Scalar) else ""


# A figure of a robot or power file: its value with its source and confidence.

CONFIDENCES = ("H", "M", "L")


def figure(item: Item) -> Item:
    """Return the value of a figure: a mapping of value, source, confidence and perhaps a note."""
    table = item.table(("value", "source", "confidence"), ("note",))
    table["source"].text()
    table["confidence"].choice(CONFIDENCES)
    if "note" in table:
        table["note"].text(400)
    return table["value"]


FORMAT = "ir_description/power/1"
_RESTS_MAX = 500


def power_from_yaml(text: str, source: str = "<text>") -> PowerData:
    """Return the power data a text describes; errors name file and line."""
    return power_of(read_items(text, source, RobotFileError))


def power_of(root: Item) -> PowerData:
    """Return the power data of a document, or of a mapping in one."""
    top = root.table(
        (
            "format",
            "name",
            "modes",
            "operate_manual_profienergy_id",
            "drives_and_brake_release_w",
            "motors_to_brakes_s",
            "dc_link",
            "plc",
            "wake_on_lan",
            "table_2_w",
            "table_1_percent",
        ),
        ("table_2_robot", "rests"),
    )
    top["format"].choice((FORMAT,))
    modes = tuple(_mode(item) for item in top["modes"].list(1, 20))
    names = tuple(mode.name for mode in modes)
    timers = top["motors_to_brakes_s"].table(("in_program", "in_command"))
    plc = top["plc"].table(("inputs", "outputs"))
    wake = top["wake_on_lan"].table(("packet_bytes", "ports", "secure_on_bytes"))
    with root.blamed():
        return PowerData(
            name=top["name"].name(),
            modes=modes,
            operate_manual_pe_mode_id=figure(top["operate_manual_profienergy_id"]).integer(0, 255),
            drives_and_brake_release=figure(top["drives_and_brake_release_w"]).number(0, 1e5, "W"),
            motors_to_brakes_in_program=figure(timers["in_program"]).number(0, 1e6, "s"),
            motors_to_brakes_in_command=figure(timers["in_command"]).number(0, 1e6, "s"),
            dc_link=dc_link(top["dc_link"]),
            plc_inputs=tuple(_bit(item) for item in plc["inputs"].list(0, 8)),
            plc_outputs=tuple(_bit(item) for item in plc["outputs"].list(0, 8)),
            wake_on_lan_ports=tuple(item.integer(1, 65535) for item in wake["ports"].list(1, 8)),
            table_2=tuple(_table_2_row(item, names) for item in top["table_2_w"].list(0, 100)),
            table_1=tuple(_table_1_row(item) for item in top["table_1_percent"].list(0, 100)),
            table_2_robot=top["table_2_robot"].name() if "table_2_robot" in top else "",
            rest_table=_rest_table(top["rests"], names) if "rests" in top else None,
            marks=marks_of(root.node),
        )


def _rest_table(item: Item, modes: tuple[str, ...]) -> RestTable:
    """Measured rests: every row has the same modes."""
    rows = [entry.table(("posture_deg", "load_kg", "watts")) for entry in item.list(1, _RESTS_MAX)]
    known = [name for name in modes if name in rows[0]["watts"].table((), modes)]
    if not known:
        rows[0]["watts"].fail(f"names no mode: known are {', '.join(modes)}")
    return RestTable(tuple(known), tuple(_rest_row(row, known) for row in rows))


def _rest_row(row: Table, modes: Sequence[str]) -> RestRow:
    angles = row["posture_deg"].list(1, 20)
    watts = row["watts"].table(tuple(modes))
    return RestRow(
        tuple(float(np.radians(angle.number(-3600.0, 3600.0, "deg"))) for angle in angles),
        row["load_kg"].number(0.0, 1e4, "kg"),
        tuple(watts[mode].number(0.0, 1e5, "W") for mode in modes),
    )


def _mode(item: Item) -> ControllerMode:
    table = item.table(
        (
            "name",
            "controller_w",
            "enter_s",
            "leave_s",
            "minimum_stay_s",
            "time_min_pause_s",
            "profienergy_id",
        )
    )
    return ControllerMode(
        name=table["name"].name(),
        pe_mode_id=figure(table["profienergy_id"]).integer(0, 255),
        controller_watts=figure(table["controller_w"]).number(0, 1e5, "W"),
        time_to_pause=_seconds(table, "enter_s"),
        regular_time_to_operate=_seconds(table, "leave_s"),
        minimum_stay=_seconds(table, "minimum_stay_s"),
        time_min_pause=_seconds(table, "time_min_pause_s"),
    )


def _seconds(table: Table, key: str) -> float:
    return figure(table[key]).number(0, 1e6, "s")


def dc_link(item: Item) -> DcLink:
    """The drives' bus."""
    table = item.table(
        ("capacitance_f", "voltage_v", "chopper_on_v", "chopper_off_v", "brake_resistor_ohm"),
        ("discharge_s",),
    )
    discharge = None
    if "discharge_s" in table:
        discharge = figure(table["discharge_s"]).number(0, 1e6, "s", above=True)
    with item.blamed():
        return DcLink(
            capacitance=figure(table["capacitance_f"]).number(0, 10, "F", above=True),
            voltage=figure(table["voltage_v"]).number(0, 1e5, "V", above=True),
            chopper_on=figure(table["chopper_on_v"]).number(0, 1e5, "V", above=True),
            chopper_off=figure(table["chopper_off_v"]).number(0, 1e5, "V", above=True),
            brake_resistor=figure(table["brake_resistor_ohm"]).number(0, 1e6, "ohm", above=True),
            discharge=discharge,
        )


def _bit(item: Item) -> PlcBit:
    table = item.table(("bit", "name", "meaning"), ("excludes",))
    excludes = table["excludes"].list(0, 8) if "excludes" in table else []
    return PlcBit(
        bit=table["bit"].integer(0, 7),
        name=table["name"].name(),
        meaning=table["meaning"].text(),
        excludes=tuple(other.name() for other in excludes),
    )


def _table_2_row(item: Item, modes: tuple[str, ...]) -> MeasuredPower:
    table = item.table(("payload_kg", "mode", "value"))
    return MeasuredPower(
        payload=table["payload_kg"].number(0, 1e4, "kg"),
        mode=table["mode"].choice(modes),
        watts=table["value"].number(0, 1e6, "W"),
    )


def _table_1_row(item: Item) -> EnergyShare:
    table = item.table(("consumer", "value"))
    return EnergyShare(
        consumer=table["consumer"].name(), percent=table["value"].number(0, 100, "%")
    )


# Power parameters (`ir_description/power_parameters/1`): what a fit found, with covariance. A file
# names the parameters that it knows; the others stay as the data of its robot and controller have
# them.

PARAMETERS_FORMAT = "ir_description/power_parameters/1"
_DIGITS = ".9g"
_BIG = 1e12
_ROWS = 10_000


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
    top["format"].choice((PARAMETERS_FORMAT,))
    if "source" in top:
        top["source"].text(400)
    with root.blamed():
        start = data_sheet(top["robot"].name(), top["controller"].name())
    rows = top["parameters"]
    if any(_row_name(entry).partition(".")[0] in CENTRES for entry in rows.list(0, _ROWS)):
        start = start.with_centres(np.zeros(len(CENTRES) * len(start.joints)))
    mean, deviation, sources = _given(rows, start)
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
            centres=start.centres,
        )


def _row_name(entry: Item) -> str:
    """The name of a row, "" where it has none that is a text."""
    return _text(entry.node, "name")


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
    lines = [f"format: {PARAMETERS_FORMAT}", f"name: {parameters.name}"]
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


# The controller of a robot file: a bundled table, one in a file beside it, one written out, or
# none. Without a table: its watts while the motors are on and its DC link, as far as known.

_POWER = files("ir_description") / "data" / "power"
NONE = "none"
BYTES_MAX = 1_000_000


def _made_table(name: str, value: Any) -> Traversable:
    """The file of a table that an entry point names."""
    if not isinstance(value, Traversable):
        raise InvalidValueError("must be the path of a table of power figures (.yaml)")
    return value


CONTROLLERS: Registry[Traversable] = Registry(
    "ir_description.controllers",
    {
        entry.name.removesuffix(".yaml"): entry
        for entry in sorted(_POWER.iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".yaml")
    },
    _made_table,
)


def bundled_controllers() -> tuple[str, ...]:
    """Names of the tables that come with the project or with an installed package."""
    return tuple(CONTROLLERS)


@cache
def bundled_controller(name: str) -> PowerData:
    """The bundled table of that name; the same object for the same name."""
    return power_from_yaml(*_table(name))


def _table(name: str) -> tuple[str, str]:
    """Text and name of a table's file. Raises UnknownNameError, RobotFileError."""
    if name not in CONTROLLERS:
        raise UnknownNameError("controller", name, CONTROLLERS)
    try:
        path = CONTROLLERS[name]
        return path.read_text(encoding="utf-8"), path.name
    except (DescriptionError, OSError, UnicodeDecodeError) as error:
        raise RobotFileError(name, 0, f"the table can't be read: {error}") from error


def read_controller(item: Item, folder: Path | None) -> PowerData:
    """The power figures that a robot file names, or holds."""
    if not item.is_scalar():
        return power_of(item) if item.holds("format") else _without_table(item)
    name = item.text()
    if name == NONE:
        return without_table()
    with item.blamed():
        if not is_path(name):
            return bundled_controller(name)
        try:
            return power_from_yaml(_text_controller_reader(name, folder), name)
        except RobotFileError as error:
            raise InvalidValueError(str(error)) from error


def controller_document(item: Item, power: PowerData, folder: Path | None) -> Node:
    """What a robot file that needs no other file says of its controller."""
    if item.is_scalar() and is_path(item.text()):
        return parse_yaml(_text_controller_reader(item.text(), folder), power.name, RobotFileError)
    if item.is_scalar() and CONTROLLERS.origin(item.text()):
        return parse_yaml(*_table(item.text()), RobotFileError)
    return item.node


def _text_controller_reader(name: str, folder: Path | None) -> str:
    return text_of(read_regular_file(inside(folder, name), BYTES_MAX), name, RobotFileError)


def _without_table(item: Item) -> PowerData:
    table = item.table((), ("standing_w", "dc_link"))
    watts = figure(table["standing_w"]).number(0, 1e5, "W") if "standing_w" in table else 0.0
    link = dc_link(table["dc_link"]) if "dc_link" in table else USUAL_LINK
    own = marks_of(item.node)
    marks = {"modes.STAND_ON_MOTORS.controller_w": own["standing_w"]} if "standing_w" in own else {}
    return without_table(watts, link, {**own, **marks})
