"""What kinds of sensors measure: the table of a sensor file that says which kind it is."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import msgspec

from foretwin.contracts.numbers import Range
from foretwin.contracts.point_cloud import MOST_RAYS
from foretwin.contracts.sensor_drift import Drift


class Lidar(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A lidar that turns: its rings, its azimuths, how far and how well it measures."""

    elevation_deg: tuple[float, ...]
    """Of each ring above the sensor's own plane, from the lowest ring on."""
    azimuths: int
    """Firings of each ring in one turn."""
    rate_hz: float = 10.0
    """Turns in a second."""
    turns: Literal["clockwise", "counter_clockwise"] = "clockwise"
    """Seen from above; a turn begins to the rear."""
    min_range_m: float = 0.5
    """Nothing nearer is measured."""
    max_range_m: float
    """Nothing farther is measured, however bright."""
    seen_to_m: float
    """How far a surface of `seen_reflectivity`, struck squarely, is still seen; darker or more
    slanting ones less far, by the square root."""
    seen_reflectivity: float = 0.8
    """Share of the light that that surface gives back."""
    range_std_m: float
    """Of ranges: one standard deviation of white noise."""
    dropout: float = 0.0
    """Share of firings that are lost, evenly at random."""


class Radar(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A radar that lists what moves on the road: where it looks, how far and how well."""

    rate_hz: float
    """Lists in a second."""
    field_of_view_deg: float
    """Across, half of it to each side."""
    elevation_of_view_deg: float = 20.0
    """Upright, half of it above and half below the sensor's own plane."""
    min_range_m: float = 0.5
    """Nothing nearer is measured."""
    max_range_m: float
    """Nothing farther is measured, however large."""
    seen_to_m: float
    """Where a body of `seen_rcs_dbsm` is found in `seen_share` of the lists; others by the fourth
    power of the distance."""
    seen_rcs_dbsm: float = 10.0
    """Radar cross section of that body: of a car."""
    seen_share: float = 0.9
    """How often that body is found there."""
    false_alarm: float = 1e-6
    """How likely noise alone is taken for something, in one cell: with `seen_share` it says how
    quickly bodies are lost beyond `seen_to_m`."""
    range_std_m: float
    """Of ranges: one standard deviation of white noise."""
    azimuth_std_deg: float
    """Of angles across, likewise."""
    elevation_std_deg: float | None = None
    """Of angles upright; left out: the radar does not measure them and says 0."""
    range_rate_std_mps: float
    """Of range rates, likewise."""
    ghosts: float = 0.0
    """Share of what is found that comes once more by way of the car's own front: at twice the range
    and range rate, 20 dB weaker."""
    clutter: float = 0.0
    """How many things that are not there a list holds in the mean: they stand anywhere in view."""


class Camera(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A camera: how large its pictures are and how much is in them; it looks along its own x axis,
    by a pinhole without distortion."""

    rate_hz: float
    """Pictures in a second."""
    width_px: int
    """Of a picture."""
    height_px: int
    """Of a picture; pixels are square."""
    field_of_view_deg: float
    """Across, half of it to each side."""
    jpeg_quality: int = 85
    """Of what is told in a drive."""

    @property
    def focal_px(self) -> float:
        """How far the picture is from the pinhole."""
        return self.width_px / 2.0 / math.tan(math.radians(self.field_of_view_deg) / 2.0)


class Gnss(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A satellite receiver, whose antenna sits at the mount: positions, white noise and drift."""

    rate_hz: float
    """Positions in a second; more than the car's states are not told."""
    std_m: float
    """Of positions, along each axis on the ground: one standard deviation of white noise."""
    up_std_m: float = 0.0
    """Of heights, likewise."""
    drift: Drift = Drift()
    """Of positions, along each axis on the ground, in m."""


class Imu(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An inertial sensor in the axes of its mount: specific forces and rates."""

    rate_hz: float
    """Samples in a second; more than the car's states are not told."""
    gyro_std_radps: float
    """Of rates, along each axis: one standard deviation of white noise."""
    accel_std_mps2: float
    """Of specific forces, likewise."""
    gyro_bias_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Added to the rates."""
    accel_bias_mps2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Added to the specific forces."""
    gyro_drift: Drift = Drift()
    """Of rates, along each axis, in rad/s."""
    accel_drift: Drift = Drift()
    """Of specific forces, along each axis, in m/s²."""


Kind = Lidar | Radar | Camera | Gnss | Imu
"""What a sensor measures."""
KINDS: Mapping[str, type[Kind]] = MappingProxyType(
    {"lidar": Lidar, "radar": Radar, "camera": Camera, "gnss": Gnss, "imu": Imu}
)
"""By the name of their table."""
RANGES: Mapping[type[Kind], Mapping[str, Range]] = MappingProxyType(
    {
        Lidar: {
            "azimuths": Range(1, MOST_RAYS),
            "rate_hz": Range(0.1, 100.0),
            "min_range_m": Range(0.0, 2000.0),
            "max_range_m": Range(0.1, 2000.0),
            "seen_to_m": Range(0.1, 2000.0),
            "seen_reflectivity": Range(0.001, 1.0),
            "range_std_m": Range(0.0, 10.0),
            "dropout": Range(0.0, 1.0),
        },
        Radar: {
            "rate_hz": Range(0.1, 100.0),
            "field_of_view_deg": Range(0.1, 360.0),
            "elevation_of_view_deg": Range(0.1, 180.0),
            "min_range_m": Range(0.0, 2000.0),
            "max_range_m": Range(0.1, 2000.0),
            "seen_to_m": Range(0.1, 2000.0),
            "seen_rcs_dbsm": Range(-50.0, 60.0),
            "seen_share": Range(0.01, 0.9999),
            "false_alarm": Range(1e-12, 0.009),
            "range_std_m": Range(0.0, 10.0),
            "azimuth_std_deg": Range(0.0, 20.0),
            "elevation_std_deg": Range(0.0, 20.0),
            "range_rate_std_mps": Range(0.0, 10.0),
            "ghosts": Range(0.0, 1.0),
            "clutter": Range(0.0, 1000.0),
        },
        Camera: {
            "rate_hz": Range(0.1, 100.0),
            "width_px": Range(16, 4096),
            "height_px": Range(16, 4096),
            "field_of_view_deg": Range(1.0, 170.0),
            "jpeg_quality": Range(1, 95),
        },
        Gnss: {
            "rate_hz": Range(0.1, 100.0),
            "std_m": Range(0.0, 100.0),
            "up_std_m": Range(0.0, 100.0),
        },
        Imu: {
            "rate_hz": Range(0.1, 100.0),
            "gyro_std_radps": Range(0.0, 10.0),
            "accel_std_mps2": Range(0.0, 100.0),
        },
    }
)
"""What the numbers of each kind may be."""


def check_kind(name: str, kind: Kind) -> None:
    """Raise ValueError naming the first key of a table `name` that no sensor has so."""
    if isinstance(kind, Lidar):
        _check_rings(kind)
    for key, allowed in RANGES[type(kind)].items():
        value = getattr(kind, key)
        if value is not None and not allowed.admits(value):
            raise ValueError(f"{name}.{key} {value:g}: {allowed}")
    if isinstance(kind, Lidar | Radar) and kind.min_range_m >= kind.max_range_m:
        raise ValueError(f"{name}.min_range_m {kind.min_range_m:g}: below {name}.max_range_m")


def _check_rings(lidar: Lidar) -> None:
    elevations = lidar.elevation_deg
    if not elevations or not all(-90.0 < one < 90.0 for one in elevations):
        raise ValueError("lidar.elevation_deg: one or more angles between -90 and 90")
    if any(b <= a for a, b in itertools.pairwise(elevations)):
        raise ValueError("lidar.elevation_deg: from the lowest ring to the highest")
    if lidar.azimuths * len(elevations) > MOST_RAYS:
        raise ValueError(f"lidar.azimuths {lidar.azimuths}: at most {MOST_RAYS} rays in a turn")
