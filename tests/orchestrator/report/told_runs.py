"""Small runs as a drive leaves them, with futures that were really played, for reports."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from foretwin.contracts.drive import GnssFix, VehicleInfo, VehicleState
from foretwin.contracts.frames import GeoPoint, geo_from_local
from foretwin.contracts.job_identity import job_bytes
from foretwin.contracts.versions import versions
from foretwin.contracts.world import World
from foretwin.contracts.world_identity import with_id
from foretwin.orchestrator.record.results import TABLES
from foretwin.orchestrator.record.run_folder import keep_vehicles
from foretwin.sim_worker.futures.job_tables import job_row, metric_rows, played_with
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.simulation import Futures, run_futures, state_on, ways_through
from foretwin.telemetry.logs.write_mcap import create
from foretwin.world_gen.world_store import WorldStore
from tests.orchestrator.lake.made_runs import write
from tests.sim_worker.scenarios.worlds import cross

NAME = "Kronenstraße \u00d7 Markgrafenstraße"
OSM = "© OpenStreetMap contributors"
START_NS, AT_S, ARRIVED_S = 1_000_000_000_000, 10.0, 15.0


@functools.cache
def street_crossing() -> World:
    """A drawn crossing, called as one in Berlin is."""
    drawn = cross()
    called = msgspec.structs.replace(drawn.intersection, name=NAME)
    whole = (drawn.junctions[0], *drawn.junctions[1:])
    junctions = tuple(msgspec.structs.replace(one, summary=called) for one in whole[:1])
    lanes = tuple(msgspec.structs.replace(lane, name="Kronenstraße") for lane in drawn.lanes)
    return with_id(
        msgspec.structs.replace(
            drawn, intersection=called, junctions=(*junctions, *whole[1:]), lanes=lanes
        )
    )


@functools.cache
def played() -> Futures:
    """Nine futures of a car before the crossing: some in which a car comes from the side."""
    world = street_crossing()
    way = ways_through(world)[1]
    state = msgspec.structs.replace(state_on(world, way), stamp_ns=START_NS + round(AT_S * 1e9))
    return run_futures(
        world,
        way,
        state,
        count=9,
        scenarios=("scp", "occluded_pedestrian"),
        horizon_s=4.0,
        planner="constant_speed",
    )


def told_run(out: Path, **more: Any) -> Path:
    """Write a run with one round of `played`, a junction that was reached, and its recording."""
    world, told = street_crossing(), played()
    folder = out / "run"
    rows = {
        "futures": told.rows,
        "jobs": [job_row(told.job, job_bytes(told.job))],
        "metrics": metric_rows(),
        "rounds": [_round(world, len(told.rows))],
        "junctions": [_junction(world) | {"seen_at_s": 0.0}],
        "comparisons": [_comparison(horizon) for horizon in (1.0, 2.0)],
        "gaps": [_gap(horizon) for horizon in (1.0, 2.0)],
        "events": [
            {"stamp_ns": START_NS, "level": "warning", "source": "test", "text": f"at {NAME}"}
        ],
    }
    _tables(folder, rows)
    WorldStore(folder / "worlds").save(world)
    keep_vehicles(folder, [load_vehicle(None)])
    _recording(folder, world)
    _record(folder, intersections=[{**_junction(world), "rounds": 1, "futures": 9}], **more)
    return folder


def run_without_junctions(out: Path) -> Path:
    """Write a run whose car met none: no round, no World."""
    folder = out / "alone"
    _tables(folder, {"metrics": metric_rows()})
    _recording(folder, street_crossing())
    _record(folder, intersections=[])
    return folder


def run_of_nothing(out: Path) -> Path:
    """Write the folder of a run that ended before anything was there: a record and no table."""
    folder = out / "nothing"
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps({"run_id": "nothing", "exit": "failed"}))
    return folder


def _tables(folder: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    (folder / "results").mkdir(parents=True)
    metadata = {"attribution": OSM, **played_with()}
    for name, schema in TABLES.items():
        write(folder / "results" / f"{name}.parquet", rows.get(name, []), schema, metadata)


def _record(folder: Path, **more: Any) -> None:
    record = {
        "run_id": "20261123-120000-told",
        "exit": "completed",
        "versions": versions(),
        "map": {"file": "maps/berlin-mitte.osm", "sha256": "5e87", "attribution": OSM},
        "seed": 0,
        "config": {
            "map": "maps/berlin-mitte.osm",
            "log": "logs/Berlin_Gendarmenmarkt_GT.txt",
            "planner": "pure_pursuit_idm",
            "source": "log",
            "rate_hz": 2.0,
            "speed": 1.0,
        },
        "ledger": {
            "telemetry": {"published": 40, "recorded": 40, "lost": 0},
            "rounds": {
                "due": 5,
                "run": 1,
                "missed": 1,
                "spared": 0,
                "unseeded": 3,
                "given_up": 0,
            },
            "jobs": {"given": 1, "results": 1, "refused": 0, "lost": 0},
        },
        "futures": {"late_rounds": 0, "smaller_rounds": 0, "sha256": "ab"},
        "comparison": {"ade_m": {"1": 0.1, "4": 0.8}, "count": {"1": 1, "4": 1}},
        "agreement": _AGREEMENT,
        "calibration": None,
        "tuning": {"verdicts": [], "parameters": [], "changes": []},
        "troubles": [],
        "drive_time_s": 20.0,
        **more,
    }
    (folder / "run.json").write_text(json.dumps(record), encoding="utf-8")


_COUNTS = {
    "agree_pass": 3,
    "agree_fail": 0,
    "too_pessimistic": 0,
    "too_optimistic": 1,
    "not_observable": 2,
}
_AGREEMENT = {
    "windows": 6,
    "overall": _COUNTS,
    "by_criterion": {"comfort": _COUNTS},
    "flips": {"along": {"flipped": 0}},
}


def _round(world: World, futures: int) -> dict[str, Any]:
    return {
        "round_id": 0,
        "stamp_ns": START_NS + round(AT_S * 1e9),
        "drive_time_s": AT_S,
        "intersection_id": world.intersection.id,
        "world_id": world.id,
        "futures": futures,
        "latency_ms": 312.0,
        "late": False,
    }


def _junction(world: World) -> dict[str, Any]:
    place = world.intersection
    return {
        "id": place.id,
        "kind": place.kind,
        "name": NAME,
        "control": place.control,
        "lat": place.lat,
        "lon": place.lon,
        "arrived_at_s": ARRIVED_S,
        "built_at_s": 0.5,
        "within_radius_at_s": 4.0,
        "world_ready_before_s": 3.5,
    }


def _comparison(horizon_s: float) -> dict[str, Any]:
    return {"round_id": 0, "stamp_ns": 0, "horizon_s": horizon_s, "nominal_ade_m": 0.4 * horizon_s}


def _gap(horizon_s: float) -> dict[str, Any]:
    sides = {"along_m": 0.3 * horizon_s, "across_m": 0.4 * horizon_s, "yaw_rad": 0.01}
    rest = {"yaw_rate_radps": 0.0, "speed_mps": 0.1, "accel_mps2": 0.0, "independent": True}
    names = ("along_std_m", "across_std_m", "yaw_std_rad", "speed_std_mps")
    return {
        "stamp_ns": START_NS,
        "horizon_s": horizon_s,
        "manoeuvre": "straight",
        **sides,
        **rest,
        **dict.fromkeys(names, 0.0),
    }


def _recording(folder: Path, world: World) -> None:
    """Write where the car was: straight on through the crossing, 8 m/s, for 20 s."""
    seconds = np.arange(0.0, 20.0, 0.5)
    along_m = (seconds - ARRIVED_S) * 8.0
    lat_lon = geo_from_local(world.frame, np.column_stack([along_m, np.full(len(along_m), -2.0)]))
    info = VehicleInfo(
        vehicle_id="ego",
        time_base="utc",
        start_stamp_ns=START_NS,
        reference_point="base_link",
        body_from_antenna_m=(0.0, 0.0, 0.0),
        sends=("gnss",),
    )
    with create(folder / "drive.mcap", info=info) as writer:
        for second, (lat, lon) in zip(seconds.tolist(), lat_lon.tolist(), strict=True):
            stamp_ns, here = START_NS + round(second * 1e9), GeoPoint(lat, lon)
            writer.add("gnss", GnssFix(stamp_ns=stamp_ns, position=here))
            writer.add(
                "state",
                VehicleState(
                    vehicle_id="ego",
                    stamp_ns=stamp_ns,
                    position=here,
                    yaw_rad=0.0,
                    speed_mps=8.0,
                    yaw_rate_radps=0.0,
                    accel_mps2=0.0,
                ),
            )
