"""What the guard says of what it refuses: of which field, and what it was."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest

from foretwin.contracts.drive import RoadUsers, SpeedSample
from foretwin.contracts.guard import Refused, admit
from foretwin.contracts.simulation import MetRoadUser, RoundView, WorldNotice
from foretwin.contracts.tuning import ParameterEstimate
from tests.contracts.test_guard import KEY, plan, user, why

LONG = "x" * 50


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (
            SpeedSample(stamp_ns=1, speed_mps=-10_001.0),
            "SpeedSample: speed_mps -10001 is beyond ±10000",
        ),
        (SpeedSample(stamp_ns=1, speed_mps=math.inf), "SpeedSample: speed_mps is inf"),
        (
            SpeedSample(stamp_ns=2**62 + 1, speed_mps=0.0),
            "SpeedSample: stamp_ns 4611686018427387905 is out of bounds",
        ),
        (
            WorldNotice(world_id=f"{LONG} ", intersection_id="n4", file="f"),
            f"WorldNotice: world_id '{'x' * 40}' is no plain name",
        ),
        (
            WorldNotice(world_id="w", intersection_id="n4", file="f" * 20_001),
            "WorldNotice: file of 20001 characters",
        ),
        (
            ParameterEstimate(name=LONG, value=None, low=None, high=None),
            f"ParameterEstimate: name '{'x' * 40}' is none of those known",
        ),
        (
            ParameterEstimate(name="mass_kg", value=1.0, low=None, high=2.0),
            "ParameterEstimate: of value, low, high one alone is missing",
        ),
        (
            plan(yaw_rad=np.ones((4, 2))),
            "PlannedTrajectory: yaw_rad has shape (4, 2); (N) would fit where N is 4",
        ),
        (
            plan(yaw_rad=np.array([1.0, math.nan, 1.0, 1.0])),
            "PlannedTrajectory: yaw_rad holds a number that is not finite",
        ),
        (
            plan(yaw_rad=np.array([1.0, -1.5e5, 1.0, 1.0])),
            "PlannedTrajectory: yaw_rad 150000 is beyond ±100000",
        ),
        (plan(yaw_rad=np.ones(4, dtype=int)), "PlannedTrajectory: yaw_rad is an array of int64"),
        (RoadUsers(stamp_ns=1, users=(user(),) * 5_001), "5001 road users"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_a_refusal_says_what_was_wrong(message: msgspec.Struct, said: str) -> None:
    with pytest.raises(Refused) as refused:
        admit(message, where=KEY)
    assert str(refused.value) == f"{KEY}: {said}"
    assert (refused.value.sender, refused.value.header) == (KEY, None)


def test_what_stands_in_a_table_is_looked_at_too() -> None:
    table = msgspec.defstruct("Table", [("sizes_m", dict[str, float]), ("names", list[str])])
    assert admit(table({"a": 1e9}, ["b"]), where=KEY)
    assert why(table({"a": 1.1e9}, [])) == "Table: sizes_m out of bounds"
    assert why(table({"a" * 20_001: 1.0}, [])) == "Table: sizes_m too long"
    assert why(table({}, ["b", "b" * 20_001])) == "Table: names too long"


def view(**changed: object) -> RoundView:
    """Two futures of three points, of which one meets two road users."""
    whole = RoundView(
        round_id=1, stamp_ns=1, intersection_id="n4", world_id="w",
        xy_m=np.zeros((2, 3, 2), np.float32), criticality=np.zeros(2, np.float32),
        likelihood=np.zeros(2, np.float32), nominal_index=0, names=("a", "b"), collided=0,
        min_clearance_m=None, latency_ms=1.0, user_xy_m=np.zeros((2, 3, 2), np.float32),
        touch_xy_m=np.zeros((1, 2), np.float32), touch_names=("c",),
    )  # fmt: skip
    return msgspec.structs.replace(whole, **changed)


MET = MetRoadUser(future=0, time_s=1.0, kind="car")


@pytest.mark.parametrize(
    ("changed", "wrong"),
    [
        ({}, ""), ({"met": (MET, MET)}, ""),
        ({"met": (MET,)}, "met"), ({"met": (MET,) * 3}, "met"),
        ({"names": ("a",)}, "names"), ({"names": ()}, "names"),
        ({"touch_names": ()}, "touch_names"), ({"touch_names": ("c", "d")}, "touch_names"),
        ({"user_xy_m": np.zeros((2, 4, 2), np.float32)}, "user_xy_m"),
        ({"touch_xy_m": np.zeros((1, 3), np.float32)}, "touch_xy_m"),
        ({"criticality": np.zeros((2, 1), np.float32)}, "criticality"),
    ],
)  # fmt: skip
def test_what_belongs_together_has_one_length_and_what_may_be_empty_may_be(
    changed: dict[str, object], wrong: str
) -> None:
    if not wrong:
        assert admit(view(**changed), where=KEY).left_out == 0
        return
    assert why(view(**changed)) == f"RoundView: {wrong} of another shape"
