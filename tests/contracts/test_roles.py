"""Roles in the mirror, and how hard a twin may be drawn."""

from __future__ import annotations

import math

import msgspec
import pytest

from foretwin.contracts.roles import CORRECTIONS, ROLES, FollowLimits


def test_the_words_for_roles_and_corrections() -> None:
    assert ROLES == ("all", "twin", "shadow", "ghost")
    assert CORRECTIONS == ("free", "follow")


def test_a_limit_may_be_as_good_as_none() -> None:
    most = dict.fromkeys(FollowLimits.__struct_fields__, 999_999.5)
    assert FollowLimits(**most).trouble() is None


def test_the_limits_that_count_without_a_word_are_sound() -> None:
    assert FollowLimits().trouble() is None


@pytest.mark.parametrize("value", [0.0, -1.0, 1e6, math.nan, math.inf])
@pytest.mark.parametrize("name", FollowLimits.__struct_fields__)
def test_a_limit_is_above_zero_and_finite(name: str, value: float) -> None:
    assert FollowLimits(**{name: value}).trouble() == f"{name} {value}: above 0"


@pytest.mark.parametrize(
    ("jerk", "accel"),
    [("jerk_mps3", "accel_mps2"), ("yaw_jerk_radps3", "yaw_accel_radps2")],
)
def test_a_jerk_is_bounded_by_its_acceleration(jerk: str, accel: str) -> None:
    assert FollowLimits(**{accel: 1.0, jerk: 60.0}).trouble() is None
    told = FollowLimits(**{accel: 1.0, jerk: 61.0}).trouble()
    assert told == f"{jerk} 61.0: at most 60 times the acceleration"


def test_a_limit_that_there_is_not_is_refused() -> None:
    with pytest.raises(msgspec.ValidationError, match="unknown field `acel_mps2`"):
        msgspec.convert({"acel_mps2": 1.0}, FollowLimits)
