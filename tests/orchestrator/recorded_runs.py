"""Folders as a run of `foretwin drive` leaves them, for sweeps from recorded states."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from foretwin.contracts.arrays import Array
from foretwin.contracts.drive import GnssFix, RoadUsers, VehicleInfo
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.world import World
from foretwin.telemetry.logs.write_mcap import create
from foretwin.world_gen.world_store import WorldStore


def write_run(
    folder: Path,
    world: World,
    *,
    stamps_ns: Sequence[int],
    lat_lon_deg: Array,
    rounds_s: Sequence[int],
    speed_mps: float,
    objects: Sequence[RoadUsers] = (),
) -> Path:
    """Write a drive whose base_link was at positions (N, 2), with rounds so many seconds after it
    began, and what the car detected."""
    start_ns = stamps_ns[0]
    WorldStore(folder / "worlds").save(world)
    info = VehicleInfo(
        vehicle_id="car", time_base="utc", start_stamp_ns=start_ns,
        reference_point="base_link", body_from_antenna_m=(0.0, 0.0, 0.0), sends=("gnss",),
    )  # fmt: skip
    fixes = [
        ("gnss", GnssFix(stamp_ns=stamp, position=GeoPoint(float(lat), float(lon))))
        for stamp, (lat, lon) in zip(stamps_ns, np.asarray(lat_lon_deg), strict=True)
    ]
    said = [*fixes, *(("objects", message) for message in objects)]
    with create(folder / "drive.mcap", info=info) as writer:
        for channel, message in sorted(said, key=lambda one: one[1].stamp_ns):
            writer.add(channel, message)
    rounds = [
        {
            "round_id": second, "stamp_ns": start_ns + second * 1_000_000_000,
            "drive_time_s": float(second), "intersection_id": world.intersection.id,
            "world_id": world.id, "cruise_speed_mps": speed_mps,
        }
        for second in rounds_s
    ]  # fmt: skip
    (folder / "results").mkdir()
    pq.write_table(pa.Table.from_pylist(rounds), folder / "results" / "rounds.parquet")
    return folder
