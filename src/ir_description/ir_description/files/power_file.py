"""Reads a power file (data/power/*.yaml) into PowerData."""

from __future__ import annotations

from ir_description.errors import RobotFileError
from ir_description.files.confidence import marks_of
from ir_description.files.figures import figure
from ir_description.files.items import Item, Table, read_items
from ir_description.robot import (
    ControllerMode,
    DcLink,
    EnergyShare,
    MeasuredPower,
    PlcBit,
    PowerData,
)

FORMAT = "ir_description/power/1"


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
        ("table_2_robot",),
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
            marks=marks_of(root.node),
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
        ("capacitance_f", "voltage_v", "chopper_on_v", "chopper_off_v", "brake_resistor_ohm")
    )
    with item.blamed():
        return DcLink(
            capacitance=figure(table["capacitance_f"]).number(0, 10, "F", above=True),
            voltage=figure(table["voltage_v"]).number(0, 1e5, "V", above=True),
            chopper_on=figure(table["chopper_on_v"]).number(0, 1e5, "V", above=True),
            chopper_off=figure(table["chopper_off_v"]).number(0, 1e5, "V", above=True),
            brake_resistor=figure(table["brake_resistor_ohm"]).number(0, 1e6, "ohm", above=True),
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
