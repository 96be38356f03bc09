"""The measured motion on a grid: where a car was, without what moved only the estimate."""

from __future__ import annotations

import msgspec
import numpy as np

from foretwin.contracts.frames import GeoPoint
from foretwin.sim_worker.analysis.gap.measured_motion import MeasuredMotion, motion_on_grid
from tests.sim_worker.places import FRAME, state_at


def test_what_a_map_has_moved_the_position_by_is_no_motion() -> None:
    """A car drives east at 10 m/s; after a second the map finds it 3 m further north."""
    states = [
        state_at(
            0.5 * k,
            0.0,
            0.0,
            10.0,
            stamp_ns=k * 50_000_000 + 1,
            yaw_rate=0.0,
            tire_angle=None,
            accel=0.0,
        )
        for k in range(41)
    ]
    for k in range(20, 41):
        place = states[k].position
        north = GeoPoint(place.lat_deg + 3.0 / 111_266.0, place.lon_deg)
        states[k] = msgspec.structs.replace(states[k], position=north, map_shift_m=(0.0, 3.0))
    grid = np.arange(1, 2_000_000_000, 100_000_000, dtype=np.int64)
    motion = motion_on_grid(states, grid, frame=FRAME)

    assert motion.known.all()
    np.testing.assert_allclose(motion.x_m, 10.0 * (grid - 1) * 1e-9, atol=1e-3)
    np.testing.assert_allclose(motion.y_m, 0.0, atol=2e-3)


def test_deviations_of_states_come_along_and_are_none_where_not_told() -> None:
    def motion(**told: float) -> MeasuredMotion:
        states = [
            msgspec.structs.replace(
                state_at(0.5 * k, 0.0, 0.0, 10.0, stamp_ns=k * 50_000_000 + 1, yaw_rate=0.0,
                         tire_angle=None, accel=0.0),
                yaw_std_rad=None, speed_std_mps=None,
            )
            for k in range(41)
        ]  # fmt: skip
        states = [msgspec.structs.replace(state, **told) for state in states]
        grid = np.arange(1, 2_000_000_000, 100_000_000, dtype=np.int64)
        return motion_on_grid(states, grid, frame=FRAME)

    assert (motion(yaw_std_rad=0.3).yaw_std_rad == 0.3).all()
    assert (motion(speed_std_mps=0.2).speed_std_mps == 0.2).all()
    assert (motion().yaw_std_rad == 0.0).all()
