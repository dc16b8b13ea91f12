"""The repository stands alone: no paths of somebody's machine, no package index of somebody's
choice.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# the empty groups keep this file from finding itself
MACHINE_PATH = re.compile(
    r"(?<![\w.$}])/(?:)(work|root|home|farm|Users)/\w|\.py(?:)env/(versions|shims)"
)
INDEX_HOST = re.compile(
    r"py(?:)pi\.org|python(?:)hosted\.org|--(extra-)?(?:)index-url|--trusted-(?:)host|file:/(?:)//"
)


def tracked() -> list[Path]:
    """Text files under version control that are still there."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    return [path for name in listed.stdout.split("\0") if name and (path := ROOT / name).is_file()]


def lines_with(pattern: re.Pattern[str]) -> list[str]:
    found = []
    for path in tracked():
        content = path.read_bytes()
        if b"\0" in content[:8000]:
            continue
        for number, line in enumerate(content.decode("utf-8", errors="replace").splitlines(), 1):
            if pattern.search(line):
                found.append(f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}")
    return found


def test_no_tracked_file_names_a_path_of_one_machine() -> None:
    assert lines_with(MACHINE_PATH) == []


def test_no_tracked_file_names_a_package_index() -> None:
    assert lines_with(INDEX_HOST) == []


@pytest.mark.parametrize(
    ("pattern", "line"),
    [
        (MACHINE_PATH, "see " + "/wo" + "rk/main/x.py"),
        (MACHINE_PATH, "/ro" + "ot/.py" + "env/versions/3.11.7/bin/python"),
        (INDEX_HOST, "pip install --index-" + "url https://example.org"),
    ],
)
def test_the_patterns_find_what_they_are_for(pattern: re.Pattern[str], line: str) -> None:
    assert pattern.search(line)


def test_built_and_written_things_are_ignored() -> None:
    names = [
        ".venv/x",
        "out/demo.mcap",
        "ros_ws/build/x",
        "ros_ws/install/x",
        "ros_ws/log/x",
        "src/ir_kernels/ir_kernels/_n.so",
    ]
    ignored = subprocess.run(
        ["git", "check-ignore", *names], cwd=ROOT, capture_output=True, text=True
    )
    if ignored.returncode == 128:
        pytest.skip("not a git checkout")
    assert ignored.stdout.split() == names
