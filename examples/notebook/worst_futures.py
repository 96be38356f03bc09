"""The ten closest futures of a run: `python worst_futures.py runs/RUN`."""

import sys

import foretwin

run = foretwin.open_run(sys.argv[1])
futures = run.table("futures").sort_by("min_clearance_m").slice(0, 10)
for row in futures.select(["future_id", "scenario", "planner", "min_clearance_m"]).to_pylist():
    print(row)
