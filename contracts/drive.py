"""Messages of the drive: what a vehicle measures, commands and plans, and its estimated state.

Every message carries `stamp_ns`, the vehicle's own clock; `VehicleInfo.time_base` says which.
Drive time is `stamp_ns - VehicleInfo.start_stamp_ns`.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from foretwin.contracts.arrays import Array
from foretwin.contracts.frames import GeoPoint

TimeBase = Literal["utc", "boot", "log"]
ControlMode = Literal["manual", "autonomous", "unknown"]
Gear = Literal["park", "reverse", "neutral", "drive", "unknown"]
Indicator = Literal["off", "left", "right", "hazard", "unknown"]
RoadUserKind = Literal[
    "car", "van", "lorry", "bus", "tram", "motorcycle", "bicycle", "pedestrian", "unknown"
]
SignalColour = Literal["red", "red_amber", "amber", "green", "dark", "unknown"]

Vector3 = tuple[float, float, float]
"""x, y, z in body axes: forward, left, up."""


class VehicleInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of a vehicle before its first sample.

    `body_from_antenna_m` is None where the source does not document it (then taken as zero and
    said so); `speed_sources` and the like name what the vehicle sends.
    """

    vehicle_id: str
    time_base: TimeBase
    start_stamp_ns: int
    end_stamp_ns: int | None = None
    source: str = ""
    reference_point: str = "unknown"
    body_from_antenna_m: Vector3 | None = None
    sends: tuple[str, ...] = ()
    """Channel names the vehicle publishes, such as gnss, imu, speed, steering, control, plan."""


class GnssFix(msgspec.Struct, frozen=True, kw_only=True):
    """One satellite position of the antenna; `std_m` is one horizontal standard deviation."""

    stamp_ns: int
    position: GeoPoint
    std_m: float | None = None


class ImuSample(msgspec.Struct, frozen=True, kw_only=True):
    """Specific force and angular rate in body axes (x forward, y left, z up).

    A gyro without an accelerometer says 0, 0, 0: on Earth none with one does.
    """

    stamp_ns: int
    accel_mps2: Vector3
    rate_radps: Vector3

    @property
    def tells_force(self) -> bool:
        """Whether an accelerometer speaks."""
        return any(self.accel_mps2)


class SpeedSample(msgspec.Struct, frozen=True, kw_only=True):
    """Speed along the body's x axis from wheels or satellites; negative in reverse."""

    stamp_ns: int
    speed_mps: float


class HeadingSample(msgspec.Struct, frozen=True, kw_only=True):
    """A measured heading: yaw of the body's x axis, counter-clockwise from true east."""

    stamp_ns: int
    yaw_rad: float
    yaw_rate_radps: float | None = None


class SteeringSample(msgspec.Struct, frozen=True, kw_only=True):
    """Measured steering, positive to the left: at the steering wheel, at the tyres, or both."""

    stamp_ns: int
    steering_wheel_rad: float | None = None
    tire_angle_rad: float | None = None


class ControlCommand(msgspec.Struct, frozen=True, kw_only=True):
    """What the automated-driving stack asked the vehicle for, positive to the left."""

    stamp_ns: int
    accel_mps2: float
    steering_wheel_rad: float | None = None
    tire_angle_rad: float | None = None
    estimated: bool = False
    """True where nothing was recorded and the command was inferred from the motion."""


class PlannedTrajectory(msgspec.Struct, frozen=True, kw_only=True):
    """The stack's own plan: base_link poses at `stamp_ns + time_from_stamp_s`.

    `time_from_stamp_s` (N,), `lat_deg` (N,), `lon_deg` (N,), `yaw_rad` (N,) from true east,
    `speed_mps` (N,).
    """

    stamp_ns: int
    time_from_stamp_s: Array
    lat_deg: Array
    lon_deg: Array
    yaw_rad: Array
    speed_mps: Array


class RoutePose(msgspec.Struct, frozen=True):
    """Where a route begins or ends, and the yaw there from true east."""

    position: GeoPoint
    yaw_rad: float


class RouteToGoal(msgspec.Struct, frozen=True, kw_only=True):
    """Where the stack is on its way to; said again each second, so that who comes later knows."""

    stamp_ns: int
    start: RoutePose
    goal: RoutePose
    segments: int = 0
    """Of the stack's own map, which nobody else has."""


class VehicleStatus(msgspec.Struct, frozen=True, kw_only=True):
    """Who drives, and how the vehicle is set."""

    stamp_ns: int
    control_mode: ControlMode = "unknown"
    gear: Gear = "unknown"
    indicator: Indicator = "unknown"


class RoadUser(msgspec.Struct, frozen=True, kw_only=True):
    """Another road user, detected or virtual: box centre on the ground, yaw from true east."""

    user_id: str
    kind: RoadUserKind
    position: GeoPoint
    yaw_rad: float
    speed_mps: float
    length_m: float
    width_m: float
    virtual: bool = False


class RoadUsers(msgspec.Struct, frozen=True, kw_only=True):
    """All road users seen at one instant."""

    stamp_ns: int
    users: tuple[RoadUser, ...]


class OthersAround(msgspec.Struct, frozen=True, kw_only=True):
    """Who else is around a vehicle in the World, by that vehicle's own clock, each moving straight
    on."""

    users: RoadUsers
    known_for_s: tuple[float, ...]
    """Of each: so long after the stamp it is within a metre of where that leads."""


class SignalState(msgspec.Struct, frozen=True, kw_only=True):
    """The live colour of one signal group; `group_id` as in the World."""

    stamp_ns: int
    group_id: str
    colour: SignalColour


class DriveEnd(msgspec.Struct, frozen=True, kw_only=True):
    """The vehicle's last word: nothing follows it."""

    stamp_ns: int
    published: dict[str, int]
    """Samples published by channel name."""
    skipped_invalid: int = 0
    """Samples of the source refused before publishing: NaN, (0, 0), time running backwards."""
    reason: str = "end of source"


class VehicleState(msgspec.Struct, frozen=True, kw_only=True):
    """The pose and motion of base_link: the rear-axle centre on the ground (REP-103 axes).

    `yaw_rad` counter-clockwise from true east; `tire_angle_rad` at the road wheels, positive to
    the left; a standard deviation is None where unknown. `estimated` names the fields that were
    not measured.
    """

    vehicle_id: str
    stamp_ns: int
    position: GeoPoint
    yaw_rad: float
    speed_mps: float
    yaw_rate_radps: float
    accel_mps2: float
    tire_angle_rad: float | None = None
    steering_wheel_rad: float | None = None
    position_std_m: float | None = None
    yaw_std_rad: float | None = None
    speed_std_mps: float | None = None
    estimated: tuple[str, ...] = ()
    stale: tuple[str, ...] = ()
    """Channels that the vehicle sends and that are overdue at this instant."""
    map_shift_m: tuple[float, float] | None = None
    """East and north: what the map's roads have moved the position by so far, which is no motion
    of the car; None where the position comes from the vehicle's sensors alone."""
    yaw_valid: bool = True
    """False until the vehicle has moved far enough for a heading to be known."""
    control_mode: ControlMode = "unknown"
    """Who drives, as the vehicle last said."""


class VehicleTime(msgspec.Struct, frozen=True, kw_only=True):
    """What the time is by a vehicle's clock: the stamp of a sample that it would take now."""

    stamp_ns: int


class AdvanceRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Lock step: publish every sample up to and including `until_stamp_ns`, then reply."""

    until_stamp_ns: int


class AdvanceReply(msgspec.Struct, frozen=True, kw_only=True):
    """Lock step: what has been published so far, by channel name; `ended` after the last sample."""

    published: dict[str, int]
    ended: bool


class InfoRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Asks a vehicle for its VehicleInfo."""
