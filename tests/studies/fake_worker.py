"""A worker that plans nothing: it answers, hangs, dies once or always by the planner's name."""

import json
import os
import signal
import sys
from pathlib import Path

settings = json.loads(sys.stdin.readline())
print(json.dumps({"ready": True}), flush=True)
for line in sys.stdin:
    entry = json.loads(line)
    if entry["planner"] == "rrt":
        signal.pause()  # until it is cut
    marks = Path(sys.argv[1]) / f"{entry['task']}{entry['seed']}".replace(">", "")
    if entry["planner"] == "prm" or (entry["planner"] == "tree" and not marks.exists()):
        marks.touch()
        os._exit(3)
    cost = 1000.0 + 100.0 * entry["seed"]
    row = {"solved": True, "free_ptp": False, "cost_j": cost, "energy_j": cost, "duration_s": 2.0}
    row |= {
        "movement_cost": 5.0,
        "clearance_m": 0.02,
        "first_s": 0.1,
        "final_s": 0.2,
        "total_s": 0.3,
    }
    print(
        json.dumps({**row, "requests": 1, "progress": [[0.1, 2 * cost], [0.2, cost]]}), flush=True
    )
