"""Every drive of the data folder, of cars without a known fault, put before the detector."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from foretwin.contracts.drive import GnssFix, VehicleInfo
from foretwin.contracts.frames import GeoPoint, LocalFrame
from foretwin.contracts.gap import Verdict
from foretwin.sim_worker.analysis.gap.verdict import FaultDetector
from foretwin.sim_worker.vehicle.parameters import load_vehicle
from foretwin.telemetry.logs.geojson import geojson_lines
from foretwin.telemetry.logs.mcity import read_mcity
from foretwin.telemetry.logs.opening import open_log

DECLARATIONS = Path(__file__).parents[3] / "data" / "declarations"
LOGS = {
    "drive-comma2k19-sf/segment40": None,
    "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt": None,
    "drive-dresden-imu/2014-02-14-002-Data.csv": "dresden.csv.toml",
    "drive-dresden-imu/2014-03-26-000-Data.csv": "dresden.csv.toml",
    "drive-boreas-toronto/boreas-2021-08-05-13-34_lidar_poses.csv": "boreas.csv.toml",
}
"""With the declarations of the tables among them."""
HANNOVER = ("2021_GoogleMaps.geojson", "2021_NunavSwarm.geojson")
START_NS, PERIOD_NS = 1_600_000_000_000_000_000, 1_000_000_000
Samples = list[tuple[str, Any]]


def accused_in(data: Path) -> Iterator[tuple[str, float, list[Verdict]]]:
    """Yield each drive, its seconds and its verdicts."""
    for name, info, samples in (*_logs(data), *_hannover(data), *_mcity(data)):
        place = next(m.position for _, m in samples if isinstance(m, GnssFix))
        detector = FaultDetector(info, load_vehicle(), frame=LocalFrame(place))
        said = [detector.handle(*sample) for sample in samples]
        seconds = (samples[-1][1].stamp_ns - samples[0][1].stamp_ns) * 1e-9
        yield name, seconds, [one for one in said if one]


def _logs(data: Path) -> Iterator[tuple[str, VehicleInfo, Samples]]:
    for name, declaration in LOGS.items():
        file = None if declaration is None else DECLARATIONS / declaration
        log = open_log(data / name, declaration=file)
        yield name, log.info, list(log.samples())


def _hannover(data: Path) -> Iterator[tuple[str, VehicleInfo, Samples]]:
    """Positions without times: one second apart, since nothing else is said of them."""
    for name in HANNOVER:
        for number, line in enumerate(geojson_lines(data / "drives-hannover" / name)):
            samples: Samples = [
                ("gnss", GnssFix(stamp_ns=START_NS + k * PERIOD_NS, position=GeoPoint(lat, lon)))
                for k, (lon, lat, _) in enumerate(line.positions)
            ]
            yield f"drives-hannover/{name} {number}", _positions_alone(name), samples


def _mcity(data: Path) -> Iterator[tuple[str, VehicleInfo, Samples]]:
    """Satellite positions of the test cars: they send nothing else."""
    for file in sorted((data / "traffic-mcity-rtk" / "gts").glob("gps_data_*.json")):
        instants = read_mcity(file)
        for name in sorted({one.user_id for _, seen in instants for one in seen}):
            samples: Samples = [
                (
                    "gnss",
                    GnssFix(
                        stamp_ns=stamp, position=GeoPoint(one.lat_deg, one.lon_deg), std_m=0.02
                    ),
                )
                for stamp, seen in instants
                for one in seen
                if one.user_id == name
            ]
            yield f"traffic-mcity-rtk/{file.name} {name}", _positions_alone(name), samples


def _positions_alone(name: str) -> VehicleInfo:
    return VehicleInfo(vehicle_id=name, time_base="utc", start_stamp_ns=START_NS, source=name)
