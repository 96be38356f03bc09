"""The sentence of the display, and each of its parts."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.gap import Culprit, Verdict, limits_after
from foretwin.contracts.simulation import MirrorSample, PlaneState, Progress
from foretwin.viewer.copilot import words
from foretwin.viewer.danger import Danger, dangers_of
from tests.viewer.copilot.rounds import line, round_of

NAME = "Charlottenstraße × Kronenstraße"  # noqa: RUF001
PLACE = PlaneState(0.0, 0.0, 0.0, 8.0)
IN_STEP = MirrorSample(
    stamp_ns=1,
    world_id=None,
    real=PLACE,
    twin=PLACE,
    shadow=PLACE,
    ghost=PLACE,
    gap_m=0.1,
    gap_along_m=-0.1,
    gap_across_m=0.05,
    gap_yaw_rad=0.001,
    gap_speed_mps=0.1,
    since_reset_s=3.0,
    independent=True,
)
AHEAD = Progress(
    stamp_ns=1,
    drive_time_s=32.0,
    mission_state="following",
    next_intersection=NAME,
    arrival_in_s=4.2,
    arrival_early_s=3.0,
    arrival_late_s=6.4,
    junction_id="n4",
    junction_control="give_way",
    junction_m=40.0,
    futures_per_s=128.0,
    dropped=0,
)
CAR = Danger(3, "car from the right", 0.12, 1e-3, 2.6, True, "danger")


def verdict(culprit: Culprit) -> Verdict:
    return Verdict(
        vehicle_id="ego",
        stamp_ns=1,
        since_stamp_ns=1,
        culprit=culprit,
        cause="steering_gain",
        text="steering turns 12 % less than told",
        evidence=(),
        confidence=0.99,
    )


def changed(message: msgspec.Struct, **fields: object) -> object:
    return msgspec.structs.replace(message, **fields)


def test_one_sentence_says_when_where_who_waits_what_threatens_and_the_twin() -> None:
    said = words.sentence(AHEAD, "give way", CAR, words.standing_of(IN_STEP, None), elapsed_s=0.5)
    assert said == (
        f"4 s · {NAME} · give way · greatest danger: car from the right, 12 %, 2.1 s · twin in step"
    )


def test_the_danger_that_is_told_is_the_greatest_and_need_not_be_the_likeliest() -> None:
    """Somebody on foot who hardly comes, but would be killed, ranks before a car that does come."""
    foot, car = line((20.0, -20.0), (0.0, 10.0)), line((20.0, 20.0), (0.0, -10.0))
    seen = round_of(("pedestrian", foot, 5e-3), ("car", car, 2e-3))
    seen = msgspec.structs.replace(seen, likelihood=np.array([1.0, 0.006, 0.9], dtype=np.float32))
    first, second = dangers_of(seen)

    assert (first.odds, second.odds) == ("1 in 200", "90 %")
    said = words.sentence(AHEAD, "give way", first, words.standing_of(IN_STEP, None))
    assert "greatest danger: pedestrian from the right, 1 in 200" in said


@pytest.mark.parametrize(
    ("progress", "known", "said"),
    [
        (None, True, "waiting for the drive"),
        ({"arrival_in_s": None}, True, f"waiting · {NAME} · give way · no danger found"),
        ({"next_intersection": None}, False, "no junction ahead · no futures now"),
    ],
)
def test_what_is_not_known_is_said(
    progress: dict[str, object] | None, known: bool, said: str
) -> None:
    told = None if progress is None else changed(AHEAD, **progress)
    standing = words.standing_of(IN_STEP, None)
    sentence = words.sentence(told, "give way", None, standing, known=known)
    assert sentence.removesuffix(" · twin in step") == said


@pytest.mark.parametrize(
    ("in_s", "said"), [(0.3, "0 s"), (9.6, "10 s"), (98.9, "99 s"), (150.0, "2 min")]
)
def test_arrival_is_short(in_s: float, said: str) -> None:
    assert words.arrival(changed(AHEAD, arrival_in_s=in_s)) == said


def test_its_span_stands_beside_it() -> None:
    assert words.arrival_span(AHEAD) == "3 to 6 s"
    assert words.arrival_span(changed(AHEAD, arrival_late_s=None)) == "3 s or later"
    assert words.arrival_span(changed(AHEAD, arrival_early_s=None)) == ""
    assert words.arrival_span(changed(AHEAD, arrival_in_s=None)) == ""


def test_seconds_left_run_out_at_none() -> None:
    assert words.danger_text(CAR, elapsed_s=9.0) == "car from the right, 12 %, 0.0 s"
    near = CAR._replace(hits=False)
    assert words.danger_text(near) == "car from the right, near miss, 12 %, 2.6 s"
    assert words.danger_text(None) == "no danger found"


@pytest.mark.parametrize(
    ("gap", "said"),
    [
        ({"gap_along_m": -9.0}, "twin 9.0 m behind"),
        ({"gap_along_m": 9.0}, "twin 9.0 m ahead"),
        ({"gap_across_m": 5.0}, "twin 5.0 m left"),
        ({"gap_across_m": -5.0}, "twin 5.0 m right"),
        ({"gap_yaw_rad": 0.5}, "twin 29° left"),
        ({"gap_yaw_rad": -0.5}, "twin 29° right"),
        ({"gap_speed_mps": 5.0}, "twin 18 km/h fast"),
        ({"gap_speed_mps": -5.0}, "twin 18 km/h slow"),
    ],
)
def test_a_twin_beyond_its_limit_says_how(gap: dict[str, float], said: str) -> None:
    standing = words.standing_of(changed(IN_STEP, **gap), None)
    assert standing == words.TwinStanding(said, "beyond its limit", False)


def test_the_limit_is_that_of_the_one_table_and_grows_with_time() -> None:
    limit_m = limits_after(IN_STEP.since_reset_s)["along_m"]
    within = changed(IN_STEP, gap_along_m=0.99 * limit_m)
    beyond = changed(IN_STEP, gap_along_m=1.01 * limit_m)
    assert words.standing_of(within, None).well
    assert not words.standing_of(beyond, None).well


def test_estimated_commands_prove_nothing_and_are_said_to() -> None:
    estimated = changed(IN_STEP, independent=False)
    apart = changed(IN_STEP, independent=False, gap_along_m=9.0)
    proof = "commands estimated: no proof"
    assert words.standing_of(estimated, None) == ("twin in step", proof, True)
    assert words.standing_of(apart, None) == ("twin apart", proof, True)
    assert words.standing_of(None, None).text == "no twin yet"


@pytest.mark.parametrize(
    ("culprit", "said"),
    [("vehicle", "vehicle departs"), ("model", "model is off"), ("both", "vehicle and model off")],
)
def test_a_verdict_counts_for_more_than_a_gap(culprit: Culprit, said: str) -> None:
    standing = words.standing_of(IN_STEP, verdict(culprit))
    assert standing == (said, "steering turns 12 % less than told", False)
    assert words.standing_of(IN_STEP, verdict("none")).text == "twin in step"


def test_names_of_strangers_command_nothing() -> None:
    hostile = changed(AHEAD, next_intersection="\u202egnp.exe\x1b[2J")
    said = words.sentence(hostile, "", None, words.standing_of(IN_STEP, None))
    assert "\u202e" not in said
    assert "\x1b" not in said
