"""Table II and figure 3: power of the modes. A calibration, no evidence."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from _paper_result import CALIBRATED, Experiment, Row, Statement, finished, panels

from ir_description import load_cell, load_power_data
from ir_msgs_py.names import NO_LOAD
from ir_planner.program.rests import mode_watts
from ir_planner.scene import load_text, scene_with

CELL = "open"


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per mode and payload: Table II and the planner's figure."""
    cell = load_cell(CELL)
    power = load_power_data()
    rows = []
    for entry in power.table_2:
        scene = scene_with(cell, load_text(cell) if entry.payload else NO_LOAD, power)
        row = {"payload_kg": entry.payload, "mode": entry.mode, "table_W": entry.watts}
        rows.append(row | {"planner_W": mode_watts(entry.mode, cell.machine_home, scene)})
    return rows


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Largest deviation from the table."""
    off = max(100.0 * abs(row["planner_W"] / row["table_W"] - 1.0) for row in rows)
    says = "the planner's model draws what Table II says"
    nan = float("nan")
    return [
        Statement(
            says, "largest deviation", off, nan, nan, len(rows), "values", "%", verdict=CALIBRATED
        )
    ]


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    return (
        f"The values are met within {statements[0].value:.2g} %, and the watts of controller, "
        "drives and tool were chosen for that. That says that the model can hold these eight "
        "numbers, not that it is right: at other postures, payloads and for the times of "
        "transitions the paper has no figures to hold it against."
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """The eight values."""
    return {
        "Watts at machine home": [
            {
                "payload": f"{row['payload_kg']:g} kg",
                "mode": row["mode"],
                "Table II": f"{row['table_W']:g}",
                "planner": f"{row['planner_W']:.1f}",
            }
            for row in rows
        ]
    }


def draw(rows: Sequence[Row], file: Path) -> None:
    """Bars of both payloads by mode."""
    figure, (axes,) = panels(1, width=6.5, height=3.2)
    modes = list(dict.fromkeys(row["mode"] for row in rows))
    for k, payload in enumerate(sorted({row["payload_kg"] for row in rows})):
        mine = {row["mode"]: row for row in rows if row["payload_kg"] == payload}
        x = np.arange(len(modes)) + 0.4 * k - 0.2
        axes.bar(
            x,
            [mine[mode]["planner_W"] for mode in modes],
            0.36,
            label=f"{payload:g} kg, model",
            alpha=0.7,
        )
        axes.plot(
            x,
            [mine[mode]["table_W"] for mode in modes],
            "k_",
            ms=16,
            label="Table II" if k else None,
        )
    axes.set_xticks(range(len(modes)), [mode.replace("_", " ").lower() for mode in modes])
    axes.set_ylabel("power at the mains [W]")
    axes.legend(fontsize=8)
    finished(figure, file)


EXPERIMENT = Experiment(
    "modes",
    "Table II and figure 3: power of the modes (calibration)",
    "Standing at machine home the robot draws between 735 W on its motors with 155 kg and 15 W "
    "hibernating empty (Table II, which figure 3 shows as a chart).",
    "The planner's model in every mode, with the 155 kg tool and empty (`benchmarks/driver.py` "
    "reads the meter of the simulated robot). Its parameters were fitted to this table: a "
    "calibration, and a test that nothing has changed.",
    measure,
    judge,
    follows,
    tables,
    draw,
    "Power of the modes at machine home: model as bars, Table II as marks.",
    seeded=False,
)
