"""Two robots driven by real nodes, judged by Coal from the joint states that were recorded."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

sys.path.append(str(File(__file__).parents[2] / "benchmarks"))  # the judge of the benchmark

from _robots_judge import Judge, Path

from ir_description import load_robot_cells

pytestmark = pytest.mark.long  # two drivers and two runners in real time want a quiet machine

PATIENCE = 3600.0  # s; it takes a minute where it is alone
MARGIN = 0.02  # m: S_m
OFF = 0.002  # m that the tools of both are off their paths, on the nominal plant
LOOK = 0.005  # s: 1 cm of the tools
ROBOTS = ("left", "right")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> File:
    """Run the demonstration of two robots once."""
    folder = tmp_path_factory.mktemp("robots")
    words = ["demo", "--cell", "two_robots", "--plant", "nominal", "--cycles", "2"]
    command = [sys.executable, "-m", "ir_cli.main", *words, "--output", str(folder)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE, env=dict(os.environ), check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def stamp(content: Any) -> float:
    return float(content.header.stamp.sec) + 1e-9 * float(content.header.stamp.nanosec)


def path_of(robot: str, folder: File) -> Path:
    times = []
    q = []
    loads = [(0.0, "")]
    joints = f"/{robot}/joint_states"
    steps = f"/{robot}/ir_program_runner/program_state"
    with (folder / "demo.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, content in reader.iter_decoded_messages([joints, steps]):
            if channel.topic == joints:
                times.append(stamp(content))
                q.append(list(content.position))
            else:
                loads.append((stamp(content), content.movement.load))
    order = np.argsort(times)
    return Path(np.array(times)[order], np.array(q)[order], sorted(loads))


def test_the_robots_keep_apart_by_their_recorded_joint_values(folder: File) -> None:
    cells = load_robot_cells("two_robots")
    assert cells is not None
    judge = Judge((cells.cells[0], cells.cells[1]))
    paths = [path_of(robot, folder) for robot in ROBOTS]
    assert np.ptp(paths[0].q, axis=0).max() > 1.0  # they move
    assert judge.least_recorded(paths, MARGIN, LOOK)[0] >= MARGIN - OFF


def test_the_page_has_every_robot_and_all_together(folder: File) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "all together" in page
    assert "zone_1" in page
    for robot in ROBOTS:
        assert f'<a href="{robot}.html">' in page
        assert (folder / f"{robot}.html").is_file()
