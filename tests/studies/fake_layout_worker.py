"""A worker that plans nothing: costs are a bowl, some places impossible, one plan hangs, one dies
once.
"""

import json
import os
import signal
import sys
from pathlib import Path

marks = Path(sys.argv[1])
assert json.loads(sys.stdin.readline())["kind"] == "layout"
print(json.dumps({"ready": True}), flush=True)
for line in sys.stdin:
    words = json.loads(line)
    x = words["values"].get("base.x", 0.0)
    y = words["values"].get("base.y", 0.0)
    coarse = 1000.0 + 400.0 * ((x - 0.15) ** 2 + (y + 0.2) ** 2)
    if words["stage"] == "look":
        row = {"solved": True, "coarse": [coarse for _ in words["payloads"]]}
        if x > 0.4 or "nowhere" in sys.argv:
            row = {
                "solved": False,
                "kind": "out of reach",
                "message": "station infeed_pick is too far",
            }
        print(json.dumps(row), flush=True)
        continue
    if words["seed"] == 0 and "hang" in sys.argv and x == y == 0.0:
        signal.pause()  # until it is cut
    mark = marks / "died"
    if "die" in sys.argv and not mark.exists():
        mark.touch()
        os._exit(3)
    cost = coarse + 30.0 + 5.0 * abs((37.0 * x) % 1.0) + 0.1 * words["seed"] + words["cycle_time"]
    row = {
        "solved": True,
        "cost_j": cost,
        "energy_j": cost,
        "energy_low_j": cost - 1,
        "energy_high_j": cost + 1,
    }
    row |= {
        "duration_s": 5.0,
        "moving_j": cost / 2,
        "moving_s": 4.0,
        "drives_j": cost / 3,
        "clearance_m": 0.02,
    }
    if words["robots"]:
        row["robots"] = [0.1 * cost * (k - 5) / 5 for k in range(11)]
    print(json.dumps({**row, "certified": True, "program_id": "0"}), flush=True)
