"""Where in the filter's state each of its components stands; SI units, see `kinematic_filter`."""

from __future__ import annotations

X, Y, YAW, SPEED, ACCEL, CURVATURE, GYRO_BIAS, ACCEL_BIAS = range(8)
GNSS_X, GNSS_Y, SPEED_SCALE, SLIP = range(8, 12)
SIZE = 12
ROAD_OFFSET = SIZE
"""Metres to the left of the map's line; only in a filter that has been told of one."""
