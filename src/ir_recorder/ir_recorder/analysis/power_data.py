"""The figures of controller and DC link that a recording was made with, not those of this
installation.
"""

from __future__ import annotations

from dataclasses import replace

import yaml

from ir_description import DescriptionError, PowerData, load_power_data
from ir_description.files import power_from_yaml
from ir_description.robot import DcLink
from ir_msgs_py.errors import InvalidValueError
from ir_recorder.format import contents
from ir_recorder.read.recording import Recording

_PLANT = {  # of a plant file's dc_link
    "voltage": "mains_v",
    "capacitance": "capacitance_f",
    "chopper_on": "chopper_on_v",
    "chopper_off": "chopper_off_v",
}


def recorded_power_data(recording: Recording) -> tuple[PowerData, str]:
    """The attached data of the controller, and a sentence where they can't be read; else the
    bundled ones.
    """
    if not recording.power_yaml:
        return load_power_data(), ""
    try:
        return power_from_yaml(recording.power_yaml, contents.POWER), ""
    except (DescriptionError, InvalidValueError) as error:
        return load_power_data(), f"the attached {contents.POWER} can't be read: {error}"


def recorded_link(recording: Recording, data: PowerData) -> DcLink:
    """The DC link of the simulated plant where one is recorded, whose mains may have another
    voltage; else that of the data.
    """
    try:
        page = yaml.safe_load(recording.plant_yaml) if recording.plant_yaml else {}
        figures = page.get("dc_link", {})
        return replace(
            data.dc_link,
            **{name: float(figures[key]) for name, key in _PLANT.items() if key in figures},
        )
    except (yaml.YAMLError, AttributeError, TypeError, ValueError, InvalidValueError):
        return data.dc_link
