"""Events that somebody in the car marks: a key, a note perhaps, and when that was."""

from __future__ import annotations

import msgspec

MOST_NOTE = 2000
"""Characters of a note."""


class MarkRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Marks this instant, or adds a note to an event that was marked: the same id and its stamp.

    `utc_ns` is the clock of whoever asks.
    """

    mark_id: str
    by: str
    utc_ns: int
    note: str = ""
    stamp_ns: int | None = None
    """None: now."""


class EventMark(msgspec.Struct, frozen=True, kw_only=True):
    """An event that was marked, as it stands in the table `marks`.

    A note that came later is a row of its own with the same `mark_id`, without a place.
    """

    mark_id: str
    stamp_ns: int
    drive_time_s: float
    utc_ns: int
    by: str
    note: str = ""
    junction_id: str | None = None
    lat_deg: float | None = None
    lon_deg: float | None = None


class MarkReply(msgspec.Struct, frozen=True, kw_only=True):
    """The event stands in the run's table `marks`."""

    mark_id: str
    stamp_ns: int
    drive_time_s: float
    count: int
    """Events marked so far in this run."""
