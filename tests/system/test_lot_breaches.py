"""A car on a lot does wrong while it is shown things: its stack is told within 200 ms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from foretwin.contracts.drive import GnssFix, SpeedSample
from foretwin.contracts.frames import GeoPoint, LocalFrame, local_from_geo
from tests.system.breach_car import REAL_M, Drove, Heard
from tests.system.breaches import KINDS, Breach, Spoiler, drawn
from tests.system.lot_breaches import StarvedError, held, judged, walker_m

BREACHES = 20
S, MS = 10**9, 10**6
SHUT = "towards the vehicle: shut: nothing heard of the car for 150 ms"
KNOWN = "'/perception/seen: road users that we have shown it': 9"
SILENT = Breach(
    kind="falls silent", amount=0.0, after_s=3.0, speed_mps=8.0, dialect="ros2dds",
    lists="PredictedObjects",
)  # fmt: skip


@pytest.mark.judge
@pytest.mark.timeout(900)
@pytest.mark.parametrize("breach", drawn(BREACHES, seed=0), ids=str)
def test_injection_stops_with_one_empty_list_and_then_silence(
    tmp_path: Path, breach: Breach
) -> None:
    """`python -m tests.system.lot_breaches` draws others."""
    outcome, pace = held(tmp_path, breach)
    print(outcome, pace)
    assert outcome.faults == ()


def heard(at_ms: dict[int, int]) -> list[Heard]:
    """Return lists by milliseconds from the wrong on, of so many each."""
    return [Heard(10 * S + ms * MS, [walker_m()] * count) for ms, count in at_ms.items()]


def faults(at_ms: dict[int, int], *log: str, echoes: int = 9) -> tuple[str, ...]:
    drove = Drove(wrong_ns=10 * S, goes_on_ns=None, heard=heard(at_ms), echoes=echoes)
    return judged(SILENT, drove, log or (SHUT, KNOWN)).faults


def test_what_should_not_be_is_told() -> None:
    assert faults({-90: 1, 10: 1, 110: 1, 160: 0}) == ()
    assert faults({-90: 1, 10: 1, 210: 1, 230: 0}) == (
        "still told of somebody after 0.2 s", "the empty list came late",
    )  # fmt: skip
    assert faults({-90: 1, 10: 1})[0] == "not one empty list"
    assert faults({-90: 1, 10: 1, 90: 0, 190: 0}) == ("not one empty list",)
    assert "no silence after the empty list" in faults({-90: 1, 90: 0, 150: 1})
    elsewhere = "told of somebody else than the one virtual pedestrian"
    assert faults({-90: 1, 10: 2, 90: 0}) == (elsewhere,)
    others = [*heard({-90: 1, 90: 0}), Heard(10 * S, [(REAL_M[0], REAL_M[1])])]
    drove = Drove(wrong_ns=10 * S, goes_on_ns=None, heard=others, echoes=9)
    assert elsewhere in judged(SILENT, drove, (SHUT, KNOWN)).faults
    assert faults({-90: 1, 90: 0}, "towards the vehicle: shut: no word", KNOWN) == (
        "shut for another reason",
    )
    assert faults({-90: 1, 90: 0}, SHUT, SHUT, KNOWN)[0].startswith("no line, or several")
    assert faults({-90: 1, 90: 0}, echoes=10) == ("whom it was shown came back as real",)


@pytest.mark.parametrize("at_ms", [{}, {-90: 1, -10: 0}, {-400: 1, 20: 0}])
def test_a_gate_that_shuts_before_is_no_breach(at_ms: dict[int, int]) -> None:
    with pytest.raises(StarvedError):
        faults(at_ms)


def test_all_kinds_are_drawn_at_other_instants_and_in_both_dialects() -> None:
    cases = drawn(BREACHES, seed=3)
    assert {one.kind for one in cases} == set(KINDS)
    assert {one.dialect for one in cases} == {"ros2dds", "rmw_zenoh"}
    assert len({one.after_s for one in cases}) == BREACHES
    assert cases == drawn(BREACHES, seed=3) != drawn(BREACHES, seed=4)


def of(kind: str, amount: float = 0.0) -> Breach:
    return replace(SILENT, kind=kind, amount=amount)


def test_samples_are_spoilt_as_the_kind_says() -> None:
    here = GeoPoint(48.0, 11.0)
    fix, speed = GnssFix(stamp_ns=S, position=here), SpeedSample(stamp_ns=S, speed_mps=3.0)
    later = replace(fix, stamp_ns=2 * S, position=GeoPoint(48.1, 11.0))

    def said(breach: Breach) -> tuple[Any, Any]:
        return Spoiler(breach).spoilt("gnss", fix), Spoiler(breach).spoilt("speed", speed)

    assert said(of("falls silent")) == (None, None)
    assert said(of("loses its positions")) == (None, speed)
    for kind, stamp_ns in (("sets its clock ahead", 8 * S), ("sets its clock back", -6 * S)):
        assert {one.stamp_ns for one in said(of(kind, 7.0))} == {stamp_ns}
    aside, kept = said(of("stands beside itself", 20.0))
    moved_m = local_from_geo(LocalFrame(here), aside.position.lat_deg, aside.position.lon_deg)
    assert moved_m == pytest.approx((0.0, 20.0), abs=1e-6)
    assert kept is speed
    nowhere, _ = said(of("says positions that are none"))
    assert math.isnan(nowhere.position.lat_deg)
    old, still = (
        Spoiler(of(one)) for one in ("says an old position again", "has a clock that stands")
    )
    for one in (old, still):
        one.spoilt("gnss", fix)
    assert old.spoilt("gnss", later) == replace(later, position=here)
    assert still.spoilt("gnss", later) == replace(later, stamp_ns=S)
    assert Spoiler(of("is heard late", 0.5)).late_ns == S // 2
    assert Spoiler(of("falls silent", 0.5)).late_ns == 0


def test_an_old_position_is_wrong_once_the_car_has_left_it() -> None:
    old = Spoiler(of("says an old position again"))
    old.begin(10.0)
    by_m = [old.is_wrong(10.0 + on_m, 8.0, begun=True) for on_m in (8.0, 9.5)]
    assert by_m == [False, True], "5 m, and the car's own reach"
    assert [Spoiler(SILENT).is_wrong(0.0, 8.0, begun=one) for one in (False, True)] == [False, True]


def test_a_fence_is_too_near_by_the_way_that_the_car_takes_to_stop() -> None:
    ahead = Breach(
        kind="comes too near to the fence ahead", amount=60.0, after_s=3.0, speed_mps=8.0,
        dialect="ros2dds", lists="PredictedObjects",
    )  # fmt: skip
    needed_m = 2.5 * 8.0 + 8.0**2 / 6.8
    by_m = [
        Spoiler(ahead).is_wrong(60.0 - needed_m - left_m, 8.0, begun=False) for left_m in (4.5, 3.0)
    ]
    assert by_m == [False, True], "3.8 m are from base_link to the corner of its front"
