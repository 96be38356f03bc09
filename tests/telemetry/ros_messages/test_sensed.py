"""Samples of virtual receivers and inertial sensors: what other programs read out of the bytes."""

from __future__ import annotations

from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.sensed_motion import SensedFix, SensedImu
from foretwin.telemetry.ros_messages.parts import typestore
from foretwin.telemetry.ros_messages.table import messages_from


def test_samples_are_in_the_frames_of_their_sensors() -> None:
    fix = SensedFix(
        stamp_ns=5, position=GeoPoint(52.5, 13.4, 40.0), std_m=0.5, up_std_m=2.0, sensor="roof"
    )
    imu = SensedImu(
        stamp_ns=6, accel_mps2=(1.0, 2.0, 9.8), rate_radps=(0.1, 0.2, 0.3), sensor="box"
    )
    (first,) = messages_from("sensed_gnss", fix, None)
    (second,) = messages_from("sensed_imu", imu, None)
    place, motion = (typestore().deserialize_cdr(one.data, one.kind) for one in (first, second))

    assert (first.topic, second.topic) == ("/foretwin/sensed_gnss", "/foretwin/sensed_imu")
    assert (place.latitude, place.longitude, place.altitude) == (52.5, 13.4, 40.0)
    assert place.position_covariance.tolist() == [0.25, 0, 0, 0, 0.25, 0, 0, 0, 4.0]
    assert (place.header.frame_id, motion.header.frame_id) == ("roof", "box")
    assert motion.linear_acceleration.z == 9.8
    assert motion.angular_velocity.y == 0.2
