"""Clouds of points as sensor_msgs/PointCloud2, as Velodyne's drivers or Autoware lay them out."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from foretwin.contracts.arrays import Array32
from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.point_cloud import MOST_RAYS, POINT_COLUMNS, PointCloud
from foretwin.telemetry.ros_messages import parts
from foretwin.telemetry.ros_messages.foreign import UnusableError

Layout = Literal["velodyne", "autoware"]
_LAYOUTS: dict[Layout, np.dtype[np.void]] = {
    "velodyne": np.dtype(
        [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
         ("time", "<f4")]
    ),
    "autoware": np.dtype(
        [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "u1"), ("return_type", "u1"),
         ("channel", "<u2"), ("azimuth", "<f4"), ("elevation", "<f4"), ("distance", "<f4"),
         ("time_stamp", "<u4")]
    ),
}  # fmt: skip
"""Without gaps: 22 bytes a point (velodyne_pointcloud, XYZIRT); 32 bytes (PointXYZIRCAEDT, which
Autoware's documentation, "Point cloud pre-processing design", asks lidar drivers for: angles in
radians by atan2, nanoseconds since the header's time)."""
_STRONGEST = 1
"""autoware_point_types, ReturnType SINGLE_STRONGEST."""
_DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""sensor_msgs/PointField."""
_SECONDS_OF = {"time": 1.0, "t": 1e-9, "time_stamp": 1e-9}
"""By the names under which drivers tell since when (Velodyne's; Ouster's; Autoware's)."""


def cloud_from(
    message: PointCloud,
    _frame: LocalFrame | None = None,
    *,
    layout: Layout = "velodyne",
    frame_id: str = parts.BASE_FRAME,
) -> Any:
    """Return the PointCloud2 of a cloud, its stamp that of the turn's beginning.

    Each point is where the frame was when it was measured: the time is for who removes the skew.
    """
    packed = _packed(message.points, layout)
    kinds = {kind: number for number, kind in _DATATYPES.items()}
    fields = [
        parts.ros_message(
            "sensor_msgs/msg/PointField",
            name=name,
            offset=place[1],
            datatype=kinds[place[0].str[1:]],
            count=1,
        )
        for name, place in (_LAYOUTS[layout].fields or {}).items()
    ]
    return parts.ros_message(
        parts.POINT_CLOUD2,
        header=parts.header_from(message.stamp_ns, frame_id),
        height=1,
        width=len(packed),
        fields=fields,
        point_step=packed.itemsize,
        row_step=packed.nbytes,
        data=packed.view(np.uint8).reshape(-1),
        is_dense=True,
    )


def cloud_of(ros: Any, stamp_ns: int, *, sensor: str = "") -> PointCloud:
    """Return the cloud of a PointCloud2, in its own frame; what no ray met is left out.

    Rings and intensities that it does not tell are 0, times too. Some drivers stamp the end of a
    turn and count times from there: the stamp is that of the first point then. Raises
    UnusableError where it has no places, or more points than any lidar.
    """
    count = int(ros.height) * int(ros.width)
    if count > MOST_RAYS:
        raise UnusableError(f"more than {MOST_RAYS} points")
    read = _read(ros, count)
    if not {"x", "y", "z"} <= read.keys():
        raise UnusableError("no x, y, z")
    zero = np.zeros(count)
    times = (read[name] * scale for name, scale in _SECONDS_OF.items() if name in read)
    columns = {"intensity": zero, "ring": read.get("channel", zero)} | read
    columns["time"] = next(times, zero)
    points = np.stack([columns[name] for name in POINT_COLUMNS], axis=1)
    met = np.isfinite(points).all(axis=1) & points[:, :3].any(axis=1)
    points = points[met]
    before_s = min(points[:, 5].min(initial=0.0), 0.0)
    points[:, 5] -= before_s
    begun_ns = stamp_ns + round(before_s * 1e9)
    return PointCloud(stamp_ns=begun_ns, points=points.astype(np.float32), sensor=sensor)


def _packed(points: Array32, layout: Layout) -> npt.NDArray[np.void]:
    packed = np.empty(len(points), dtype=_LAYOUTS[layout])
    if layout == "velodyne":
        for column, name in enumerate(POINT_COLUMNS):
            packed[name] = points[:, column]
        return packed
    x, y, z, intensity, ring, time_s = points.T
    flat = np.hypot(x, y)
    for name, values in (
        ("x", x), ("y", y), ("z", z), ("intensity", np.clip(np.round(intensity), 0.0, 255.0)),
        ("return_type", _STRONGEST), ("channel", ring), ("azimuth", np.arctan2(y, x)),
        ("elevation", np.arctan2(z, flat)), ("distance", np.hypot(flat, z)),
        ("time_stamp", np.round(time_s.astype(np.float64) * 1e9)),
    ):  # fmt: skip
        packed[name] = values
    return packed


def _read(ros: Any, count: int) -> dict[str, npt.NDArray[np.float64]]:
    """Return the fields of one number each, by their names."""
    order = ">" if ros.is_bigendian else "<"
    told = [one for one in ros.fields if one.datatype in _DATATYPES and one.count in (0, 1)]
    step, row = int(ros.point_step), int(ros.row_step)
    if count == 0:
        return {one.name: np.zeros(0) for one in told}
    data = np.ascontiguousarray(ros.data, dtype=np.uint8)
    if step <= 0 or row < step * int(ros.width) or len(data) < row * int(ros.height):
        raise UnusableError("fewer bytes than it says")
    rows = data[: row * int(ros.height)].reshape(int(ros.height), row)
    each = np.ascontiguousarray(rows[:, : step * int(ros.width)]).reshape(count, step)
    found = {}
    for one in told:
        kind = np.dtype(order + _DATATYPES[one.datatype])
        if one.offset + kind.itemsize > step:
            raise UnusableError("a field beyond its point")
        part = np.ascontiguousarray(each[:, one.offset : one.offset + kind.itemsize])
        found[one.name] = part.view(kind)[:, 0].astype(np.float64)
    return found
