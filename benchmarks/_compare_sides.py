"""A checkout's process that answers requests, and how two answers differ."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

WORKER = Path(__file__).with_name("_compare_worker.py")
CORE = "src/ir_kernels/ir_kernels/_native*.so"


def both_built(before: Path, after: Path) -> str:
    """What is missing before both can be asked, "" for nothing."""
    for root in (before, after):
        if not (root / "src/ir_planner").is_dir():
            return f"{root} is no checkout of this project: src/ir_planner is not there"
        if not any(root.glob(CORE)):
            build = "`python setup.py build_ext --inplace` in src/ir_kernels"
            return f"{root} has no compiled core ({CORE}): run {build}"
    return ""


def environment(root: Path) -> dict[str, str]:
    """The environment in which the packages of a checkout are imported, on one thread."""
    packages = os.pathsep.join(
        str(place) for place in sorted((root.resolve() / "src").glob("ir_*"))
    )
    return os.environ | {
        "PYTHONPATH": packages,
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


class Side:
    """The process of one checkout, with changed variables of its environment; `requests`: group and
    name of each.
    """

    def __init__(self, root: Path, changed: Mapping[str, str] | None = None) -> None:
        self.root = root.resolve()
        self.process = subprocess.Popen(
            [sys.executable, str(WORKER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment(root) | dict(changed or {}),
        )
        first = self._line()
        if Path(first["checkout"]) != self.root:
            raise SystemExit(
                f"{self.root} was to be asked, but the planner is that of {first['checkout']}"
            )
        self.requests: list[list[str]] = first["requests"]

    def __enter__(self) -> Side:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.communicate()

    def ask(self, k: int) -> dict[str, Any]:
        """Answer of request k."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{k}\n")
        self.process.stdin.flush()
        return self._line()

    def _line(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"the process of {self.root} ended with code {self.process.wait()}")
        found: dict[str, Any] = json.loads(line)
        return found


def differences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """`name: before -> after` of everything that is not the same; NaN is the same as NaN."""
    found = []
    for name in dict.fromkeys([*before, *after]):
        old = before.get(name, "missing")
        new = after.get(name, "missing")
        if json.dumps(old) != json.dumps(new):
            found.append(f"{name}: {old} -> {new}")
    return found
