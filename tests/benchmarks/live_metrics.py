"""What the metrics and accidents of a live round cost: 64 futures among 10 road users.

They may take a tenth of a round's CPU (ratio 1.1); `metrics` and `accidents` say which takes what.
"""

from __future__ import annotations

import msgspec

from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.metrics.table import ROW_METRICS
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from tests.benchmarks import busy_junction, scenes
from tests.benchmarks.closed_loop import job_runner
from tests.benchmarks.measuring import Measurement, cpu_seconds

REPEATS = 12
ROAD_USERS = 10


def measure() -> Measurement:
    """Return CPU seconds of a round's futures as a drive asks for them, against none measured."""
    stage = BatchSimulation(
        busy_junction.world(), load_vehicle(), nsim=scenes.FUTURES, control_hz=scenes.CONTROL_HZ
    )
    busy = busy_junction.busy_job()
    bare = msgspec.structs.replace(busy, road_users=busy.road_users[::2], metrics=())
    assert len(bare.road_users) == ROAD_USERS
    jobs = {
        "bare": bare,
        "metrics": msgspec.structs.replace(bare, metrics=ROW_METRICS),
        "accidents": msgspec.structs.replace(bare, accidents=True),
        "all": msgspec.structs.replace(bare, metrics=ROW_METRICS, accidents=True),
    }
    taken_s = dict.fromkeys(jobs, float("inf"))
    runners = {name: job_runner(stage, job) for name, job in jobs.items()}
    for run in runners.values():
        run()
    for _ in range(REPEATS):
        for name, run in runners.items():
            taken_s[name] = min(taken_s[name], cpu_seconds(run))
    more = {name: taken_s[name] / taken_s["bare"] for name in ("metrics", "accidents")}
    return Measurement(taken_s["all"], "CPU s", taken_s["bare"], more)
