"""What lies where in the folder of a run or sweep: its tables, and vehicles that jobs name."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path

from foretwin.contracts.codec import encode, write_message
from foretwin.contracts.did_you_mean import one_of
from foretwin.contracts.job_identity import vehicle_digest
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.table_parts import table_of

VEHICLES, REPEATED = "vehicles", "repeated"
"""Folders of a run or sweep: parameters that jobs name, and pictures of futures played again."""


SWEPT_TABLES = {"road_users": "road_users", "jobs": "jobs", "futures": "rows"}
"""Folders of the parts of a sweep's tables; whose futures are there is done, so these are written
last."""
METRICS_FILE = "metrics.parquet"
"""A sweep's table of what its metrics mean."""
SUMMARY = "sweep.json"
"""A sweep's record."""


def table_at(folder: Path, table: str) -> Path:
    """Return the last file of a run's or sweep's table, or the folder of a sweep's.

    Raises FileNotFoundError, naming those that are there, where there is none.
    """
    swept = {name: folder / at for name, at in (("metrics", METRICS_FILE), *SWEPT_TABLES.items())}
    of_run = {table_of(file) or file.stem for file in (folder / "results").glob("*.parquet")}
    there = {name: folder / "results" / f"{name}.parquet" for name in of_run}
    there = {name: path for name, path in swept.items() if path.exists()} | there
    if table not in there:
        known = one_of(table, sorted(there)) if there else "neither of a run nor a sweep"
        raise FileNotFoundError(f"{folder}: holds no table of {table}: {known}")
    return there[table]


def keep_vehicles(folder: Path, vehicles: Iterable[VehicleParameters]) -> None:
    """Write parameters into a run's or sweep's folder, under the digests that jobs name.

    Those that are there and whole stay as they are. Raises OSError.
    """
    (folder / VEHICLES).mkdir(parents=True, exist_ok=True)
    for vehicle in vehicles:
        file = folder / VEHICLES / f"{vehicle_digest(vehicle)}.vehicle"
        if not file.exists() or file.read_bytes() != encode(vehicle):
            write_message(vehicle, file)


class VehicleKeeper:
    """Keeps the parameters that a drive's jobs name; what a full disk does not take waits."""

    def __init__(self, folder: Path, vehicle: VehicleParameters) -> None:
        self._folder, self._waiting = folder, [vehicle]
        self.write()

    def add(self, vehicle: VehicleParameters) -> None:
        """Take parameters that jobs will name."""
        self._waiting.append(vehicle)
        self.write()

    def write(self) -> None:
        """Write what waits, where the disk takes it now; never raises."""
        if self._waiting:
            with contextlib.suppress(OSError):
                keep_vehicles(self._folder, self._waiting)
                self._waiting.clear()
