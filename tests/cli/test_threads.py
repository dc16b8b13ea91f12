"""Linear algebra computes with one thread in our commands and in tests, unless somebody chose."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PROGRAM = (
    "import os; from ir_cli.main import main; import numpy, scipy.linalg; "
    "numpy.ones((400, 400)) @ numpy.ones((400, 400)); "
    "print(os.environ['OPENBLAS_NUM_THREADS'], len(os.listdir('/proc/self/task')))"
)
NAMES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@pytest.mark.skipif(not os.path.isdir("/proc/self/task"), reason="no list of threads here")
@pytest.mark.parametrize(("chosen", "threads"), [("", "1 1"), ("2", "2")])
def test_one_thread_unless_somebody_chose(chosen: str, threads: str) -> None:
    words = {name: value for name, value in os.environ.items() if name not in NAMES}
    if chosen:
        words["OPENBLAS_NUM_THREADS"] = chosen
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=words, capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith(threads)
