"""One checkout's side of a comparison: answers the requests of the list by number.

Reads one number per line, writes one JSON line {group, name, answer, cpu_s, wall_s}. The first line
that it writes says how many requests there are and which checkout answers. Started by compare.py
with the packages of that checkout on PYTHONPATH.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from _compare_requests import Request, checkout, name_of, requests


def answered(request: Request) -> dict[str, Any]:
    """The request's answer with its processor time and wall time [s]; a crash is an answer as
    well.
    """
    cpu = time.process_time()
    wall = time.perf_counter()
    try:
        answer = request.ask()
    except name_of("RequestError") as refused:
        answer = {"status": int(refused.code), "refused": True}
    except Exception as error:  # the other checkout must be asked all the same
        answer = {"status": "crash", "error": f"{type(error).__name__}: {error}"}
    return {
        "group": request.group,
        "name": request.name,
        "answer": answer,
        "cpu_s": time.process_time() - cpu,
        "wall_s": time.perf_counter() - wall,
    }


def main() -> None:
    """Answer until the input ends."""
    asked = list(requests())
    names = [[request.group, request.name] for request in asked]
    print(json.dumps({"checkout": str(checkout()), "requests": names}), flush=True)
    for line in sys.stdin:
        print(json.dumps(answered(asked[int(line)])), flush=True)


if __name__ == "__main__":
    main()
