"""The guard at the boundary: what is let in, what is refused and why, and that nothing else comes
out of it."""

from __future__ import annotations

import contextlib
import math
import random
from typing import Any

import msgspec
import numpy as np
import pytest

from foretwin.contracts.bounds import SHAPES
from foretwin.contracts.codec import encode
from foretwin.contracts.drive import (
    GnssFix,
    ImuSample,
    OthersAround,
    PlannedTrajectory,
    RoadUser,
    RoadUsers,
    SpeedSample,
)
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.guard import (
    Refused,
    admit,
    is_identifier,
    is_road_user,
    kept,
    opened,
    reason_in,
)
from foretwin.contracts.keys import CHANNELS
from foretwin.contracts.simulation import WorldNotice
from foretwin.contracts.tuning import ParameterEstimate, SteeringMapBin
from tests.contracts.hostile_messages import hostile_bytes

COVERS = ("foretwin.contracts.bounds",)
KEY = "foretwin/v1/vehicle/ego/telemetry/plan"
HERE = GeoPoint(52.5, 13.4)


def plan(**changed: Any) -> PlannedTrajectory:
    fields = {name: np.ones(4) for name in SHAPES[PlannedTrajectory]}
    return PlannedTrajectory(stamp_ns=1, **(fields | changed))


def user(**changed: Any) -> RoadUser:
    fields = {
        "user_id": "7", "kind": "car", "position": HERE, "yaw_rad": 0.1, "speed_mps": 5.0,
        "length_m": 4.0, "width_m": 1.8,
    }  # fmt: skip
    return RoadUser(**(fields | changed))


def why(message: msgspec.Struct) -> str:
    with pytest.raises(Refused) as refused:
        admit(message, where=KEY)
    assert str(refused.value).startswith(KEY)
    return refused.value.reason


def test_a_message_within_bounds_is_let_in_as_it_is() -> None:
    message = plan()

    assert admit(message, where=KEY) == (message, 0)


def test_arrays_that_belong_together_have_one_length() -> None:
    assert why(plan(yaw_rad=np.ones(3))) == "PlannedTrajectory: yaw_rad of another shape"
    assert why(plan(lat_deg=np.ones((4, 1)))) == "PlannedTrajectory: lat_deg of another shape"
    assert admit(plan(**{name: np.ones(0) for name in SHAPES[PlannedTrajectory]}), where=KEY)


def test_of_each_of_those_around_it_is_said_how_long_it_is_known() -> None:
    users = RoadUsers(stamp_ns=1, users=(user(), user(user_id="8")))
    reason = "OthersAround: known_for_s of another shape"
    assert why(OthersAround(users=users, known_for_s=(1.0,))) == reason
    assert admit(OthersAround(users=users, known_for_s=(1.0, 0.5)), where=KEY)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_are_finite(value: float) -> None:
    assert why(SpeedSample(stamp_ns=1, speed_mps=value)) == "SpeedSample: speed_mps not finite"
    assert why(GnssFix(stamp_ns=1, position=GeoPoint(52.0, value))) == "GnssFix: lon_deg not finite"
    assert why(plan(speed_mps=np.array([1.0, value, 1.0, 1.0]))).endswith("speed_mps not finite")


def test_numbers_are_within_bounds() -> None:
    assert (
        why(GnssFix(stamp_ns=1, position=GeoPoint(90.1, 0.0))) == "GnssFix: lat_deg out of bounds"
    )
    assert why(GnssFix(stamp_ns=2**62 + 1, position=HERE)) == "GnssFix: stamp_ns out of bounds"
    assert why(SpeedSample(stamp_ns=1, speed_mps=1e5)) == "SpeedSample: speed_mps out of bounds"
    shaken = ImuSample(stamp_ns=1, accel_mps2=(0.0, 0.0, -1.1e5), rate_radps=(0.0, 0.0, 0.0))
    assert why(shaken) == "ImuSample: accel_mps2 out of bounds"
    assert admit(GnssFix(stamp_ns=1, position=GeoPoint(90.0, -180.0)), where=KEY)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("speed_mps", "mps"), ("accel_mps2", "mps2"), ("tire_angle_rad", "rad"),
        ("yaw_rate_radps", "radps"), ("alt_m", "m"), ("lat_deg", "lat_deg"),
        ("lon_deg", "lon_deg"),
    ],
)  # fmt: skip
def test_a_number_may_be_as_great_as_its_unit_says(name: str, unit: str) -> None:
    most = {"mps": 1e4, "mps2": 1e5, "rad": 1e5, "radps": 1e4, "m": 1e9, "lat_deg": 90.0,
            "lon_deg": 180.0}[unit]  # fmt: skip
    one = msgspec.defstruct("One", [(name, float)])
    for value in (most, -most):
        assert admit(one(value), where=KEY).message == one(value)
        assert why(one(1.001 * value)) == f"One: {name} out of bounds"


def test_of_what_belongs_together_none_is_missing_alone() -> None:
    estimate = ParameterEstimate(name="mass_kg", value=None, low=None, high=None)
    assert admit(estimate, where=KEY)
    for lone in ("value", "low", "high"):
        changed = msgspec.structs.replace(estimate, **{lone: 1.0})
        assert why(changed) == "ParameterEstimate: value incomplete"


def test_an_array_holds_floats() -> None:
    assert why(plan(speed_mps=np.ones(4, dtype=bool))).endswith("speed_mps no array of floats")


@pytest.mark.parametrize(
    "changed",
    [
        {"speed_mps": math.nan}, {"yaw_rad": math.inf}, {"length_m": 0.0}, {"width_m": 0.0},
        {"width_m": -1.0}, {"length_m": 1e6}, {"speed_mps": 1e3},
        {"position": GeoPoint(math.nan, 13.4)}, {"position": GeoPoint(91.0, 13.4)},
        {"user_id": "x" * 10_000},
    ],
)  # fmt: skip
def test_of_road_users_those_that_cannot_be_are_left_out(changed: dict[str, Any]) -> None:
    good = user()
    seen = RoadUsers(stamp_ns=1, users=(user(**changed), good))

    admitted = admit(seen, where=KEY)

    assert admitted.message == RoadUsers(stamp_ns=1, users=(good,))
    assert admitted.left_out == 1
    arrived = opened(encode(seen, seq=7), RoadUsers, where=KEY)
    assert (arrived.seq, arrived.message, arrived.left_out) == (7, *admitted)


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("length_m", 0.05, 100.0), ("width_m", 0.05, 30.0), ("speed_mps", -120.0, 120.0),
        ("yaw_rad", -100.0, 100.0),
    ],
)  # fmt: skip
def test_a_road_user_is_between_a_childs_arm_and_the_longest_tram(
    name: str, low: float, high: float
) -> None:
    assert is_road_user(user(**{name: low}))
    assert is_road_user(user(**{name: high}))
    assert not is_road_user(user(**{name: low - 0.01}))
    assert not is_road_user(user(**{name: high + 0.01}))


def test_what_may_be_unknown_may_be_nan_and_nothing_else_may() -> None:
    bin_ = SteeringMapBin(
        from_mps=0.0, to_mps=5.0, ratio=math.nan, low=math.nan, high=math.nan, samples=0
    )
    assert admit(bin_, where=KEY)
    around = msgspec.defstruct("Around", [("speed_mps", float), ("bin", SteeringMapBin)])
    assert admit(around(1.0, bin_), where=KEY)
    assert why(around(math.nan, bin_)) == "Around: speed_mps not finite"


def test_too_many_road_users_are_no_message() -> None:
    assert why(RoadUsers(stamp_ns=1, users=(user(),) * 5_001)) == "too many road users"
    assert (
        len(admit(RoadUsers(stamp_ns=1, users=(user(),) * 5_000), where=KEY).message.users) == 5_000
    )


def test_a_text_may_be_twenty_thousand_characters_long() -> None:
    notice = WorldNotice(world_id="w", intersection_id="n4", file="f" * 20_000)
    assert admit(notice, where=KEY).message == notice
    longer = msgspec.structs.replace(notice, file="f" * 20_001)
    assert why(longer) == "WorldNotice: file too long"


def test_a_stamp_may_be_any_until_the_year_2116() -> None:
    last_ns = 2**62
    for stamp_ns in (last_ns, -last_ns):
        assert admit(SpeedSample(stamp_ns=stamp_ns, speed_mps=1.0), where=KEY)
    for stamp_ns in (last_ns + 1, -last_ns - 1):
        sample = SpeedSample(stamp_ns=stamp_ns, speed_mps=1.0)
        assert why(sample) == "SpeedSample: stamp_ns out of bounds"


@pytest.mark.parametrize(
    "name", ["../x", "a/b", "", ".", "a b", "\x1b[2J", "a\\b", "**", "x" * 300]
)
def test_what_names_a_file_or_a_process_is_a_plain_name(name: str) -> None:
    assert not is_identifier(name)
    assert why(WorldNotice(world_id=name, intersection_id="n4", file="f")).endswith("malformed")


def test_a_plain_name_may_be_long() -> None:
    assert is_identifier("w0")
    assert is_identifier("x" * 200)
    assert not is_identifier("x" * 201)
    assert is_road_user(user(user_id="x" * 200))
    assert not is_road_user(user(user_id="x" * 201))


def test_bytes_that_are_no_message_are_refused_with_why() -> None:
    data = encode(SpeedSample(stamp_ns=1, speed_mps=2.0), seq=7, sent_ns=9)
    other = data[:4] + b"\x63" + data[5:]
    for wrong, reason in (
        (b"hello", "no message"),
        (other, "another schema version"),
        (data[:-1], "no valid SpeedSample"),
        (data[:24] + b"\x91" * 100_000, "no valid SpeedSample"),
        (None, "too large"),
        (b"x" * 200_001, "too large"),
    ):
        with pytest.raises(Refused) as refused:
            opened(wrong, SpeedSample, where=KEY, most_bytes=200_000)
        assert refused.value.reason == reason
    assert opened(data, SpeedSample, where=KEY).seq == 7


def test_a_sample_that_was_sent_to_many_keys_is_refused() -> None:
    data = encode(SpeedSample(stamp_ns=1, speed_mps=2.0))
    with pytest.raises(Refused, match="many keys"):
        opened(data, SpeedSample, where="foretwin/v1/**")


def test_what_was_refused_keeps_its_number() -> None:
    data = encode(SpeedSample(stamp_ns=1, speed_mps=math.nan), seq=7, sent_ns=9)
    with pytest.raises(Refused) as refused:
        opened(data, SpeedSample, where=KEY)
    assert refused.value.header == (7, 9)


class Payload(bytes):
    def to_bytes(self) -> bytes:  # type: ignore[override]
        return bytes(self)


def test_what_is_too_large_is_not_even_kept() -> None:
    assert kept(Payload(b"12345"), 5) == b"12345"
    assert kept(Payload(b"123456"), 5) is None
    assert reason_in(Payload(b"no \xff World")) == "no \ufffd World"
    assert reason_in(Payload(b"x" * 10**6)) == "a reason too long to be told"


@pytest.mark.parametrize("channel", sorted(CHANNELS))
def test_a_stranger_gets_a_refusal_or_a_message_and_nothing_else(channel: str) -> None:
    chance = random.Random(channel)
    kind = CHANNELS[channel].kind
    let_in = 0
    for _ in range(150):
        with contextlib.suppress(Refused):
            envelope = opened(hostile_bytes(kind, chance), kind, where=KEY)
            assert isinstance(envelope.message, kind)
            let_in += 1
    assert let_in < 150
