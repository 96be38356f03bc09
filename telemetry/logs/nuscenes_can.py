"""Reader of nuScenes' CAN bus expansion (Motional, 2020): `scene-0061_pose.json` and its like.

Declares, by the expansion's README and nuScenes' schema: UTC in microseconds, positions in metres
on the plane of a map, x east, y north, of the ego vehicle's point, which is the middle of the rear
axle; speeds, accelerations and rates about its x forward, y left, z up; the steering wheel in
radians, positive to the left. `pose` gives positions, headings, speed and IMU (50 Hz),
`steeranglefeedback` the steering (100 Hz), `vehicle_monitor` gear and indicators (2 Hz), whose
lamps blink: one counts as on for _BLINK_S after it shone. `ms_imu` is left out, whose mounting
nobody tells, and `zoesensors`, raw voltages.

Which map a scene lies on stands in nuScenes' tables (`v1.0-*/scene.json`, `log.json`) beside the
folder, else in `NAME.toml`: `location = "boston-seaport"`. The maps' origins are those of the
devkit's map_api; distances are kept in metres, where its export_poses takes the Earth for a sphere.

Checked on scene-0103 (tests/telemetry/motion_proof.py), 19 s in Boston: the speed is that of the
positions (correlation 1.00, slope .97, .1 s late), the yaw rate the course's change (.99, .95,
0 s), the yaw the course (.5° off); steering bends the course to the side that it says (.98).
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np

from foretwin.contracts import drive
from foretwin.contracts.arrays import Array
from foretwin.contracts.errors import one_line
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.telemetry.logs.columns import Stream, stream_of, table_log
from foretwin.telemetry.logs.log import UNREADABLE_ROW, Log, LogError, Sample
from foretwin.telemetry.logs.map_origin import declaration_beside
from foretwin.telemetry.logs.merge import merged

Location = Literal[
    "boston-seaport", "singapore-hollandvillage", "singapore-onenorth", "singapore-queenstown"
]
ORIGINS: dict[Location, tuple[float, float]] = {
    "boston-seaport": (42.336849169438615, -71.05785369873047),
    "singapore-hollandvillage": (1.2993652317780957, 103.78217697143555),
    "singapore-onenorth": (1.2882100868743724, 103.78475189208984),
    "singapore-queenstown": (1.2782562240223188, 103.76741409301758),
}
"""Latitude and longitude in degrees of (0, 0) of each map (nuscenes-devkit, map_api.py)."""
_FILE = re.compile(
    r"(scene-\d{4})_(?:pose|ms_imu|steeranglefeedback|vehicle_monitor|zoesensors|zoe_veh_info)\.json"
)
_MOST_BYTES = 1 << 28
"""A scene is 20 s; an hour of 100 Hz in this writing is 200 MB."""
_PARKED, _DRIVING = 0, 7
_BLINK_S = 1.2
"""Lamps flash 60 to 120 times a minute (UN R48, 6.5.9.1)."""


class SceneDeclaration(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The map that a scene lies on."""

    location: Location


class _Table(NamedTuple):
    """Readable rows of one file: stamps (N,), and the numbers asked for (N, F)."""

    stamps_ns: Any
    numbers: Array


def scenes_in(folder: Path) -> list[Path]:
    """Return the poses of every scene in a folder, by name."""
    return sorted(path for path in folder.glob("scene-*_pose.json") if _FILE.fullmatch(path.name))


def is_nuscenes_can(path: Path) -> bool:
    """Tell by its name whether a file is one of a scene."""
    return _FILE.fullmatch(path.name) is not None


def open_nuscenes_can(path: Path, *, declaration: Path | None = None) -> Log:
    """Open a scene by any of its files, or a folder that holds one scene.

    Raises LogError where there are several scenes, no poses, or it is not told on which map.
    """
    scene, folder = _scene_of(path)
    frame = LocalFrame(GeoPoint(*ORIGINS[_location(path, folder, scene, declaration)]))
    refused: Counter[str] = Counter()

    def table(name: str, row: Callable[[Any], list[float]]) -> _Table | None:
        return _table(folder / f"{scene}_{name}.json", row, refused)

    pose = table("pose", _pose)
    if pose is None or not len(pose.stamps_ns):
        raise LogError(f"{folder / f'{scene}_pose.json'}: no poses, so no positions")
    numbers = pose.numbers
    geo = np.hstack([geo_from_local(frame, numbers[:, :2]), numbers[:, 2:3]])
    streams = {
        "gnss": stream_of("gnss", pose.stamps_ns, geo),
        "heading": stream_of("heading", pose.stamps_ns, numbers[:, [3, 10]]),
        "speed": stream_of("speed", pose.stamps_ns, numbers[:, 4:5]),
        "imu": stream_of("imu", pose.stamps_ns, numbers[:, 5:11]),
    }
    steering = table("steeranglefeedback", lambda one: [_number(one["value"])])
    if steering is not None and len(steering.stamps_ns):
        streams["steering"] = Stream(steering.stamps_ns, {"wheel": steering.numbers[:, 0]})
    log = table_log(
        scene,
        streams,
        stamps_ns=np.sort(np.concatenate([one.stamps_ns for one in streams.values()])),
        time_base="utc",
        reference_point="rear axle centre",
        body_from_antenna_m=(0.0, 0.0, 0.0),
        refused=refused,
    )
    monitor = table("vehicle_monitor", _monitor)
    return _with_status(log, monitor) if monitor and len(monitor.stamps_ns) else log


def _scene_of(path: Path) -> tuple[str, Path]:
    if not path.is_dir():
        return path.name.split("_")[0], path.parent
    scenes = scenes_in(path)
    if len(scenes) > 1:
        raise LogError(f"{path}: holds {len(scenes)} scenes; name one, such as {scenes[0]}")
    return scenes[0].name.split("_")[0], path


def _location(path: Path, folder: Path, scene: str, declaration: Path | None) -> Location:
    pose = folder / f"{scene}_pose.json"
    declared = declaration_beside(pose, declaration, SceneDeclaration)
    if declared is not None:
        return declared.location
    for tables in sorted((*folder.glob("v1.0-*"), *folder.parent.glob("v1.0-*"))):
        told = _told_location(tables, scene)
        if told is not None:
            return told
    raise LogError(
        f"{path}: on which map {scene} lies stands in nuScenes' tables (v1.0-*/scene.json), which"
        f" are not beside it; write {pose}.toml with location = one of {', '.join(ORIGINS)}"
    )


def _told_location(tables: Path, scene: str) -> Location | None:
    """Return a scene's map by nuScenes' own tables, None where they do not tell."""
    try:
        scenes, logs = (_messages(tables / name) for name in ("scene.json", "log.json"))
    except FileNotFoundError:
        return None
    token = next((one.get("log_token") for one in scenes if one.get("name") == scene), None)
    told = next((one.get("location") for one in logs if one.get("token") == token), None)
    return next((name for name in ORIGINS if name == told), None)


def _messages(path: Path) -> list[dict[str, Any]]:
    if path.stat().st_size > _MOST_BYTES:
        raise LogError(f"{path}: larger than {_MOST_BYTES >> 20} MB: no file of nuScenes")
    try:
        return msgspec.json.decode(path.read_bytes(), type=list[dict[str, Any]])
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise LogError(f"{path}: no list of messages: {one_line(error)}") from None


def _table(path: Path, row: Callable[[Any], list[float]], refused: Counter[str]) -> _Table | None:
    if not path.is_file():
        return None
    stamps, rows = [], []
    for message in _messages(path):
        try:
            stamp_us, numbers = int(message["utime"]), row(message)
        except (KeyError, TypeError, ValueError, IndexError, OverflowError):
            refused[UNREADABLE_ROW] += 1
            continue
        if abs(stamp_us) < 2**53:
            stamps.append(stamp_us * 1000)
            rows.append(numbers)
        else:
            refused[UNREADABLE_ROW] += 1
    return _Table(np.array(stamps, dtype=np.int64), np.array(rows, dtype=float))


def _pose(message: Any) -> list[float]:
    """Return x, y, z, yaw, speed, accelerations and rates."""
    x, y, z = map(_number, message["pos"])
    w, i, j, k = map(_number, message["orientation"])
    yaw = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
    forward = _number(message["vel"][0])
    accel, rate = (list(map(_number, message[name])) for name in ("accel", "rotation_rate"))
    if len(accel) != 3 or len(rate) != 3:
        raise ValueError("a vector without three axes")
    return [x, y, z, yaw, forward, *accel, *rate]


def _monitor(message: Any) -> list[float]:
    return [_number(message[name]) for name in ("gear_position", "left_signal", "right_signal")]


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return float(value)


def _with_status(log: Log, monitor: _Table) -> Log:
    """Return the log with gear and indicators, which are words and no numbers."""
    gears = {_PARKED: "park", _DRIVING: "drive"}
    shone = [monitor.stamps_ns[monitor.numbers[:, lamp] > 0.0] for lamp in (1, 2)]
    blinking = [_lately(one, monitor.stamps_ns) for one in shone]
    lamps = {(False, False): "off", (True, False): "left", (False, True): "right"}

    def statuses() -> list[Sample]:
        return [
            (
                "status",
                drive.VehicleStatus(
                    stamp_ns=stamp_ns,
                    gear=gears.get(gear, "unknown"),  # type: ignore[arg-type]
                    indicator=lamps.get((left, right), "hazard"),  # type: ignore[arg-type]
                ),
            )
            for stamp_ns, gear, left, right in zip(
                monitor.stamps_ns.tolist(), monitor.numbers[:, 0].tolist(), *blinking, strict=True
            )
        ]

    info = msgspec.structs.replace(log.info, sends=(*log.info.sends, "status"))
    return Log(info=info, read=lambda skipped: merged(log.read(skipped), statuses()))


def _lately(shone_ns: Any, stamps_ns: Any) -> list[bool]:
    """Return whether a lamp shone at each stamp or shortly before; both rise."""
    shone_ns = np.sort(shone_ns)
    last = np.searchsorted(shone_ns, stamps_ns, side="right") - 1
    age_ns = stamps_ns - np.append(shone_ns, np.iinfo(np.int64).min // 4)[last]
    lately: list[bool] = (age_ns <= _BLINK_S * 1e9).tolist()
    return lately
