"""Digests of results: they notice each bit that matters, under any of the allowed names."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest

from tests.same_bits.injected.result_digests import (
    ACCIDENT_NUMBERS,
    QUANTITIES,
    array_digest,
    content_digest,
    describe_job,
)


def a_result(**changed: Any) -> SimpleNamespace:
    """Two futures of three instants among one road user, with an accident in the second."""
    numbers = dict.fromkeys(ACCIDENT_NUMBERS, 1.0) | {"point_m": np.array([2.0, 3.0])}
    values: dict[str, Any] = {
        "trajectory.states": np.zeros((2, 3, 8), np.float32),
        "trajectory.time_s": np.arange(3.0),
        "outcome.collided": np.array([False, True]),
        "outcome.collision_time_s": np.array([np.nan, 0.2]),
        "outcome.collision_with": np.array([0, 1], np.int32),
        "outcome.min_clearance_m": np.array([1.0, 0.0]),
        "outcome.progress_m": np.array([1.0, 2.0]),
        "outcome.valid": np.array([True, True]),
        "road_users.poses": np.ones((2, 3, 1, 3), np.float32),
        "road_users.speed_mps": np.ones((2, 3, 1), np.float32),
        "road_users.size_m": np.ones((2, 1, 2), np.float32),
        "road_users.kinds": np.array([[0], [1]]),
        "road_users.kind_names": ("car", "cyclist"),
        "metrics": {"ttc": np.array([1.0, np.nan])},
        "accidents": (SimpleNamespace(**numbers),),
        "variant_indices": (0, 1),
    } | changed
    result = SimpleNamespace(
        round_id=3, job_index=0, world_id="w", trajectory=SimpleNamespace(),
        outcome=SimpleNamespace(), road_users=SimpleNamespace(),
    )  # fmt: skip
    for path, value in values.items():
        *owner, name = path.split(".")
        setattr(getattr(result, owner[0]) if owner else result, name, value)
    return result


JOB = SimpleNamespace(accidents=True)


def described(result: Any, job: Any = JOB) -> dict[str, Any]:
    return describe_job({0: job}, result)


def test_a_job_is_known_by_its_round_its_number_its_world_and_its_variants() -> None:
    assert described(a_result())["key"] == "round 3 job 0 world w variants 0-1"
    assert described(a_result(variant_indices=(4, 6)))["key"].endswith("variants 4,6")


def test_every_quantity_is_described() -> None:
    named = {name for name, _ in QUANTITIES}

    assert described(a_result())["parts"].keys() == named | {
        "road_users.kinds", "metric ttc", "accidents",
    }  # fmt: skip


@pytest.mark.parametrize("path", [paths[0].removeprefix("result.") for _, paths in QUANTITIES])
def test_a_single_bit_of_a_quantity_is_noticed(path: str) -> None:
    owner, name = path.split(".")
    values = np.array(getattr(getattr(a_result(), owner), name))
    flipped = values.copy()
    flipped.view(np.uint8)[(-1,) * values.ndim] ^= 1

    before, after = described(a_result())["parts"], described(a_result(**{path: flipped}))["parts"]

    assert sum(before[key] != after[key] for key in before) == 1


def test_metrics_accidents_and_kinds_are_noticed() -> None:
    moved = a_result().accidents[0]
    moved.point_m = np.array([2.0, np.nextafter(3.0, 4.0)])
    before = described(a_result())["parts"]
    changes = {
        "metric ttc": {"metrics": {"ttc": np.array([1.0, 2.0])}},
        "accidents": {"accidents": (moved,)},
        "road_users.kinds": {"road_users.kinds": np.array([[0], [0]])},
    }

    for name, changed in changes.items():
        after = described(a_result(**changed))["parts"]
        assert [key for key in before if before[key] != after[key]] == [name]


def test_words_and_numbers_of_one_meaning_are_the_same() -> None:
    in_words = a_result(**{"outcome.collision_with": np.array(["", "road_user"])})
    in_other_order = a_result(
        **{"road_users.kinds": np.array([[1], [0]]), "road_users.kind_names": ("cyclist", "car")}
    )

    assert described(in_words) == described(in_other_order) == described(a_result())


def test_a_job_that_asks_for_no_accidents_says_nothing_of_them() -> None:
    quiet = described(a_result(accidents=()), SimpleNamespace(accidents=False))["parts"]

    assert "accidents" not in quiet


def test_arrays_differ_by_shape_and_type_but_not_by_the_bits_of_nan() -> None:
    other_nan = np.array([0x7FF8_0000_0000_0001], np.uint64).view(np.float64)

    assert array_digest(other_nan) == array_digest(np.array([np.nan]))
    assert array_digest(other_nan) != array_digest(np.array([0.0]))
    assert array_digest(np.zeros((2, 3))) != array_digest(np.zeros((3, 2)))
    assert array_digest(np.zeros(2)) != array_digest(np.zeros(2, np.float32))
    assert array_digest(np.array([0.0])) != array_digest(np.array([-0.0]))


class Lane(msgspec.Struct):
    id: str
    centre: np.ndarray
    width_m: float | None = None


@dataclasses.dataclass
class SameLane:
    width_m: float | None
    centre: np.ndarray
    id: str


def test_content_counts_and_the_class_that_holds_it_does_not() -> None:
    line = np.arange(6.0).reshape(3, 2)

    assert content_digest(Lane("a", line)) == content_digest(SameLane(None, line, "a"))
    assert content_digest(Lane("a", line)) != content_digest(Lane("a", line, 3.0))
    assert content_digest((Lane("a", line),)) != content_digest((Lane("b", line),))


class LaneWithHeight(msgspec.Struct):
    id: str
    centre: np.ndarray
    width_m: float | None = None
    height_m: float | msgspec.UnsetType = msgspec.UNSET


def test_a_field_that_is_not_set_is_not_there() -> None:
    line = np.arange(6.0).reshape(3, 2)

    assert content_digest(LaneWithHeight("a", line)) == content_digest(Lane("a", line))
    assert content_digest(LaneWithHeight("a", line, None, 1.0)) != content_digest(Lane("a", line))
