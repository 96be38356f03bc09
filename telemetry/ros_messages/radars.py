"""Lists of radars as radar_msgs/RadarScan, in the radar's own frame."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.frames import LocalFrame
from foretwin.contracts.radar_list import RadarList
from foretwin.telemetry.ros_messages import parts


def radar_scan_from(
    message: RadarList, _frame: LocalFrame | None = None, *, frame_id: str = ""
) -> Any:
    """Return the RadarScan of a list; without a `frame_id` the frame is called as the sensor is.

    Angles go to the left and upwards, as radar_msgs says of REP 103; its amplitude is in dB.
    """
    returns = [
        parts.ros_message(
            "radar_msgs/msg/RadarReturn",
            range=range_m,
            azimuth=azimuth,
            elevation=elevation,
            doppler_velocity=rate_mps,
            amplitude=amplitude,
        )
        for range_m, azimuth, elevation, rate_mps, amplitude in message.returns.tolist()
    ]
    header = parts.header_from(message.stamp_ns, frame_id or message.sensor)
    return parts.ros_message(parts.RADAR_SCAN, header=header, returns=returns)
