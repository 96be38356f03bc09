"""One small log of every kind that there is a reader for, to be damaged."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import msgspec
import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.frames import GeoPoint
from foretwin.telemetry.logs.convert import convert
from foretwin.telemetry.logs.write_mcap import create
from tests.telemetry.drive_messages import INFO, START_NS
from tests.telemetry.logs import (
    test_gnss_logger,
    test_kitti_oxts,
    test_nuscenes_can,
    test_smartloc,
    test_ubx,
)
from tests.telemetry.test_comma2k19 import save
from tests.telemetry.test_foreign_mcap import LAG_NS, ForeignFile, control, fix, velocity
from tests.telemetry.test_nmea import gga, rmc

TENTH_NS = 100_000_000


def drive_samples() -> list[tuple[str, msgspec.Struct]]:
    """Two seconds of a drive on every channel."""
    samples: list[tuple[str, msgspec.Struct]] = []
    for tick in range(20):
        stamp_ns = START_NS + tick * TENTH_NS
        here = GeoPoint(52.5 + 1e-5 * tick, 13.4, 40.0)
        user = drive.RoadUser(
            user_id="7", kind="car", position=here, yaw_rad=0.1, speed_mps=4.0, length_m=4.0,
            width_m=1.8,
        )  # fmt: skip
        arrays = {
            "lat_deg": np.full(4, here.lat_deg), "lon_deg": np.full(4, here.lon_deg),
            "yaw_rad": np.zeros(4), "speed_mps": np.ones(4), "time_from_stamp_s": np.arange(4.0),
        }  # fmt: skip
        samples += [
            ("gnss", drive.GnssFix(stamp_ns=stamp_ns, position=here, std_m=0.5)),
            ("imu", drive.ImuSample(stamp_ns=stamp_ns, accel_mps2=(0.1, 0.0, 9.8),
                                    rate_radps=(0.0, 0.0, 0.1))),
            ("speed", drive.SpeedSample(stamp_ns=stamp_ns, speed_mps=10.0)),
            ("heading", drive.HeadingSample(stamp_ns=stamp_ns, yaw_rad=1.5, yaw_rate_radps=0.1)),
            ("steering", drive.SteeringSample(stamp_ns=stamp_ns, steering_wheel_rad=0.2)),
            ("control", drive.ControlCommand(stamp_ns=stamp_ns, accel_mps2=0.4,
                                             steering_wheel_rad=0.2)),
            ("plan", drive.PlannedTrajectory(stamp_ns=stamp_ns, **arrays)),
            ("status", drive.VehicleStatus(stamp_ns=stamp_ns, control_mode="manual")),
            ("objects", drive.RoadUsers(stamp_ns=stamp_ns, users=(user,))),
            ("signals", drive.SignalState(stamp_ns=stamp_ns, group_id="g1", colour="green")),
        ]  # fmt: skip
    return samples


def whole_logs(folder: Path) -> list[Path]:
    """Write a log of every kind; returns their paths, of files and of folders."""
    own = folder / "own.mcap"
    writer = create(own, info=INFO)
    for channel, message in drive_samples():
        writer.add(channel, message)
    writer.finish()
    logs = [own, folder / "own.csv", folder / "own.bag", folder / "ros2"]
    for target in logs[1:]:
        convert(own, target)
    texts = {
        "track.gpx": _GPX.replace("POINTS", _POINTS),
        "way.gpx": _GPX.replace("trkseg", "g").replace("trk", "rte").replace("<g>", "").replace(
            "</g>", "").replace("POINTS", _POINTS.replace("trkpt", "rtept")),
        "track.geojson": json.dumps({
            "type": "Feature",
            "geometry": {"type": "LineString",
                         "coordinates": [[13.4, 52.5 + 1e-4 * n, 40.0] for n in range(8)]},
            "properties": {"coordTimes": [f"2026-03-01T12:00:0{n}Z" for n in range(8)]},
        }),
        "drive.nmea": "".join(gga(f"12000{n}.00") + "\r\n" + rmc(f"12000{n}.00", "010326") + "\r\n"
                              for n in range(8)),
        "point3.txt": _SMARTLOC,
        "mcity.json": json.dumps([
            {"timestamp": 1_688_680_000.0 + n / 10, "objs": [
                {"id": "1", "classType": "2", "lat": 42.3 + 1e-5 * n, "lon": -83.69}]}
            for n in range(20)
        ]),
    }  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
        logs.append(folder / name)
    foreign = ForeignFile(folder / "foreign.mcap")
    for tick in range(10):
        at_ns = START_NS + tick * TENTH_NS
        foreign.add("/fix", "sensor_msgs/msg/NavSatFix", fix(at_ns, 52.5 + 1e-5 * tick), at_ns)
        kind = "autoware_vehicle_msgs/msg/VelocityReport"
        foreign.add("/velocity", kind, velocity(at_ns, 5.0), at_ns + LAG_NS)
        kind = "autoware_control_msgs/msg/Control"
        foreign.add("/control", kind, control(at_ns, 0.1, 0.2), at_ns + LAG_NS)
    logs.append(foreign.close())
    ubx = folder / "drive.ubx"
    ubx.write_bytes(b"".join(test_ubx.pvt(second) for second in range(20)))
    (folder / "kitti").mkdir()
    (folder / "smartloc").mkdir()
    odometry = "".join(test_smartloc.ODOMETRY.format(n / 10, 5.0 + n, 0.1) for n in range(20))
    kitti = test_kitti_oxts.drive(folder / "kitti")
    scene = test_nuscenes_can.scene(folder / "can_bus", seconds=1).parent
    phone = folder / "gnss_log.txt"
    rows = [test_gnss_logger.fix(n) + test_gnss_logger.sensor("Gyro", 10 * n, "0,0.1,0")
            + test_gnss_logger.sensor("Accel", 10 * n, "0,9.8,0") for n in range(9)]  # fmt: skip
    phone.write_text(test_gnss_logger.V2 + "".join(rows))
    (folder / "gnss_log.txt.toml").write_text('forward = "-z"\nup = "y"\n')
    return [
        *logs, _copied(folder, "circle--rlog.bz2"), ubx, scene, phone, kitti,
        test_kitti_oxts.zipped(kitti), test_smartloc.drive(folder / "smartloc", odometry),
        _segment(folder / "segment40"),
    ]  # fmt: skip


def _copied(folder: Path, name: str) -> Path:
    return Path(shutil.copy(Path(__file__).parents[1] / "data" / "comma" / name, folder))


def _segment(folder: Path) -> Path:
    at = [3784144.3, 901246.3, 5037714.1]
    save(folder / "global_pose/frame_times", 10.0 + 0.1 * np.arange(6))
    save(folder / "global_pose/frame_positions", [at] * 6)
    save(folder / "processed_log/CAN/speed/t", [10.0, 10.1])
    save(folder / "processed_log/CAN/speed/value", [[5.0], [6.0]])
    return folder


_GPX = """<?xml version="1.0"?>
<gpx version="1.1" creator="a test" xmlns="http://www.topografix.com/GPX/1/1">
<trk><trkseg>POINTS</trkseg></trk></gpx>
"""
_POINTS = "".join(
    f'<trkpt lat="{52.5 + 1e-4 * n}" lon="13.4"><ele>40</ele>'
    f"<time>2026-03-01T12:00:0{n}Z</time></trkpt>"
    for n in range(8)
)
_SMARTLOC = "".join(
    f"point3 {n / 10} 3784144.3 901246.3 {5037714.1 + n} 0 0 0 0 0 0 0 0 0\n" for n in range(20)
)
