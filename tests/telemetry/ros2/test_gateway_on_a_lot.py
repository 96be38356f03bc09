"""A car on an empty lot: heard in the World, and told of its lot what is in the World."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import msgspec
import pytest

from foretwin.contracts.anchor import Anchor, AnchorPose
from foretwin.contracts.bus import Mailbox
from foretwin.contracts.drive import RoadUser, RoadUsers, VehicleState
from foretwin.contracts.frames import geo_pose
from foretwin.contracts.simulation import PlaneState
from foretwin.contracts.towards_vehicle import Authority, GateReason
from foretwin.telemetry.ros2.lot_guard import LotGuard
from foretwin.telemetry.ros2.names import dds_type
from foretwin.telemetry.ros_messages.objects import predicted_from_users
from foretwin.telemetry.ros_messages.parts import (
    CONTROL,
    ODOMETRY,
    PREDICTED_OBJECTS,
    typestore,
    yaw_of,
)
from tests.contracts.mirror_samples import mirror_sample
from tests.telemetry.ros2.gateway_ground import FIX_KEY, STEERING_KEY, fix, steering
from tests.telemetry.ros2.test_gateway import Ground, S, state

COVERS = ("foretwin.telemetry.ros2.inwards",)

ANCHOR = Anchor(
    lot=AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0),
    world=AnchorPose(lat_deg=48.1, lon_deg=11.5, yaw_deg=90.0),
    scale=10.0,
)
"""East on the lot is north in the World, and a metre ten."""


def test_a_car_on_a_lot_is_heard_in_the_world_and_told_of_its_lot() -> None:
    ground = Ground(enabled=True, flag=True, anchor=ANCHOR)
    ground.arrive(FIX_KEY, fix(5 * S, 52.5, 13.4))
    heard = ground.inbox.take()
    assert heard is not None
    at = heard.message()
    assert (at.position.lat_deg, at.position.lon_deg) == pytest.approx((48.1, 11.5), abs=1e-9)
    assert at.std_m == pytest.approx(2.0)

    north = geo_pose(ANCHOR.world.frame, 0.0, 50.0, math.pi / 2)
    ground.say_everything()
    ground.step(100.0)
    moving = msgspec.structs.replace(
        state(6 * S), position=north.position, yaw_rad=north.yaw_rad, speed_mps=8.0
    )
    ground.bus.publish("state", moving, vehicle="ego")
    user = RoadUser(
        user_id="u", kind="pedestrian", position=north.position, yaw_rad=north.yaw_rad,
        speed_mps=1.5, length_m=5.0, width_m=5.0, virtual=True,
    )  # fmt: skip
    ground.bus.publish("virtual_objects", RoadUsers(stamp_ns=6 * S, users=(user,)), run="r")
    ground.step()
    (seen,) = read(PREDICTED_OBJECTS, ground.foreign.on("/perception/objects")[-1]).objects
    pose = seen.kinematics.initial_pose_with_covariance.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((5.0, 0.0), abs=1e-3)
    assert yaw_of(pose.orientation) == pytest.approx(0.0, abs=1e-5)
    assert seen.kinematics.initial_twist_with_covariance.twist.linear.x == pytest.approx(0.15)
    (control,) = ground.foreign.on("/control/cmd")
    # 99 m/s in the World are 9.9 on the lot, and its bound is 8.
    speed = read(CONTROL, control).longitudinal.velocity
    assert speed == pytest.approx(8.0)


def test_the_twin_of_a_car_on_a_lot_is_on_the_lot() -> None:
    anchor = msgspec.structs.replace(
        ANCHOR, world=AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=90.0)
    )
    ground = Ground(enabled=False, flag=False, anchor=anchor)
    ground.bus.publish(
        "mirror", mirror_sample(6 * S, PlaneState(0.0, 20.0, math.pi / 2, 7.0)), run="r"
    )
    ground.step()
    odometry = read(ODOMETRY, ground.foreign.on("/foretwin/twin")[0])
    pose = odometry.pose.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((2.0, 0.0), abs=1e-3)
    assert odometry.twist.twist.linear.x == pytest.approx(0.7)


def read(kind: str, payload: bytes) -> Any:
    return typestore().deserialize_cdr(payload, kind)


PLAIN = Anchor(lot=AnchorPose(lat_deg=52.5, lon_deg=13.4, yaw_deg=0.0), world=ANCHOR.world)
FENCE_M = ((-150.0, -60.0), (150.0, -60.0), (150.0, 60.0), (-150.0, 60.0))
MS = 10**6
SEEN = """
[[in]]
topic = "/perception/seen"
type = "autoware_perception_msgs/msg/PredictedObjects"
channel = "objects"
"""


class Lot:
    """A car on its lot, told ten times a second of somebody, and heard of fifty times."""

    def __init__(self, *, more: str = "") -> None:
        corners = [geo_pose(PLAIN.lot.frame, *one, 0.0).position for one in FENCE_M]
        fence = [(one.lat_deg, one.lon_deg) for one in corners]
        guard = LotGuard(fence, frame=PLAIN.lot.frame, reach_m=4.0)
        self.ground = Ground(enabled=True, flag=True, anchor=PLAIN, guard=guard, more=SEEN + more)
        self.x_m, self.y_m, self.speed_mps, self.stale = 0.0, 0.0, 5.0, ()
        self.says, self.states, self.clock_stands, self.authority = True, True, False, True
        self.leap_m = 0.0
        self.stamp_ns = 5 * S
        self._tick = 0

    def change(self, values: dict[str, Any]) -> None:
        """Set how the car is from now on."""
        for name, value in values.items():
            setattr(self, name, value)

    def go_on(self, ticks: int = 1) -> None:
        """Let so many steps of 10 ms pass."""
        for _ in range(ticks):
            self._tick += 1
            self.ground.now_ns += 10 * MS
            if not self.clock_stands:
                self.stamp_ns += 10 * MS
            if self.says:
                payload = steering(self.stamp_ns, 0.1)
                self.ground.foreign.arrive(
                    STEERING_KEY + "RIHS01_x", payload, mono_ns=self.ground.now_ns
                )
            if self.says and self._tick % 10 == 0:
                at = geo_pose(PLAIN.lot.frame, self.x_m, self.y_m + self.leap_m, 0.0).position
                payload = fix(self.stamp_ns, at.lat_deg, at.lon_deg)
                self.ground.foreign.arrive(FIX_KEY, payload, mono_ns=self.ground.now_ns)
            if self.states and self._tick % 2 == 0:
                self.ground.bus.publish("state", self._state(), vehicle="ego")
            if self.authority and self._tick % 5 == 0:
                word = Authority(sent_mono_ns=self.ground.now_ns)
                self.ground.orders.say(self.ground.bus, word)
            if self._tick % 5 == 3:
                channel = "virtual_traffic" if self._tick % 10 == 3 else "virtual_objects"
                users = RoadUsers(stamp_ns=self.stamp_ns, users=(WALKER,))
                self.ground.bus.publish(channel, users, run="r")
            self.ground.step()

    def _state(self) -> VehicleState:
        at = geo_pose(PLAIN.lot.frame, self.x_m, self.y_m, 0.0)
        there = PLAIN.world_from_lot(at.position, at.yaw_rad)
        return msgspec.structs.replace(
            state(self.stamp_ns), position=there.position, yaw_rad=there.yaw_rad,
            speed_mps=self.speed_mps, stale=self.stale,
        )  # fmt: skip

    def lists(self) -> list[int]:
        """How many road users each list towards the car has held."""
        sent = self.ground.foreign.on("/perception/objects")
        return [len(read(PREDICTED_OBJECTS, payload).objects) for payload in sent]


WALKER = RoadUser(
    user_id="w", kind="pedestrian", position=PLAIN.world.frame.origin, yaw_rad=0.0, speed_mps=0.0,
    length_m=0.5, width_m=0.6, virtual=True,
)  # fmt: skip


class Breach(NamedTuple):
    """Why the gate shuts, what goes wrong, and where the car is well before: from there on to near
    the fence no position leaps."""

    reason: GateReason
    wrong: dict[str, Any]
    before: dict[str, Any] = {}  # noqa: RUF012


BREACHES = {
    "over the northern fence": Breach("outside the fence", {"y_m": 60.5}),
    "over the southern fence": Breach("outside the fence", {"y_m": -61.0}),
    "over the eastern fence": Breach("outside the fence", {"x_m": 151.0}),
    "over the western fence": Breach("outside the fence", {"x_m": -150.1}),
    "over a corner": Breach("outside the fence", {"x_m": 150.1, "y_m": 60.1}),
    "far away": Breach("outside the fence", {"x_m": 5000.0}),
    "with a wheel on the fence": Breach(
        "near the fence", {"y_m": 57.0}, {"y_m": 50.0, "speed_mps": 0.0}
    ),
    "near the northern fence": Breach("near the fence", {"y_m": 45.0}, {"y_m": 38.0}),
    "near the eastern fence": Breach("near the fence", {"x_m": 135.0}, {"x_m": 128.0}),
    "near the fence, backwards": Breach(
        "near the fence", {"x_m": 135.0}, {"x_m": 128.0, "speed_mps": -5.0}
    ),
    "too fast for the lot": Breach("near the fence", {"speed_mps": 14.0}),
    "much too fast": Breach("near the fence", {"speed_mps": 40.0}),
    "rather fast near the fence": Breach("near the fence", {"speed_mps": 8.0}, {"y_m": 30.0}),
    "no state any more": Breach("state stale", {"states": False}),
    "no sample any more": Breach("car not heard", {"says": False}),
    "neither": Breach("state stale", {"states": False, "says": False}),
    "a clock that stands": Breach("state stale", {"clock_stands": True}),
    "a position that leaps": Breach("position apart", {"leap_m": 12.0}),
    "a position that leaps near the fence": Breach(
        "position apart", {"leap_m": 12.0}, {"y_m": 38.0}
    ),
    "a position that leaps over the fence": Breach(
        "position apart", {"leap_m": 25.0}, {"y_m": 38.0}
    ),
    "a state that leaps towards the fence": Breach("position apart", {"y_m": 45.0}),
    "positions overdue": Breach("positions overdue", {"stale": ("gnss",)}),
    "positions and all overdue": Breach("positions overdue", {"stale": ("gnss", "imu", "speed")}),
    "nobody in charge": Breach("word overdue", {"authority": False}),
}


@pytest.mark.parametrize("breach", BREACHES)
def test_a_breach_ends_with_one_empty_list_within_200_ms(breach: str) -> None:
    lot = Lot()
    lot.change(BREACHES[breach].before)
    lot.go_on(100)
    assert lot.ground.gateway.gate.state == "open"
    assert lot.lists().count(1) >= 15, "both channels go out"
    assert lot.lists().count(0) == 0
    lot.change(BREACHES[breach].wrong)
    after_ms = 0
    while 0 not in lot.lists():
        lot.go_on()
        after_ms += 10
        assert after_ms < 200, f"{breach}: still told of somebody"
    assert lot.lists()[-1] == 0
    assert lot.ground.gateway.gate.reason == BREACHES[breach].reason
    told = len(lot.lists())
    # Well again, and even so silent: only a new drive opens another gate.
    well = vars(Lot()).items()
    kept = "ground", "stamp_ns"
    lot.change({key: one for key, one in well if not key.startswith("_") and key not in kept})
    lot.go_on(100)
    assert (len(lot.lists()), lot.ground.gateway.gate.state) == (told, "shut")


def test_outside_its_fence_a_car_is_told_nothing_at_all() -> None:
    lot = Lot()
    lot.y_m = 70.0
    lot.go_on(100)
    assert (lot.lists(), lot.ground.gateway.gate.state) == ([], "waiting")
    assert lot.ground.gateway.gate.why == "the car is outside its fence"
    lot.y_m = 0.0
    lot.go_on(20)
    assert lot.ground.gateway.gate.state == "open"


def test_what_the_car_was_shown_is_not_taken_for_real() -> None:
    """Its perception says again what went out: none of that comes back as detected."""
    lot = Lot()
    seen = Mailbox(100)
    lot.ground.bus.subscribe("objects", seen, vehicle="ego")
    lot.go_on(50)
    echoes = lot.ground.foreign.on("/perception/objects")
    key = f"0/perception/seen/{dds_type(PREDICTED_OBJECTS)}/RIHS01_x"
    real = replaced(
        WALKER, user_id="0123456789abcdef0123456789abcdef", position=PLAIN.lot.frame.origin
    )
    theirs = predicted_from_users(RoadUsers(stamp_ns=5 * S, users=(real,)), PLAIN.lot.frame)
    both = read(PREDICTED_OBJECTS, echoes[-1])
    both.objects = [*both.objects, *theirs.objects]
    for payload in (*echoes, bytes(typestore().serialize_cdr(both, PREDICTED_OBJECTS))):
        lot.ground.foreign.arrive(key, payload, mono_ns=lot.ground.now_ns)
        lot.ground.step()
    heard = []
    while (item := seen.take()) is not None:
        heard += item.message().users
    (one,) = heard
    assert (one.user_id, one.virtual) == (real.user_id, False)
    # The car's lot is a place of the World.
    assert (one.position.lat_deg, one.position.lon_deg) == pytest.approx((48.1, 11.5), abs=1e-7)
    counted = lot.ground.gateway.report()["unused"]
    assert counted["/perception/seen: road users that we have shown it"] == len(echoes) + 1


def replaced(user: RoadUser, **changed: Any) -> RoadUser:
    return msgspec.structs.replace(user, **changed)
