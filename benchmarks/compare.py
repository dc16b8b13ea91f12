"""Do two checkouts give the same answers, and is the second one as fast as the first?

    python benchmarks/compare.py --before CHECKOUT [--after CHECKOUT] [--only TEXT]... [--rounds N]
                                 [--script NAME]... [--quick] [--json FILE]

A fixed list of requests is answered by the planner's core of each checkout, both built, each in a
process of its own. Answers: status, trajectory ids, program id and every figure of the reports, bit
by bit; each difference is listed, and per group by how much the figures of whole answers changed.
Speed: the same request before, after, before, after, N rounds, never at once; the ratio after :
before of the least processor times of a request, and the median of it over the requests of a
group. --script also runs a benchmark of each checkout in turns and compares its times of the same
name.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from _results import Claim, add_ending, at_most, commit, finish

# A checkout's process that answers requests, and how two answers differ.

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


# What differs, as changes: rounding that differs leads descents into neighbouring optima.

FIGURES = ("duration", "energy", "movement_cost")


def changes(before: dict[str, Any], after: dict[str, Any]) -> dict[str, float]:
    """Relative change of the figures of a whole answer that both checkouts have."""
    found = {}
    for name in FIGURES:
        old = before.get(name)
        new = after.get(name)
        if isinstance(old, float) and isinstance(new, float) and old > 0.0:
            found[name] = new / old - 1.0
    return found


def show_changes(rows: list[dict[str, Any]]) -> None:
    """A line per group: the median and the ends of each figure's relative change."""
    print("\nchange in %: median, least, largest")
    for group in dict.fromkeys(row["group"] for row in rows):
        told = []
        for name in FIGURES:
            seen = [
                row["changes"][name]
                for row in rows
                if row["group"] == group and name in row["changes"]
            ]
            if seen:
                middle, least, most = 100.0 * np.quantile(seen, [0.5, 0.0, 1.0])
                told.append(f"{name} {middle:+.3f} {least:+.2f} {most:+.2f}")
        if told:
            print(f"{group:32s} {'; '.join(told)}")


# Benchmarks of two checkouts run in turns, and the ratio of their times of the same name.

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def script_rows(name: str, before: Path, after: Path, rounds: int) -> list[dict[str, Any]]:
    """A row with the ratio of the least times for every time that both checkouts' benchmark
    reports.
    """
    least: tuple[dict[str, float], dict[str, float]] = ({}, {})
    for _ in range(rounds):
        for place, root in enumerate((before, after)):
            for key, value in _times(name, root).items():
                least[place][key] = min(value, least[place].get(key, value))
    shared = [key for key in least[0] if least[1].get(key, 0.0) > 0.0 and least[0][key] > 0.0]
    rows = []
    for key in shared:
        old, new = (1e3 * side[key] for side in least)
        rows.append(
            {"group": f"{name}: {key}", "before_ms": old, "after_ms": new, "ratio": new / old}
        )
        print(f"{name}: {key:70s} {old:12.5g} {new:12.5g} ms  ratio {new / old:.3f}", flush=True)
    if not shared:
        print(f"benchmark {name}: the checkouts report no time of the same name")
    return rows


def _times(name: str, root: Path) -> dict[str, float]:
    """Times [s] by name that a checkout's benchmark reports in its quick form."""
    script = root.resolve() / "benchmarks" / f"{name}.py"
    if not script.exists():
        raise SystemExit(f"{root} has no benchmark {name}")
    short = ["--quick"] if '"--quick"' in script.read_text() else ["--seeds", "1"]
    with tempfile.TemporaryDirectory() as place:
        result = Path(place) / "result.json"
        command = [sys.executable, str(script), *short, "--json", str(result)]
        subprocess.run(
            command, env=environment(root), cwd=root, check=True, stdout=subprocess.DEVNULL
        )
        return times_in(json.loads(result.read_text()))


def times_in(result: dict[str, Any]) -> dict[str, float]:
    """Claims with a unit of time, rows with value and unit, and fields `*_ms` of rows."""
    found: dict[str, float] = {}
    for claim in result["claims"]:
        if claim["unit"] in SECONDS:
            found[f"claim {claim['name']}"] = claim["value"] * SECONDS[claim["unit"]]
    for row in result["rows"]:
        words = " ".join(
            str(value) for key, value in row.items() if isinstance(value, str) and key != "unit"
        )
        if row.get("unit") in SECONDS and isinstance(row.get("value"), float):
            found[words] = row["value"] * SECONDS[row["unit"]]
        for key, value in row.items():
            if key.endswith("_ms") and isinstance(value, (int, float)):
                found[f"{words} {key}"] = 1e-3 * value
    return found


HERE = Path(__file__).resolve().parents[1]
RATIO = 1.05
SHOWN = 12  # differences per request


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--before", type=Path, required=True, help="a checkout with a built core")
    parser.add_argument("--after", type=Path, default=HERE, help="another one; default: this one")
    parser.add_argument(
        "--only", action="append", help="requests whose group or name contains this"
    )
    parser.add_argument("--rounds", type=int, default=3, help="timed rounds; 0: the answers alone")
    parser.add_argument(
        "--script", action="append", default=[], help="a benchmark to run in both, as regional"
    )
    add_ending(parser, "every third request, one timed round")
    given = parser.parse_args()
    missing = both_built(given.before, given.after)
    if missing:
        parser.error(missing)
    return given


def chosen(names: list[list[str]], given: argparse.Namespace) -> list[int]:
    """Numbers of the requests that are asked."""
    only = given.only or [""]
    found = [
        k for k, words in enumerate(names) if any(text in word for text in only for word in words)
    ]
    return found[::3] if given.quick else found


def row_of(k: int, sides: tuple[Side, Side], rounds: int) -> dict[str, Any]:
    """A request answered by both, its differences, and the ratio of its times."""
    first = [side.ask(k) for side in sides]
    found = differences(first[0]["answer"], first[1]["answer"])
    least = [float("inf")] * 2
    for _ in range(rounds):
        for place, side in enumerate(sides):
            least[place] = min(least[place], side.ask(k)["cpu_s"])
    return {
        "group": first[0]["group"],
        "name": first[0]["name"],
        "status": first[1]["answer"].get("status", ""),
        "id": first[1]["answer"].get("id", ""),
        "identical": not found,
        "differences": found,
        "changes": changes(first[0]["answer"], first[1]["answer"]),
        **({"before_ms": 1e3 * least[0], "after_ms": 1e3 * least[1]} if rounds else {}),
    }


def show(row: dict[str, Any]) -> None:
    """One line per request, one more per difference."""
    times = f"{row['before_ms']:9.2f} {row['after_ms']:9.2f} ms" if "before_ms" in row else ""
    verdict = "identical" if row["identical"] else "DIFFERENT"
    print(f"{row['name']:48s} {row['status']!s:>6s} {row['id']:16s} {verdict} {times}", flush=True)
    for text in row["differences"][:SHOWN]:
        print(f"    {text}")
    if len(row["differences"]) > SHOWN:
        print(f"    and {len(row['differences']) - SHOWN} more")


def groups_of(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Median ratio of the times per group."""
    found = []
    for group in dict.fromkeys(row["group"] for row in rows if "before_ms" in row):
        times = np.array(
            [[row["before_ms"], row["after_ms"]] for row in rows if row["group"] == group]
        )
        ratio = float(np.median(times[:, 1] / times[:, 0]))
        sums = times.sum(axis=0)
        found.append(
            {
                "group": group,
                "requests": len(times),
                "before_ms": sums[0],
                "after_ms": sums[1],
                "ratio": ratio,
            }
        )
    return found


def claims_of(rows: list[dict[str, Any]], groups: list[dict[str, Any]]) -> list[Claim]:
    """Identity, and the median ratio of each group and of all."""
    different = sum(not row["identical"] for row in rows)
    claims = [
        at_most(f"all answers identical: different ones of {len(rows)}", different, "answers", 0)
    ]
    claims += [
        at_most(f"median ratio {group['group']}", group["ratio"], "1", RATIO) for group in groups
    ]
    ratios = [row["after_ms"] / row["before_ms"] for row in rows if "before_ms" in row]
    if ratios:
        claims.append(at_most("median ratio of all requests", float(np.median(ratios)), "1", RATIO))
    return claims


def main() -> None:
    """Ask both, print, write."""
    given = arguments()
    rounds = min(given.rounds, 1) if given.quick else given.rounds
    with Side(given.before) as before, Side(given.after) as after:
        if before.requests != after.requests:
            raise SystemExit(
                "the checkouts have different cells or stations: their requests don't pair"
            )
        rows = []
        for k in chosen(after.requests, given):
            rows.append(row_of(k, (before, after), rounds))
            show(rows[-1])
    show_changes(rows)
    groups = groups_of(rows)
    claims = claims_of(rows, groups)
    for name in given.script:
        more = script_rows(name, given.before, given.after, max(rounds, 1))
        groups += more
        if more:
            ratio = float(np.median([row["ratio"] for row in more]))
            claims.append(
                at_most(f"median ratio of the times of benchmark {name}", ratio, "1", RATIO)
            )
    commits = {"before": commit(given.before), "after": commit(given.after)}
    finish(given.json, [*rows, *groups], claims, compared=commits)


if __name__ == "__main__":
    main()
