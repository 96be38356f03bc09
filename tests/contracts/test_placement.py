"""Where scenarios can take place."""

from __future__ import annotations

import numpy as np

from foretwin.contracts.drive import VehicleState
from foretwin.contracts.frames import GeoPoint, LocalFrame, geo_from_local
from foretwin.contracts.placement import RecordedStart


def test_the_way_that_was_driven_lies_in_the_frame_of_the_world_without_limits() -> None:
    frame = LocalFrame(GeoPoint(52.5, 13.4))
    driven = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, 5.0]])
    lat_deg, lon_deg = geo_from_local(frame, driven).T.tolist()
    state = VehicleState(
        vehicle_id="car",
        stamp_ns=0,
        position=frame.origin,
        yaw_rad=0.0,
        speed_mps=8.0,
        yaw_rate_radps=0.0,
        accel_mps2=0.0,
    )
    start = RecordedStart(
        round_id=1,
        drive_time_s=2.0,
        world_id="w",
        junction_id="j",
        cruise_speed_mps=8.0,
        state=state,
        lat_deg=tuple(lat_deg),
        lon_deg=tuple(lon_deg),
    )

    path = start.path(frame)

    np.testing.assert_allclose(path.xy_m, driven, atol=1e-6)
    assert np.isinf(path.speed_limit_mps).all()
    assert path.speed_limit_mps.shape == (3,)
