"""`ir replan`: plan the requests of a recording again and compare the ids."""

from __future__ import annotations

import argparse
import sys

from ir_msgs_py.file_roots import FileRoots
from ir_recorder.arguments import add_roots
from ir_recorder.reading.mcap_file import read_raw

from ..terminal import table
from .again import Replanned, Verdict, replan
from .recorded import RecordedPlanner


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add replan."""
    again = commands.add_parser(
        "replan", help="plan a recording's requests again and compare the ids"
    )
    again.add_argument("file", help="recording (.mcap)")
    again.add_argument("--namespace", help="of the cell, where the recording holds several")
    add_roots(again)
    again.set_defaults(run=run_replan)


def run_replan(arguments: argparse.Namespace) -> int:
    """Plan again and print; exit code 0 where something was compared and all of it is equal."""
    raw = read_raw(arguments.file, FileRoots.of(arguments.roots))
    for problem in raw.problems:
        sys.stderr.write(f"{arguments.file}: {problem}\n")
    recorded = RecordedPlanner(raw, arguments.namespace)
    found = list(replan(recorded))
    rows = [[each.service, str(each.verdict), str(each.ids), each.sentence] for each in found]
    if rows:
        sys.stdout.write(table(["request", "", "ids", "difference"], rows) + "\n")
    sys.stdout.write(sentence_of(found, recorded.differences()) + "\n")
    return 0 if all_equal(found) else 1


def all_equal(found: list[Replanned]) -> bool:
    """Whether something was compared, and nothing differs."""
    return any(each.verdict is Verdict.EQUAL for each in found) and not any(
        each.verdict is Verdict.DIFFERENT for each in found
    )


def sentence_of(found: list[Replanned], differences: list[str]) -> str:
    """What came of all requests, and what may explain it."""
    if not found:
        return "the recording holds no request that plans"
    count = {verdict: sum(each.verdict is verdict for each in found) for verdict in Verdict}
    ids = sum(each.ids for each in found if each.verdict is Verdict.EQUAL)
    parts = [
        f"{count[Verdict.EQUAL]} of {len(found)} requests planned again with equal ids ({ids} ids)"
    ]
    parts += [
        f"{count[kind]} {kind}" for kind in (Verdict.DIFFERENT, Verdict.NOT_COMPARED) if count[kind]
    ]
    if differences:
        parts.append("recorded with another build or other data: " + "; ".join(differences))
    return "; ".join(parts)
