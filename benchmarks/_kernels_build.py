"""Import and build half of `benchmarks/kernels.py`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from _kernels_rows import Row
from _results import Claim, at_most

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "ir_kernels"
IMPORT = (
    "import time, numpy; t = time.perf_counter(); import ir_kernels; print(time.perf_counter() - t)"
)


def import_time() -> float:
    """Seconds that `import ir_kernels` adds to NumPy's, best of seven fresh processes."""
    runs = [
        subprocess.run([sys.executable, "-c", IMPORT], capture_output=True, text=True, check=True)
        for _ in range(7)
    ]
    return min(float(run.stdout) for run in runs)


def build_time() -> float:
    """Seconds for both variants of the extension from scratch."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        subprocess.run(
            [
                sys.executable,
                "setup.py",
                "-q",
                "build_ext",
                "-b",
                f"{folder}/lib",
                "-t",
                f"{folder}/temp",
            ],
            cwd=PACKAGE,
            capture_output=True,
            check=True,
        )
        return time.perf_counter() - begin


def measure(build: bool) -> tuple[list[Row], list[Claim]]:
    """Rows and claims of this half; the build only where it is asked for."""
    loading = import_time() * 1e3
    rows = [Row("import, after NumPy", "", loading, "ms")]
    claims = [at_most("import", loading, "ms", 60.0)]
    if build:
        seconds = build_time()
        rows.append(Row("build of both variants", "", seconds, "s"))
        claims.append(at_most("build", seconds, "s", 90.0))
    return rows, claims
