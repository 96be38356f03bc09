"""What watching a vehicle costs while it drives, and what new parameters cost a worker."""

from __future__ import annotations

from typing import Any

from foretwin.sim_worker.analysis.tuning import SAMPLES, VehicleWatch
from foretwin.sim_worker.batch.batch_simulation import BatchSimulation
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.estimator.estimator import StateEstimator
from tests.benchmarks.measuring import Measurement, cpu_minimum_s
from tests.orchestrator.trip import town_world
from tests.sim_worker.driving import altered
from tests.telemetry.city_drive import city_drive
from tests.telemetry.standin_drive import FRAME

DRIVE_S = 40.0
SHARE_OF_A_CORE = 0.15
"""No more may go into watching: on two cores, workers have the rest."""


def measure() -> Measurement:
    """Return CPU seconds of identification, gap and verdicts for one second of a city drive."""
    drive = city_drive()
    info, vehicle = drive.source.info, load_vehicle()
    end_ns = info.start_stamp_ns + round(DRIVE_S * 1e9)
    estimator = StateEstimator(info)
    messages: list[tuple[str, Any]] = []
    for channel, message in drive.samples:
        if message.stamp_ns > end_ns:
            continue
        if channel in SAMPLES:
            messages.append((channel, message))
        state = estimator.handle(channel, message)
        if state is not None:
            messages.append(("state", state))

    def watch() -> None:
        watched = VehicleWatch(info, vehicle, frame=FRAME)
        for channel, message in messages:
            watched.handle(channel, message)

    cost_s = cpu_minimum_s(watch, repeats=3) / DRIVE_S
    stage = BatchSimulation(town_world("n4"), vehicle, nsim=32)
    others = [vehicle, altered(vehicle, wheelbase_m=2.7, mass_kg=1300.0)]

    def change() -> None:
        for other in others:
            stage.use_vehicle(other)

    more = {"use_vehicle_ms_per_world": cpu_minimum_s(change, repeats=5) / len(others) * 1e3}
    return Measurement(cost_s, "CPU s per s", SHARE_OF_A_CORE, more)
