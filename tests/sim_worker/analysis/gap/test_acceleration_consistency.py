"""Since when a departure has been there, and what a sequential test makes of blocks of pushing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.gap.acceleration_consistency import PushTest, _finding
from foretwin.sim_worker.analysis.gap.consistency import change_index
from foretwin.sim_worker.analysis.gap.findings import Finding
from foretwin.sim_worker.analysis.gap.push_blocks import PushBlocks

BLOCK_NS = 200_000_000


@settings(max_examples=30)
@given(begin=st.integers(5, 250), seed=st.integers(0, 5))
def test_a_departure_began_where_it_first_shows(begin: int, seed: int) -> None:
    noise = np.random.default_rng(seed).normal(0.0, 0.05, 300)
    step = np.where(np.arange(300) >= begin, 1.0, 0.0)
    assert change_index((noise + step) ** 2) == pytest.approx(begin, abs=2)


def test_what_has_departed_all_along_began_with_the_stretch() -> None:
    assert change_index(np.ones(50)) == 0
    assert change_index(np.zeros(50)) == 0


def blocks(asked: Array, car: Array, model: Array, *, first: int = 1) -> PushBlocks:
    stamps = (first + np.arange(len(asked), dtype=np.float64)) * BLOCK_NS
    return PushBlocks(stamps, asked, car, model, np.full(len(asked), 8.0), np.full(len(asked), 0.2))


def first_of(every: PushBlocks) -> tuple[int, Finding] | None:
    """Return how many blocks it took, given one by one, and what was found."""
    test = PushTest()
    for count in range(1, len(every.stamp_ns) + 1):
        # The latest two each time, as overlapping stretches give them.
        found = test.handle(PushBlocks(*(column[max(count - 2, 0) : count] for column in every)))
        if found:
            return count, found[0]
    return None


def ever_said_of(every: PushBlocks) -> set[tuple[str, str]]:
    """Return who and what is accused at any time, given blocks one by one."""
    test = PushTest()
    said: set[tuple[str, str]] = set()
    for count in range(1, len(every.stamp_ns) + 1):
        found = test.handle(PushBlocks(*(column[max(count - 2, 0) : count] for column in every)))
        said |= {(one.culprit, one.cause) for one in found}
    return said


def test_a_brake_that_weakens_is_accused_with_the_block_where_it_began() -> None:
    asked = np.tile([-1.5] * 10 + [0.0] * 10 + [1.0] * 10, 2)
    weak = np.where(np.arange(60) >= 30, 0.4, 1.0)
    told = first_of(blocks(asked, np.where(asked < 0.0, weak * asked, asked), asked))
    assert told is not None
    count, found = told
    assert 32 <= count <= 36
    assert (found.culprit, found.cause) == ("vehicle", "brake_gain")
    assert found.since_ns == pytest.approx(30 * BLOCK_NS, abs=BLOCK_NS)


def test_a_brake_that_stops_at_a_plateau_is_told_from_a_weak_one() -> None:
    asked = np.concatenate([[0.0], -np.linspace(0.3, 3.0, 40)])
    told = first_of(blocks(asked, np.maximum(asked, -1.0), asked))
    assert told is not None
    assert (told[1].culprit, told[1].cause) == ("vehicle", "saturated_brake")
    assert "beyond 1.0 m/s²" in told[1].text


def test_brakings_apart_are_counted_together_and_nothing_is_made_of_gains_within_tolerance() -> (
    None
):
    once = [-1.2, -1.2] + [0.0] * 100
    asked = np.array(once * 6)
    assert first_of(blocks(asked, 0.45 * asked, asked)) is not None
    assert first_of(blocks(asked, 0.9 * asked, 1.05 * asked)) is None


def test_drag_is_told_from_a_weak_drive_by_what_happens_while_nothing_is_asked() -> None:
    asked = np.tile([0.0] * 5 + [1.0] * 5, 4)
    told = first_of(blocks(asked, asked, asked - 0.9))
    assert told is not None
    assert (told[1].culprit, told[1].cause) == ("model", "drag")


@pytest.mark.parametrize(
    ("by_car", "off", "culprit", "accused"),
    [
        (0.4, 0.6, "vehicle", "car_brake_gain"),
        (1.0, -0.6, "model", "model_brake_gain"),
        (0.2, 1.3, "both", "model_brake_gain"),
        (1.5, -1.3, "both", "car_brake_gain"),
    ],
)
def test_what_accuses_is_the_comparison_of_who_departs_and_of_both_the_lesser(
    by_car: float, off: float, culprit: str, accused: str
) -> None:
    found = _finding("brake_gain", np.nan, by_car=by_car, off=off, std=0.05, began_ns=0)
    assert (found.culprit, found.deciding.name) == (culprit, accused)


PUSHES = np.tile([0.0] * 8 + [0.5] * 8 + [1.3] * 8 + [-0.6] * 8 + [-1.5] * 8, 3)
SPEED_MPS = 8.0 + 4.0 * np.sin(np.arange(len(PUSHES)) / 7.0)


def driven(
    *, drive: float = 1.0, brake: float = 1.0, drag: float = 0.0, roll: float = 0.0
) -> Array:
    """Return the accelerations of a car with these gains, that loses `drag` at 10 m/s."""
    gained = PUSHES * np.where(PUSHES > 0.0, drive, brake)
    noise = np.random.default_rng(4).normal(0.0, 0.15, len(PUSHES))
    return np.asarray(gained - drag * (SPEED_MPS / 10.0) ** 2 - roll + noise)


@pytest.mark.parametrize(
    ("car", "model", "said"),
    [
        ({"drive": 0.45}, {}, {("vehicle", "drive_gain")}),
        ({"drive": 0.45, "drag": 1.0}, {}, {("vehicle", "drive_gain"), ("vehicle", "drag")}),
        ({"drive": 0.45, "brake": 0.5}, {}, {("vehicle", "drive_gain"), ("vehicle", "brake_gain")}),
        ({"brake": 0.5}, {"drag": 1.5}, {("vehicle", "brake_gain"), ("model", "drag")}),
        ({}, {"drag": 1.0, "drive": 1.7}, {("model", "drive_gain"), ("model", "drag")}),
        ({"drive": 0.88, "brake": 1.15, "drag": 0.1, "roll": 0.15}, {}, set()),
    ],
)
def test_of_several_departures_each_is_named_and_nothing_beside_them(
    car: dict[str, float], model: dict[str, float], said: set[tuple[str, str]]
) -> None:
    every = blocks(PUSHES, driven(**car), driven(**model))._replace(speed_mps=SPEED_MPS)
    assert ever_said_of(every) == said
