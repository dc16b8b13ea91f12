"""Are the answers the same on other processors? The table of docs/laws.md.

    python tools/processors.py [--every N] [--only TEXT] [--row TEXT]... [--tests [PATH]...]

A processor is what libraries take it for: OpenBLAS chooses its kernels by it, NumPy and the C
library their loops, the core its build. Each row makes them choose as on another one, in a process
of its own, and asks the fixed list of requests of benchmarks/compare.py again. Ids and every figure
have to be equal, bit by bit, to those of this processor left alone. A row that this processor can't
run is skipped by name. --tests also runs tests under each row (default: those of the kernels, the
planner, studies and the recorder). Ends with 1 where anything differs or fails.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "benchmarks"))

from compare import Side, differences, environment  # noqa: E402

TESTED = ("tests/kernels", "tests/planner", "tests/studies", "tests/recorder")
SHOWN = 3  # differences of a request
FLAGS = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Row:
    """Variables of the environment, and the flags of /proc/cpuinfo without which it can't run.

    compared: whether its ids have to be equal; the NumPy reference agrees within tolerances.
    """

    name: str
    variables: dict[str, str]
    needs: tuple[str, ...] = ()
    compared: bool = True


def dispatched(*without: str) -> str:
    """Names of what NumPy can choose here beyond its baseline, as far as a name holds a text."""
    from numpy._core import _multiarray_umath as umath

    found = [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__.get(name)]
    return " ".join(name for name in found if any(text in name for text in without))


AVX512 = ("X86_V4", "AVX512")
AVX2 = (*AVX512, "X86_V3", "AVX2", "FMA3", "AVX", "F16C")
ROWS = (
    Row("OpenBLAS Haswell", {"OPENBLAS_CORETYPE": "Haswell"}, ("avx2", "fma")),
    Row("OpenBLAS Zen", {"OPENBLAS_CORETYPE": "Zen"}, ("avx2", "fma")),
    Row("OpenBLAS SkylakeX", {"OPENBLAS_CORETYPE": "SkylakeX"}, ("avx512f",)),
    Row("OpenBLAS Nehalem", {"OPENBLAS_CORETYPE": "Nehalem"}, ("sse4_2",)),
    Row("NumPy without AVX-512", {"NPY_DISABLE_CPU_FEATURES": dispatched(*AVX512)}, ("avx512f",)),
    Row("NumPy without AVX2", {"NPY_DISABLE_CPU_FEATURES": dispatched(*AVX2)}, ("avx2",)),
    Row(
        "C library without FMA and AVX2",
        {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F"},
        ("avx2", "fma"),
    ),
    Row("core native", {"IR_KERNELS": "native"}),
    Row("core baseline", {"IR_KERNELS": "baseline"}),
    Row("two threads", {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}),
    Row(
        "an old processor",
        {
            "OPENBLAS_CORETYPE": "Nehalem",
            "NPY_DISABLE_CPU_FEATURES": dispatched(*AVX2),
            "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
            "IR_KERNELS": "baseline",
        },
        ("avx2", "fma"),
    ),
    Row("core reference", {"IR_KERNELS": "reference"}, compared=False),
)


def lacking(row: Row) -> str:
    """The flags that this processor lacks for a row, with commas."""
    lines = FLAGS.read_text(encoding="utf-8").splitlines() if FLAGS.exists() else []
    flags = next((line.split(":")[1].split() for line in lines if line.startswith("flags")), [])
    return ", ".join(flag for flag in row.needs if flag not in flags)


def asked(numbers: list[int], changed: dict[str, str]) -> list[dict[str, Any]]:
    """The answers to requests of the list, in a process with these variables."""
    with Side(ROOT, changed) as side:
        return [side.ask(k) for k in numbers]


def compared(own: list[dict[str, Any]], other: list[dict[str, Any]]) -> list[str]:
    """Lines about requests whose answers differ."""
    lines = []
    for first, second in zip(own, other, strict=True):
        found = differences(first["answer"], second["answer"])
        if found:
            lines.append(f"    {first['name']}: {len(found)} differ")
            lines += [f"        {text}" for text in found[:SHOWN]]
    return lines


def tests_pass(row: Row, paths: list[str]) -> bool:
    """Whether tests pass under a row; pytest's last line is printed."""
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-m", "not long", "-p", "no:cacheprovider", *paths],
        cwd=ROOT,
        env=environment(ROOT) | row.variables,
        capture_output=True,
        text=True,
        check=False,
    )
    print("    " + "\n    ".join(run.stdout.strip().splitlines()[-1:]), flush=True)
    return run.returncode == 0


def main() -> int:
    """Print the table; 1 where ids differ or tests fail."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--every", type=int, default=1, help="only every N-th request")
    parser.add_argument("--only", default="", help="requests whose group or name contains this")
    parser.add_argument("--row", action="append", default=[], help="rows whose name contains this")
    parser.add_argument("--tests", nargs="*", help="also run these tests under each row")
    given = parser.parse_args()
    paths = list(given.tests or TESTED)
    with Side(ROOT) as side:
        names = side.requests
        numbers = [k for k, words in enumerate(names) if any(given.only in w for w in words)]
        numbers = numbers[:: given.every]
        own = [side.ask(k) for k in numbers]
    print(f"{'processor':32s} {'ids and figures equal':24s} {'tests':8s}")
    failed = False
    for row in ROWS:
        if given.row and not any(text in row.name for text in given.row):
            continue
        lacks = lacking(row)
        if lacks:
            print(f"{row.name:32s} skipped: this processor has no {lacks}", flush=True)
            continue
        lines: list[str] = []
        equal = "within tolerances: tests"
        if row.compared:
            lines = compared(own, asked(numbers, row.variables))
            wrong = sum(line.endswith("differ") for line in lines)
            equal = f"{len(numbers) - wrong} of {len(numbers)}"
        green = tests_pass(row, paths) if given.tests is not None else None
        verdict = "" if green is None else "green" if green else "FAILED"
        print(f"{row.name:32s} {equal:24s} {verdict}", flush=True)
        print("\n".join(lines), end="\n" if lines else "", flush=True)
        failed = failed or bool(lines) or green is False
    return int(failed)


if __name__ == "__main__":
    os.chdir(ROOT)
    sys.exit(main())
