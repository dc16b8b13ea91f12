"""Cells drawn at random: a part that is moved from stand to stand, signals, pauses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import yaml

from ir_description import Cell, cell_from_yaml
from ir_msgs_py.modes import REST_MODES

Number = Callable[[float, float], float]
_STANDS = (3, 5)  # at least, fewer than
_NAMES = ("door.open", "part-ready", "part_ready", "WAIT", "a-name-that-is-longer-than-24-letters")
_MODES = ("", "AUTO", *REST_MODES)
_REACH = (1.75, 2.05)  # m from the robot's axis
_ABOVE = 0.3  # m, of a station over its stand


def drawn_text(seed: int) -> str:
    """The cell file of a seed."""
    rng = np.random.default_rng((29, seed))

    number = partial(_number, rng)
    count = int(rng.integers(*_STANDS))
    first = number(-150.0, -100.0)
    stands = []
    for k in range(count):
        bearing = first + k * 260.0 / count + number(-10.0, 10.0)
        away = number(*_REACH)
        high = number(0.4, 0.7)
        x, y = (round(float(away * f(np.radians(bearing))), 4) for f in (np.cos, np.sin))
        stands.append(
            {
                "name": f"stand_{k}",
                "pose": {"xyz": [x, y, 0], "abc_deg": [round(float(bearing), 3), 0, 0]},
                "zone": {"kind": "OPEN", "size": [0.6, 0.6, high], "xyz": [0, 0, high / 2]},
                "bodies": [
                    {"name": f"box_{k}", "kind": "box", "size": [0.6, 0.6, high]}
                    | {"xyz": [0, 0, high / 2]}
                ],
                "stations": [
                    {
                        "name": f"at_{k}",
                        "pose": {"xyz": [0, 0, round(high + _ABOVE, 4)], "abc_deg": [0, 90, 0]},
                        "approach_distance": 0.2,
                    }
                ],
            }
        )
    mass = number(20.0, 120.0)
    heavy = mass * rng.uniform(0.01, 0.03)
    signals = [{"name": "grip"}, *({"name": name} for name in _NAMES)]
    numbers = rng.choice(np.arange(1, 4000), 2 * len(signals), replace=False).tolist()
    for k, signal in enumerate(signals):
        if rng.random() < 0.6:
            signal |= {"output": numbers[2 * k], "input": numbers[2 * k + 1]}
    drawn = {
        "format": "ir_cell/1",
        "name": f"drawn_{seed}",
        "robot": "kr210_r2700_extra",
        "park_deg": [0, -125, 120, 0, 80, 0],
        "tool": {
            "name": "gripper",
            "mass": mass,
            "com": [number(0.1, 0.3), number(-0.05, 0.05), number(-0.05, 0.05)],
            "inertia": [round(float(heavy * one), 4) for one in (2.0, 1.5, 1.7, 0.2, -0.1, 0.15)],
            "watts_always": number(0.0, 100.0),
            "watts_drive_bus": number(0.0, 100.0),
            "capsules": [
                {"name": "t_bar", "p0": [0.1, -0.1, 0], "p1": [0.1, 0.1, 0], "radius": 0.08}
            ],
        },
        "tcp": {"xyz": [0.4, number(-0.02, 0.02), 0], "abc_deg": [0, 0, number(-30.0, 30.0)]},
        "parts": [_part(number)],
        "equipment": stands,
        "signals": signals,
        "program": _program(rng, count, number),
    }
    return str(yaml.safe_dump(drawn, sort_keys=False, allow_unicode=True))


def drawn_cell(seed: int) -> Cell:
    """The cell of a seed."""
    return cell_from_yaml(drawn_text(seed), f"drawn_{seed}.yaml")


def _number(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 3)


def _part(number: Number) -> dict[str, object]:
    return {
        "name": "blank",
        "mass": number(5.0, 60.0),
        "com": [0, 0, number(-0.03, 0.03)],
        "inertia_box": [0.1, 0.2, 0.15],
        "capsules": [{"name": "held", "p0": [0, -0.03, 0], "p1": [0, 0.03, 0], "radius": 0.05}],
        "bodies": [{"name": "lying", "kind": "sphere", "radius": 0.05}],
        "grasp": {"xyz": [0, 0, 0]},
        "station": "at_0",
    }


def _program(rng: np.random.Generator, count: int, number: Number) -> list[dict[str, object]]:
    stops = [f"at_{k}" for k in rng.permutation(np.arange(1, count))]
    steps: list[dict[str, object]] = [
        {"posture": "home", "set_signals": [_NAMES[0]]},
        {"station": "at_0", "attach": "blank", "dwell": number(0.2, 1.0)},
    ]
    for k, name in enumerate(stops):
        signal = _NAMES[1 + k % (len(_NAMES) - 1)]
        steps.append({"station": name, "set_signals": [signal], "dwell": number(0.0, 2.0)})
        if rng.random() < 0.5:
            steps.append(_pause(rng, number))
    steps[-1 if "station" in steps[-1] else -2]["detach"] = "blank"
    steps += [{"posture": "home", "set_signals": [f"not {_NAMES[0]}"]}, _pause(rng, number)]
    return [*steps, {"posture": "park"}]


def _pause(rng: np.random.Generator, number: Number) -> dict[str, object]:
    mode = str(rng.choice(_MODES))
    least = 300.0 if "HIBERNATION" in mode else 40.0
    pause: dict[str, object] = {"pause": number(least, 3.0 * least)}
    return pause | ({"power_mode": mode} if mode else {})
