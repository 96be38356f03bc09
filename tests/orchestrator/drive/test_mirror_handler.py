"""Touches in the mirror: each told once as it begins, all kept."""

from __future__ import annotations

from typing import Any

import pytest

from foretwin.contracts.simulation import MirrorSample, PlaneState
from foretwin.orchestrator.drive.mirror_handler import MirrorHandler
from foretwin.orchestrator.instructions import Notice
from tests.contracts.mirror_samples import mirror_sample

HERE = PlaneState(0.0, 0.0, 0.0, 0.0)


class Tables:
    def __init__(self) -> None:
        self.rows: dict[str, int] = {}

    def add(self, table: str, rows: list[dict[str, Any]]) -> None:
        self.rows[table] = self.rows.get(table, 0) + len(rows)


def sample(at_s: float, *touches: tuple[str, str], **changes: Any) -> MirrorSample:
    return mirror_sample(round(at_s * 1e9), HERE, touches=touches, **changes)


def test_a_touch_is_told_as_it_begins_and_again_only_after_a_while() -> None:
    tables, told = Tables(), list[Notice]()
    handler = MirrorHandler(tables, told.append, "ego")  # type: ignore[arg-type]
    for at_s in (1.0, 1.1, 1.2, 2.5, 5.0):
        handler.take(sample(at_s, ("ego", "van")))
    handler.take(sample(5.1, ("ego", "van"), ("ego", "world"), ("van", "world")))
    assert [tell.text for tell in told] == [
        "in the mirror, ego and van touch",
        "in the mirror, ego and van touch",
        "in the mirror, the twin of ego touches what stands, 0.0 m off the car",
        "in the mirror, the twin of van touches what stands",
    ]
    assert handler.touches == 4
    assert tables.rows == {"mirror": 6, "touches": 8}
    assert (handler.stamp_ns, handler.independent) == (5_100_000_000, True)


def test_a_twin_that_touches_is_told_with_its_distance_before_it_was_set_back() -> None:
    told = list[Notice]()
    handler = MirrorHandler(Tables(), told.append, "ego")  # type: ignore[arg-type]
    handler.take(sample(1.0, gap_m=4.86))
    handler.take(sample(1.1, ("ego", "world"), gap_m=0.01))
    assert [tell.text for tell in told] == [
        "in the mirror, the twin of ego touches what stands, 4.9 m off the car"
    ]


def test_what_a_mirror_that_was_started_again_says_once_more_counts_once() -> None:
    tables = Tables()
    handler = MirrorHandler(tables, lambda _: None, "ego")  # type: ignore[arg-type]
    for at_s in (1.0, 1.1, 1.2, 1.2, 1.25, 1.1, 1.3):
        handler.take(sample(at_s, ("ego", "van")))
    assert tables.rows == {"mirror": 5, "touches": 5}
    assert handler.stamp_ns == 1_300_000_000


@pytest.mark.parametrize(
    ("gap", "size"),
    [
        ("gap_along_m", 1.6 * 4.0),
        ("gap_across_m", 1.0 * 4.0),
        ("gap_yaw_rad", 0.28),
        ("gap_speed_mps", 2.4),
    ],
)
def test_a_free_twin_beyond_a_limit_of_the_alarms_is_counted(gap: str, size: float) -> None:
    handler = MirrorHandler(Tables(), lambda _: None, "ego")  # type: ignore[arg-type]
    for at_s, share in ((1.0, 0.99), (2.0, 1.01), (3.0, -1.01)):
        handler.take(sample(at_s, since_reset_s=4.0, **{gap: share * size}))
    handler.take(sample(4.0, since_reset_s=4.0, independent=False, **{gap: 9.0 * size}))
    assert handler.record() == {"samples": 3, "beyond_limits": 2}
    assert handler.independent  # a command was lost, the others were not


def test_a_twin_that_ran_by_estimated_commands_alone_is_not_independent() -> None:
    handler = MirrorHandler(Tables(), lambda _: None, "ego")  # type: ignore[arg-type]
    assert handler.independent is None
    handler.take(sample(1.0, independent=False))
    assert handler.independent is False
