"""Windows of a drive that are known: thinned as they become many, and as rows of a table.

The table outlives an orchestrator, so that the windows of one that died are judged with the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from foretwin.contracts.codec import SchemaMismatch, content_bytes, decode_content
from foretwin.contracts.job_identity import vehicle_digest
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.orchestrator.record.kept_rows import kept_rows
from foretwin.sim_worker.analysis.agreement.window import Users, Window

MOST_WINDOWS = 120
"""When there are as many, every second one goes, and they are taken half as often from then on."""
EVERY_NS = 1_000_000_000
TABLE = "windows"


class ThinnedWindows:
    """Takes windows in their order; the same ones leave the same, whoever takes them."""

    def __init__(self) -> None:
        self.kept: list[Window] = []
        self.every_ns = EVERY_NS
        """How far apart windows are to be from now on."""

    @property
    def last_ns(self) -> int | None:
        """The stamp of the newest, None of none."""
        return self.kept[-1].stamp_ns if self.kept else None

    @property
    def world_ids(self) -> set[str]:
        """The Worlds that they lie in."""
        return {window.world_id for window in self.kept}

    def take(self, window: Window) -> bool:
        """Keep a window; returns whether others had to go."""
        self.kept.append(window)
        if len(self.kept) < MOST_WINDOWS:
            return False
        self.kept = self.kept[::2]
        self.every_ns *= 2
        return True


def into_table(
    add: Callable[[str, list[dict[str, Any]]], None], vehicle: VehicleParameters
) -> Callable[[Window], None]:
    """Return what keeps each window of a drive that began with these parameters as a row."""
    digest = vehicle_digest(vehicle)

    def keep(window: Window) -> None:
        named = {name: getattr(window, name) for name in ("round_id", "stamp_ns", "world_id")}
        add(TABLE, [named | {"vehicle": digest, "window": content_bytes(window)}])

    return keep


class KeptWindows(NamedTuple):
    """The windows in a run's tables, and the digest of the vehicle that they are judged with."""

    windows: tuple[Window, ...]
    vehicle: str


def kept_windows(results: Path) -> KeptWindows:
    """Return the windows that can be read; none where a run has no table of them."""
    rows = kept_rows(results, TABLE)
    return KeptWindows(tuple(_windows(rows)), rows[0]["vehicle"] if rows else "")


def _windows(rows: Iterable[dict[str, Any]]) -> Iterator[Window]:
    for row in rows:
        try:
            window = decode_content(row["window"], Window, where=TABLE)
        except SchemaMismatch:  # of another foretwin
            continue
        if _is_one(window):
            yield window


def _is_one(window: Window) -> bool:
    """Whether the arrays of a window fit each other, and hold numbers."""
    count, path = len(window.time_s), window.path_xy_m
    states = (window.simulated, window.driven)
    everybody = (window.simulated_users, window.driven_users)
    return (
        count >= 2
        and window.time_s.shape == (count,)
        and bool((np.diff(window.time_s) > 0.0).all())
        and path.ndim == 2
        and path.shape[1] == 2
        and len(path) >= 2
        and all(one.shape == (count, 8) for one in states)
        and all(bool(np.isfinite(one).all()) for one in (*states, path, window.time_s))
        and all(_are_users(one, count) for one in everybody)
        and window.driven_std.shape == (count, 2)
        and not bool(np.isnan(window.driven_std).any())
        and all(one.stamps_ns.shape == (len(one.colours),) for one in window.heard.values())
    )


def _are_users(users: Users, count: int) -> bool:
    there = users.size_m.shape[0]
    return (
        users.poses.shape == (count, there, 3)
        and users.speed_mps.shape == (count, there)
        and users.size_m.shape == (there, 2)
    )
