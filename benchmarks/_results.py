"""Command line of every benchmark, and rows, claims, machine and commit at its end."""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Claim:
    """A measured figure beside the bound it was asked to keep."""

    name: str
    value: float
    unit: str
    bound: float
    holds: bool


def at_most(name: str, value: float, unit: str, bound: float) -> Claim:
    """A claim that holds up to its bound."""
    return Claim(name, float(value), unit, float(bound), bool(value <= bound))


def at_least(name: str, value: float, unit: str, bound: float) -> Claim:
    """A claim that holds from its bound on."""
    return Claim(name, float(value), unit, float(bound), bool(value >= bound))


def machine() -> str:
    """Processor, cores and load of the machine."""
    info = Path("/proc/cpuinfo")
    names = (
        [line for line in info.read_text().splitlines() if line.startswith("model name")]
        if info.exists()
        else []
    )
    found = (
        f"{names[0].split(':')[1].strip()}, {len(names)} cores" if names else platform.processor()
    )
    return f"{found}, load {os.getloadavg()[0]:.1f}"


def commit(root: Path | None = None) -> str:
    """The commit of a checkout; of the one that this file is in."""
    place = root or Path(__file__).resolve().parent
    done = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=place, capture_output=True, text=True, check=False
    )
    return done.stdout.strip()


def command_line(
    doc: str | None, cells: Sequence[str], seeds: int, quick: str
) -> argparse.ArgumentParser:
    """A parser with --cell, --seeds, --quick and --json.

    doc: the script's own text; cells: the default ones; seeds: the default; quick: what --quick
    leaves.
    """
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--cell", action="append", help=f"file or bundled cell; default: {', '.join(cells)}"
    )
    parser.add_argument("--seeds", type=int, default=seeds, help=f"default: {seeds}")
    add_ending(parser, quick)
    return parser


def add_ending(parser: argparse.ArgumentParser, quick: str) -> None:
    """The two options that every benchmark has: --quick and --json."""
    parser.add_argument("--quick", action="store_true", help=f"at most two minutes: {quick}")
    parser.add_argument("--json", type=Path, help="also write the results here")


def line_of(row: dict[str, Any]) -> str:
    """A row as `key value  key value`."""
    return "  ".join(
        f"{key} {v:.4g}" if isinstance(v, float) else f"{key} {v}" for key, v in row.items()
    )


def finish(
    path: Path | None, rows: Sequence[dict[str, Any]], claims: Sequence[Claim], **more: Any
) -> None:
    """Print the claims, and write everything where there is a path."""
    print_claims(claims)
    write_json(path, rows, claims, **more)


def print_claims(claims: Sequence[Claim]) -> None:
    """One line per claim: name, measured value, unit, bound, verdict."""
    width = max((len(claim.name) for claim in claims), default=0)
    units = max((len(claim.unit) for claim in claims), default=0)
    print()
    for claim in claims:
        verdict = "holds" if claim.holds else "falls short"
        measured = f"{claim.name:{width}s} {claim.value:10.4g} {claim.unit:{units}s}"
        print(f"{measured} bound {claim.bound:<9.6g} {verdict}")


def write_json(
    path: Path | None, rows: Sequence[dict[str, Any]], claims: Sequence[Claim], **more: Any
) -> None:
    """Rows and claims with machine and commit; nothing where there is no path."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    result = {"machine": machine(), "commit": commit(), **more}
    result |= {"rows": list(rows), "claims": [asdict(claim) for claim in claims]}
    path.write_text(json.dumps(result, indent=1))
