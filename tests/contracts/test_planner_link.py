"""The link between a worker and a driving stack: its version."""

from __future__ import annotations

from foretwin.contracts.codec import decode, encode
from foretwin.contracts.planner_link import LINK_VERSION, PlannedMotions, PlannerJoined, other_link
from tests.sim_worker.planners.a_stack import TIME_S


def test_another_version_is_named_with_what_to_do() -> None:
    assert other_link(LINK_VERSION) is None
    assert other_link(1) == (
        "it speaks version 1 of the planner link, this foretwin version 2: update the older of the "
        "two"
    )


def test_who_says_no_version_speaks_the_first() -> None:
    whole = PlannedMotions(
        job=0, question=1, futures=(), time_s=TIME_S, xy_m=TIME_S, yaw_rad=TIME_S, speed_mps=TIME_S
    )
    assert decode(encode(whole), PlannedMotions).message.link == 1
    assert PlannerJoined(name="a", version="1").link == 1
