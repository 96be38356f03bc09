"""Where a drive was at an instant, by the streets that it came to, and how long it went."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any


def driven_s(record: Mapping[str, Any]) -> float | None:
    """Return how many seconds a drive went by its run.json, None where that is not told.

    Its `drive_time_s` counts from where the log begins, which a drive with `--start` did not see.
    """
    ended_s = record.get("drive_time_s")
    began_s = (record.get("config") or {}).get("start_s") or 0.0
    return None if ended_s is None else max(float(ended_s) - float(began_s), 0.0)


def where_at(drive_time_s: float, intersections: Iterable[Mapping[str, Any]]) -> str:
    """Return `before` or `after` the nearest junction on the way, by when the car was at each.

    `intersections` are those of run.json; empty text where the car came to none.
    """
    reached = [one for one in intersections if one["arrived_at_s"] is not None]
    for one in reached:
        if one["arrived_at_s"] >= drive_time_s:
            return f"before {junction_name(one)}"
    return f"after {junction_name(reached[-1])}" if reached else ""


def junction_name(junction: Mapping[str, Any]) -> str:
    """Return the streets that meet at a junction of run.json, its id where none has a name."""
    return str(junction["name"] or junction["id"])


def instant(drive_time_s: float, intersections: Iterable[Mapping[str, Any]]) -> str:
    """Return `at 13.6 s` with the place, as far as it is known."""
    place = where_at(drive_time_s, intersections)
    return f"at {drive_time_s:.1f} s" + (f", {place}" if place else "")
